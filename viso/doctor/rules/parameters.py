# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN7: parameters that do not fit the stream, or each other."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from ap_visualodom.verdicts import DISABLED, NO_BACKEND
from ekf_stub.ahrs.source_check import ALLOWED
from ekf_stub.inputs.ingest_rules import NO_BUFFER
from ekf_stub.inputs.sources import SourceXY
from ekf_stub.reports.aiding_mode import AidingMode
from mav_handlers.wire.messages import VISION_POSITION_DELTA
from viso.doctor.evidence import EXTNAV, SOURCE_NAMES, Evidence
from viso.doctor.findings import Severity, Sighting, note, vehicle_error, vehicle_note, vehicle_warning
from viso.doctor.measures.sender_clock import FEWEST
from viso.doctor.outputs.phrases import at, listed, seen_in, share

_SOURCES: Final = "AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::pre_arm_check"
_SETS: Final = (1, 2, 3)
_REBOOT: Final = ("VISO_TYPE", "EK3_ENABLE", "AHRS_EKF_TYPE", "EK3_IMU_MASK")
_COMPASS: Final = 1
_COMPASS_FALLBACK: Final = 3
_DELAY_RANGE: Final = (0, 250)
_MAV: Final = 1
_CLIMB_M: Final = 0.3
_EKF2: Final = 2
_WHOLE_LIST: Final = 300
"""No ArduPilot vehicle has fewer parameters."""


@vehicle_error(
    "XN7-01",
    "Visual odometry is off",
    "With VISO_TYPE 0 every message is dropped without a text.",
    DISABLED.rule.source,
    "Set VISO_TYPE to 1 (MAVLink), 2 (T265) or 3 (VOXL), and reboot.",
)
def _off(evidence: Evidence) -> Iterator[Sighting]:
    found = [one for one in evidence.vision if one.verdict is DISABLED]
    is_0, fix = "VISO_TYPE is 0", None
    if evidence.tells_all and len(evidence.told) > _WHOLE_LIST and "VISO_TYPE" not in evidence.told:
        is_0 = f"VISO_TYPE is not among the {len(evidence.told)} parameters: this build has no visual odometry"
        fix = "Flash a build of the firmware that has it; the smallest boards have none unless it is built for them."
    if found:
        yield seen_in(f"{is_0}; {share(len(found), len(evidence.vision))} messages were dropped", found, fix)
    elif not evidence.vision and evidence.is_off and evidence.asks:
        in_use = any(name.startswith("EK3_SRC1") for name in evidence.asks)
        text = f"{is_0}, while {listed(evidence.asks, len(SOURCE_NAMES))} ask for external navigation"
        yield Sighting(text, fix=fix, severity=None if in_use else Severity.WARNING)


@vehicle_error(
    "XN7-02",
    "No backend",
    "The backend is made at boot. Without one all data are dropped, and arming fails: VisOdom: out of memory.",
    NO_BACKEND.rule.source,
    "Set VISO_TYPE to 1, 2 or 3, and reboot.",
)
def _no_backend(evidence: Evidence) -> Iterator[Sighting]:
    found = [one for one in evidence.vision if one.verdict is NO_BACKEND]
    if found:
        at_boot = evidence.viso_type
        why = "was set after boot" if at_boot == 0 else f"is {at_boot}, which names no backend"
        yield seen_in(f"VISO_TYPE {why}; {share(len(found), len(evidence.vision))} messages were dropped", found)


def _deltas(evidence: Evidence) -> bool:
    return any(isinstance(one.message, VISION_POSITION_DELTA) for one in evidence.vision)


@vehicle_error(
    "XN7-03",
    "A source without a message that feeds it",
    "Without poses for EK3_SRC1_POSXY the filter does not start aiding by position. It works without the other "
    "sources.",
    "AP_NavEKF3_Control.cpp, NavEKF3_core::readyToUseExtNav",
    "Send ODOMETRY (pose and velocity), or VISION_SPEED_ESTIMATE beside VISION_POSITION_ESTIMATE; or set the source to "
    "a sensor that the vehicle has.",
)
def _unfed(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.vision:
        return
    has_velocity = bool(evidence.velocities) or _deltas(evidence)
    poses = [name for name in ("POSXY", "POSZ", "YAW") if evidence.source(name) == EXTNAV]
    velocities = [name for name in ("VELXY", "VELZ") if evidence.source(name) == EXTNAV]
    if poses and not evidence.poses:
        yield Sighting(f"{_parameters(poses)} {_is(poses)} 6 (ExtNav), and the stream carries no poses")
    if velocities and not has_velocity:
        has_position = "POSXY" in poses and bool(evidence.poses)
        aids = any(span.mode is not AidingMode.NONE for span in evidence.aiding)
        without = ": it navigates by poses alone" if has_position and aids else ""
        yield Sighting(
            f"{_parameters(velocities)} {_is(velocities)} 6 (ExtNav), and the stream carries no velocities{without}",
            severity=Severity.WARNING if has_position else None,
        )


def _parameters(names: list[str]) -> str:
    return " and ".join(f"EK3_SRC1_{name}" for name in names)


def _is(names: list[str]) -> str:
    return "is" if len(names) == 1 else "are"


@vehicle_error(
    "XN7-04",
    "No source names external navigation",
    "The filter makes its buffers at boot, and only if some source is 6; without them every sample is discarded.",
    NO_BUFFER.source,
    "Set EK3_SRC1_POSXY 6 and, as far as the stream carries them, EK3_SRC1_VELXY, VELZ and YAW; then reboot.",
)
def _unused(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.vision or evidence.viso_type == 0:
        return
    if not any(evidence.source(name, number) == EXTNAV for name in SOURCE_NAMES for number in _SETS):
        refused = [
            one
            for one in evidence.vision
            if any(fate.outcome.rule is NO_BUFFER for sample in one.samples for fate in sample.fates)
        ]
        yield Sighting(
            f"no EK3_SRCn parameter is 6 (ExtNav); {share(len(refused), len(evidence.vision))} messages were in vain",
            [one.number for one in refused],
        )


@vehicle_warning(
    "XN7-05",
    "Sources of a set that is not active",
    "After boot set 1 is in use; others only after a switch by RC function 90 or MAV_CMD_SET_EKF_SOURCE_SET.",
    "AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::setPosVelYawSourceSet",
    "Switch sets, or move the sources to EK3_SRC1.",
)
def _not_active(evidence: Evidence) -> Iterator[Sighting]:
    in_first = any(evidence.source(name) == EXTNAV for name in SOURCE_NAMES)
    later = [n for n in _SETS[1:] if any(evidence.source(name, n) == EXTNAV for name in SOURCE_NAMES)]
    if evidence.vision and later and not in_first:
        yield Sighting(f"only source set {later[0]} names external navigation; set 1 is in use after boot")


@vehicle_note(
    "XN7-06",
    "Velocities are not used",
    "They are stored and never fused. They still lengthen the time until the filter gives up a height.",
    "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::SelectVelPosFusion",
    "Set EK3_SRC1_VELXY and VELZ to 6 if the velocities are good.",
)
def _velocity_unused(evidence: Evidence) -> Iterator[Sighting]:
    has_source = EXTNAV in (evidence.source("VELXY"), evidence.source("VELZ"))
    if evidence.velocities and evidence.source("POSXY") == EXTNAV and not has_source:
        yield Sighting(f"{evidence.velocities[0].track.sender} carries velocities; EK3_SRC1_VELXY and VELZ are not 6")


@vehicle_error(
    "XN7-07",
    "Illegal source",
    "Arming fails, also for a set that is not in use.",
    _SOURCES,
    "Set it to 6 (ExtNav), or to another legal value.",
)
def _illegal(evidence: Evidence) -> Iterator[Sighting]:
    seen = evidence.ground.flows or evidence.ground.ranges
    by_flow = any(evidence.source(name, number) == SourceXY.OPTFLOW for name in SOURCE_NAMES for number in _SETS)
    for number in _SETS if evidence.is_concerned or seen or by_flow else ():
        for name in SOURCE_NAMES:
            value = evidence.source(name, number)
            if value not in ALLOWED[name]:
                legal, of_flow = ", ".join(str(int(one)) for one in ALLOWED[name]), ("POSXY", SourceXY.OPTFLOW)
                yield Sighting(
                    f"EK3_SRC{number}_{name} is {value}; there are {legal}: PreArm: AHRS: Check EK3_SRC{number}_{name}",
                    fix="Set it to 0: flow tells no position." if (name, value) == of_flow else None,
                )


@vehicle_error(
    "XN7-08",
    "No source of yaw",
    "Without one the filter cannot hold a position: with EK3_SRC1_POSXY 6 it starts and stops with every sample.",
    "AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode",
    "Set EK3_SRC1_YAW to 6 if the stream carries the heading; else enable a compass.",
)
def _no_yaw(evidence: Evidence) -> Iterator[Sighting]:
    yaw = evidence.source("YAW") if evidence.is_concerned else None
    if yaw == 0:
        yield Sighting("EK3_SRC1_YAW is 0")
    elif yaw in (_COMPASS, _COMPASS_FALLBACK) and not evidence.has_compass:
        yield Sighting(f"EK3_SRC1_YAW is {yaw} (compass), and COMPASS_ENABLE or COMPASS_USE is 0")


@vehicle_warning(
    "XN7-09",
    "Vertical velocity alone",
    "Vertical velocity is fused only together with horizontal velocity.",
    "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::SelectVelPosFusion",
    "Set EK3_SRC1_VELXY to 6 as well, or VELZ to 0.",
)
def _vertical_only(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.source("VELZ") == EXTNAV and evidence.source("VELXY") == 0 and evidence.velocities:
        yield Sighting("EK3_SRC1_VELZ is 6 and EK3_SRC1_VELXY is 0")


@vehicle_error(
    "XN7-10",
    "Velocity without a position",
    "Velocity alone never starts aiding; on a moving vehicle it upsets the filter, which resets every few seconds.",
    "AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode",
    "Send poses too, and set EK3_SRC1_POSXY to 6; or send VISION_POSITION_DELTA.",
)
def _no_position(evidence: Evidence) -> Iterator[Sighting]:
    uses = EXTNAV in (evidence.source("VELXY"), evidence.source("VELZ"))
    if evidence.velocities and uses and evidence.source("POSXY") == 0 and not _deltas(evidence):
        yield Sighting("EK3_SRC1_POSXY is 0, and velocity is all that is used")


@vehicle_error(
    "XN7-11",
    "Height from a stream without height",
    "z is used as the height in any case.",
    "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion",
    "Set EK3_SRC1_POSZ to 1 (barometer), and EK3_SRC1_VELZ to 0.",
)
def _flat_height(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.source("POSZ") != EXTNAV:
        return
    for poses in evidence.poses:
        if len(poses.track) < FEWEST or not np.isfinite(poses.pos_m).all():
            continue
        moved = float(np.ptp(poses.pos_m[:, :2], axis=0).max())
        if np.ptp(poses.pos_m[:, 2]) == 0 and moved > _CLIMB_M:
            value = float(poses.pos_m[0, 2])
            yield Sighting(
                f"{poses.track.sender}: z is always {value:g} while x and y change by {moved:.1f} m",
                poses.track.numbers.tolist(),
            )


@vehicle_error(
    "XN7-12",
    "EKF3 is not in use",
    "Other estimators do not have source sets and use little or nothing of external navigation.",
    "AP_AHRS.cpp, AP_AHRS::update_EKF3",
    "Set AHRS_EKF_TYPE 3 and EK3_ENABLE 1, and reboot.",
)
def _filter_off(evidence: Evidence) -> Iterator[Sighting]:
    kind, enabled = int(evidence.param("AHRS_EKF_TYPE")), int(evidence.param("EK3_ENABLE"))
    if evidence.flown is not None and not evidence.flown.has_sources:
        kind = int(evidence.told.get("AHRS_EKF_TYPE", _EKF2))
        if evidence.is_concerned and kind != _EKF2:
            text = f"AHRS_EKF_TYPE is {kind}, and before 4.1 no other estimator than EKF2 takes external navigation"
            yield Sighting(text, fix="Set AHRS_EKF_TYPE 2 and EK2_ENABLE 1 and reboot, or go to 4.1 or later.")
    elif evidence.is_concerned and (kind != 3 or enabled == 0):
        what = {10: ", the simulator's own attitude and position", 11: ", an external estimator"}.get(kind, "")
        yield Sighting(f"AHRS_EKF_TYPE is {kind}{what}, and EK3_ENABLE is {enabled}")


@vehicle_warning(
    "XN7-13",
    "A parameter needs a reboot",
    "The autopilot read it at boot. Until the next boot the old value acts, wholly or in part.",
    "AP_VisualOdom.cpp, AP_VisualOdom::init; AP_NavEKF3_core.cpp, NavEKF3_core::setup_core",
    "Reboot the autopilot.",
)
def _reboot_needed(evidence: Evidence) -> Iterator[Sighting]:
    for change in evidence.changes:
        sources = change.name.startswith("EK3_SRC") and change.new == EXTNAV
        had_none = not any(evidence.source(name, n) == EXTNAV for name in SOURCE_NAMES for n in _SETS)
        if change.name in _REBOOT or (sources and had_none):
            yield Sighting(
                f"{change.name} changed from {change.old:g} to {change.new:g} at {at(change.time_us)}",
                start_us=change.time_us,
                end_us=change.time_us,
            )


@vehicle_note(
    "XN7-14",
    "VISO_ORIENT without effect",
    "Type 1 passes poses on unchanged; the orientation rotates attitudes of types 2 and 3, and deltas.",
    "AP_VisualOdom_MAV.cpp, AP_VisualOdom_MAV::handle_pose_estimate",
    "Rotate the data in the sender, or use VISO_TYPE 2 or 3.",
)
def _no_effect(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.viso_type == _MAV and evidence.param("VISO_ORIENT") != 0 and not _deltas(evidence):
        yield Sighting(f"VISO_ORIENT is {evidence.param('VISO_ORIENT'):.0f}, VISO_TYPE is 1")


@vehicle_warning(
    "XN7-15",
    "A value that makes no sense",
    "Ranges are for ground stations; the firmware accepts any value.",
    "AP_VisualOdom.cpp, AP_VisualOdom::var_info",
    "Set it within its range.",
)
def _out_of_range(evidence: Evidence) -> Iterator[Sighting]:
    delay, quality = evidence.param("VISO_DELAY_MS"), evidence.param("VISO_QUAL_MIN")
    scale = evidence.param("VISO_SCALE")
    if not _DELAY_RANGE[0] <= delay <= _DELAY_RANGE[1]:
        yield Sighting(f"VISO_DELAY_MS is {delay:.0f}; 0 to 250 make sense")
    if quality > 100:
        yield Sighting(f"VISO_QUAL_MIN is {quality:.0f}; the best quality is 100")
    if scale <= 0:
        yield Sighting(f"VISO_SCALE is {scale:g}: positions vanish or are mirrored")
    for name, most in (("VISO_POS_M_NSE", 100.0), ("VISO_YAW_M_NSE", 1.5)):
        if evidence.param(name) > most:
            yield Sighting(f"{name} is {evidence.param(name):g}, above the limit of {most:g}")


@note(
    "XN7-16",
    "Parameters were assumed",
    "What your autopilot does depends on its own parameters.",
    "AP_VisualOdom.cpp, AP_VisualOdom::var_info; AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::var_info",
    "Give them: --defaults FILE.parm, or --param NAME=VALUE.",
)
def _assumed(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.assumed:
        values = ", ".join(f"{one.name} {one.value:g} ({one.why})" for one in evidence.assumed)
        yield Sighting(f"these were not given, so defaults were assumed: {values}")


@vehicle_note(
    "XN7-17",
    "External navigation is not set up",
    "With VISO_TYPE 0 every message is dropped, and without a source that is 6 the filter uses none.",
    DISABLED.rule.source,
    "Nothing, if none is wanted. Else set VISO_TYPE 1 and the EK3_SRC1_ parameters to 6 for what the camera measures, "
    "reboot, and send ODOMETRY.",
)
def _not_set_up(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.vision and evidence.is_off and not evidence.asks:
        yield Sighting("nothing asks for external navigation, and no message of it is there")
