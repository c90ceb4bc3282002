# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN7: parameters that do not fit the stream, or each other."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from ap_visualodom.verdicts import DISABLED, NO_BACKEND
from ekf_stub.ahrs.sources import ALLOWED, EXTNAV, ROWS, SourceXY
from ekf_stub.inputs.ingest_rules import NO_BUFFER
from ekf_stub.reports import AidingMode
from mav_handlers.wire.messages import VISION_POSITION_DELTA
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, listed, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import VELOCITY, Witness
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.vehicle_position import SOURCE_SETS

_SOURCES: Final = "AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::pre_arm_check"
_REBOOT: Final = ("VISO_TYPE", "EK3_ENABLE", "AHRS_EKF_TYPE", "EK3_IMU_MASK")
_COMPASS: Final = 1
_COMPASS_FALLBACK: Final = 3
_MAV: Final = 1
_EKF2: Final = 2


@check(
    code="XN7-01",
    severity=Severity.ERROR,
    title="Visual odometry is off",
    firmware="With VISO_TYPE 0 every message is dropped without a text.",
    source=DISABLED.rule.source,
    fix="Set VISO_TYPE to 1 (MAVLink), 2 (T265) or 3 (VOXL), and reboot.",
    witness=Witness.LOG,
)
def visual_odometry_off(evidence: Evidence) -> Iterator[Sighting]:
    found = [message for message in evidence.stream.vision if message.verdict is DISABLED]
    is_0, fix, known = "VISO_TYPE is 0", None, evidence.set_up.known
    if evidence.set_up.lacks_visual_odometry:
        is_0 = f"VISO_TYPE is not among the {len(known)} parameters: this build has no visual odometry"
        fix = "Flash a build of the firmware that has it; the smallest boards have none unless it is built for them."
    if found:
        yield Sighting.in_messages(
            f"{is_0}; {share(len(found), len(evidence.stream.vision))} messages were dropped", found, fix
        )
    elif not evidence.stream.vision and evidence.is_off and evidence.requests:
        in_use = any(name.startswith("EK3_SRC1") for name in evidence.requests)
        text = f"{is_0}, while {listed(evidence.requests, len(ROWS))} ask for external navigation"
        yield Sighting(text, fix=fix, severity=None if in_use else Severity.WARNING)


@check(
    code="XN7-02",
    severity=Severity.ERROR,
    title="No backend",
    firmware="The backend is made at boot. Without one all data are dropped, and arming fails: VisOdom: out of memory.",
    source=NO_BACKEND.rule.source,
    fix="Set VISO_TYPE to 1, 2 or 3, and reboot.",
    witness=Witness.LOG,
)
def no_backend(evidence: Evidence) -> Iterator[Sighting]:
    found = [message for message in evidence.stream.vision if message.verdict is NO_BACKEND]
    if found:
        at_boot = evidence.viso_type
        why = "was set after boot" if at_boot == 0 else f"is {at_boot}, which names no backend"
        yield Sighting.in_messages(
            f"VISO_TYPE {why}; {share(len(found), len(evidence.stream.vision))} messages were dropped", found
        )


def _deltas(evidence: Evidence) -> bool:
    return any(isinstance(message.message, VISION_POSITION_DELTA) for message in evidence.stream.vision)


@check(
    code="XN7-03",
    severity=Severity.ERROR,
    title="A source without a message that feeds it",
    firmware=(
        "Without poses for EK3_SRC1_POSXY the filter does not start aiding by position. It works without the other "
        "sources."
    ),
    source="AP_NavEKF3_Control.cpp, NavEKF3_core::readyToUseExtNav",
    fix=(
        "Send ODOMETRY (pose and velocity), or VISION_SPEED_ESTIMATE beside VISION_POSITION_ESTIMATE; or set the "
        "source to a sensor that the vehicle has."
    ),
    witness=Witness.LOG,
)
def source_without_message(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.stream.vision:
        return
    has_velocity = bool(evidence.stream.velocities) or _deltas(evidence)
    poses = [name for name in ("POSXY", "POSZ", "YAW") if evidence.source(name) == EXTNAV]
    velocities = [name for name in ("VELXY", "VELZ") if evidence.source(name) == EXTNAV]
    aids = any(span.mode is not AidingMode.NONE for span in evidence.trial.aiding)
    if poses and not evidence.stream.poses:
        by_deltas = poses == ["POSXY"] and _deltas(evidence) and aids
        how = ": by VISION_POSITION_DELTA it navigates relatively, from where it starts" if by_deltas else ""
        yield Sighting(
            f"{_parameters(poses)} {_is(poses)} 6 (ExtNav), and the stream carries no poses{how}",
            fix="Nothing, if a position relative to the start will do; else send poses." if by_deltas else None,
            severity=Severity.NOTE if by_deltas else None,
        )
    if velocities and not has_velocity:
        has_position = "POSXY" in poses and bool(evidence.stream.poses)
        without = ": it navigates by poses alone" if has_position and aids else ""
        yield Sighting(
            f"{_parameters(velocities)} {_is(velocities)} 6 (ExtNav), and the stream carries no velocities{without}",
            severity=Severity.WARNING if has_position else None,
        )


def _parameters(names: list[str]) -> str:
    return " and ".join(f"EK3_SRC1_{name}" for name in names)


def _is(names: list[str]) -> str:
    return "is" if len(names) == 1 else "are"


@check(
    code="XN7-04",
    severity=Severity.ERROR,
    title="No source names external navigation",
    firmware=(
        "The filter makes its buffers at boot, and only if some source is 6; without them every sample is discarded."
    ),
    source=NO_BUFFER.source,
    fix="Set EK3_SRC1_POSXY 6 and, as far as the stream carries them, EK3_SRC1_VELXY, VELZ and YAW; then reboot.",
    witness=Witness.LOG,
)
def no_source(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.stream.vision or evidence.viso_type == 0:
        return
    if not any(evidence.source(name, number) == EXTNAV for name in ROWS for number in SOURCE_SETS):
        refused = [
            message
            for message in evidence.stream.vision
            if any(test.outcome.rule is NO_BUFFER for sample in message.samples for test in sample.outcomes)
        ]
        yield Sighting(
            f"no EK3_SRCn parameter is 6 (ExtNav); {share(len(refused), len(evidence.stream.vision))} messages were in "
            "vain",
            [message.number for message in refused],
        )


@check(
    code="XN7-05",
    severity=Severity.WARNING,
    title="Sources of a set that is not active",
    firmware="After boot set 1 is in use; others only after a switch by RC function 90 or MAV_CMD_SET_EKF_SOURCE_SET.",
    source="AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::setPosVelYawSourceSet",
    fix="Switch sets, or move the sources to EK3_SRC1.",
    witness=Witness.LOG,
)
def inactive_source_set(evidence: Evidence) -> Iterator[Sighting]:
    in_first = any(evidence.source(name) == EXTNAV for name in ROWS)
    later = [n for n in SOURCE_SETS[1:] if any(evidence.source(name, n) == EXTNAV for name in ROWS)]
    if not evidence.stream.vision or not later or in_first:
        return
    own = evidence.vehicle.own_filter
    is_known = own is not None and bool((own.sources >= 0).all(axis=1).any())
    if own is not None and is_known and bool((own.sources == EXTNAV).any()):
        return
    but = ", but EK3_SRC_OPTIONS fuses the velocities of all sets" if evidence.velocities_of_other_sets else ""
    use = "no other was chosen in this recording" if is_known else "set 1 is in use after boot"
    yield Sighting(f"only source set {later[0]} names external navigation; {use}{but}")


@check(
    code="XN7-06",
    severity=Severity.NOTE,
    title="Velocities are not used",
    firmware="They are stored and never fused. They still lengthen the time until the filter gives up a height.",
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::SelectVelPosFusion",
    fix="Set EK3_SRC1_VELXY and VELZ to 6 if the velocities are good.",
    witness=Witness.LOG,
)
def velocities_not_used(evidence: Evidence) -> Iterator[Sighting]:
    has_source = EXTNAV in (evidence.source("VELXY"), evidence.source("VELZ")) or evidence.velocities_of_other_sets
    if evidence.stream.velocities and evidence.source("POSXY") == EXTNAV and not has_source:
        yield Sighting(
            f"{evidence.stream.velocities[0].track.sender} carries velocities; EK3_SRC1_VELXY and VELZ are not 6"
        )


@check(
    code="XN7-07",
    severity=Severity.ERROR,
    title="Illegal source",
    firmware="Arming fails, also for a set that is not in use.",
    source=_SOURCES,
    fix="Set it to 6 (ExtNav), or to another legal value.",
    witness=Witness.LOG,
)
def illegal_source(evidence: Evidence) -> Iterator[Sighting]:
    has_sensors = evidence.vehicle.ground.flows or evidence.vehicle.ground.ranges
    by_flow = any(evidence.source(name, number) == SourceXY.OPTFLOW for name in ROWS for number in SOURCE_SETS)
    for number in SOURCE_SETS if evidence.is_concerned or has_sensors or by_flow else ():
        for name in ROWS:
            value = evidence.source(name, number)
            if value not in ALLOWED[name]:
                legal, of_flow = ", ".join(str(int(source)) for source in ALLOWED[name]), ("POSXY", SourceXY.OPTFLOW)
                yield Sighting(
                    f"EK3_SRC{number}_{name} is {value}; there are {legal}: PreArm: AHRS: Check EK3_SRC{number}_{name}",
                    fix="Set it to 0: flow tells no position." if (name, value) == of_flow else None,
                )


@check(
    code="XN7-08",
    severity=Severity.ERROR,
    title="No source of yaw",
    firmware=(
        "Without one the filter cannot hold a position: with EK3_SRC1_POSXY 6 it starts and stops with every sample."
    ),
    source="AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode",
    fix="Set EK3_SRC1_YAW to 6 if the stream carries the heading; else enable a compass.",
    witness=Witness.LOG,
)
def no_yaw_source(evidence: Evidence) -> Iterator[Sighting]:
    yaw = evidence.source("YAW") if evidence.is_concerned else None
    if yaw == 0:
        yield Sighting("EK3_SRC1_YAW is 0")
    elif yaw in (_COMPASS, _COMPASS_FALLBACK) and not evidence.has_compass:
        yield Sighting(f"EK3_SRC1_YAW is {yaw} (compass), and COMPASS_ENABLE or COMPASS_USE is 0")


@check(
    code="XN7-09",
    severity=Severity.WARNING,
    title="Vertical velocity alone",
    firmware="Vertical velocity is fused only together with horizontal velocity.",
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::SelectVelPosFusion",
    fix="Set EK3_SRC1_VELXY to 6 as well, or VELZ to 0.",
    witness=Witness.LOG,
)
def vertical_velocity_alone(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.source("VELZ") == EXTNAV and evidence.source("VELXY") == 0 and evidence.stream.velocities:
        yield Sighting("EK3_SRC1_VELZ is 6 and EK3_SRC1_VELXY is 0")


@check(
    code="XN7-10",
    severity=Severity.ERROR,
    title="Velocity without a position",
    firmware=(
        "Velocity alone never starts aiding; on a moving vehicle it upsets the filter, which resets every few seconds."
    ),
    source="AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode",
    fix="Send poses too, and set EK3_SRC1_POSXY to 6; or send VISION_POSITION_DELTA.",
    witness=Witness.LOG,
)
def velocity_without_position(evidence: Evidence) -> Iterator[Sighting]:
    uses = EXTNAV in (evidence.source("VELXY"), evidence.source("VELZ"))
    if evidence.stream.velocities and uses and evidence.source("POSXY") == 0 and not _deltas(evidence):
        yield Sighting("EK3_SRC1_POSXY is 0, and velocity is all that is used")


@check(
    code="XN7-11",
    severity=Severity.ERROR,
    title="Height from a stream without height",
    firmware="z is used as the height in any case.",
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion",
    fix="Set EK3_SRC1_POSZ to 1 (barometer), and EK3_SRC1_VELZ to 0.",
    witness=Witness.LOG,
)
def flat_height(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.source("POSZ") != EXTNAV:
        return
    for poses in evidence.stream.poses:
        if len(poses.track) < FEWEST_MESSAGES or not np.isfinite(poses.pos_m).all():
            continue
        moved = float(np.ptp(poses.pos_m[:, :2], axis=0).max())
        if np.ptp(poses.pos_m[:, 2]) == 0 and moved > limits.FLAT_MOVED_M:
            value = float(poses.pos_m[0, 2])
            yield Sighting(
                f"{poses.track.sender}: z is always {value:g} while x and y change by {moved:.1f} m",
                poses.track.numbers.tolist(),
            )


@check(
    code="XN7-12",
    severity=Severity.ERROR,
    title="EKF3 is not in use",
    firmware="Other estimators do not have source sets and use little or nothing of external navigation.",
    source="AP_AHRS.cpp, AP_AHRS::update_EKF3",
    fix="Set AHRS_EKF_TYPE 3 and EK3_ENABLE 1, and reboot.",
    witness=Witness.LOG,
)
def ekf3_off(evidence: Evidence) -> Iterator[Sighting]:
    # Of the recording: the vehicle that tries the stream replaces EKF2 as it boots.
    kind = int(evidence.set_up.known.get("AHRS_EKF_TYPE", evidence.param("AHRS_EKF_TYPE")))
    enabled = int(evidence.param("EK3_ENABLE"))
    flown = evidence.set_up.judged_by.stands_for
    if flown is not None and not flown.has_sources:
        kind = int(evidence.set_up.known.get("AHRS_EKF_TYPE", _EKF2))
        if evidence.is_concerned and kind != _EKF2:
            text = f"AHRS_EKF_TYPE is {kind}, and before 4.1 no other estimator than EKF2 takes external navigation"
            yield Sighting(text, fix="Set AHRS_EKF_TYPE 2 and EK2_ENABLE 1 and reboot, or go to 4.1 or later.")
    elif evidence.is_concerned and (kind != 3 or enabled == 0):
        what = {
            0: ", DCM (without EKF2 a Copter takes EKF3, but since 4.7 does not arm)",
            10: ", the simulator's own attitude and position",
            11: ", an external estimator",
        }.get(kind, "")
        yield Sighting(f"AHRS_EKF_TYPE is {kind}{what}, and EK3_ENABLE is {enabled}")


@check(
    code="XN7-13",
    severity=Severity.WARNING,
    title="A parameter needs a reboot",
    firmware="The autopilot read it at boot. Until the next boot the old value acts, wholly or in part.",
    source="AP_VisualOdom.cpp, AP_VisualOdom::init; AP_NavEKF3_core.cpp, NavEKF3_core::setup_core",
    fix="Reboot the autopilot.",
    witness=Witness.LOG,
)
def reboot_needed(evidence: Evidence) -> Iterator[Sighting]:
    for change in evidence.vehicle.changes:
        sources = change.name.startswith("EK3_SRC") and change.new == EXTNAV
        had_none = not any(evidence.source(name, n) == EXTNAV for name in ROWS for n in SOURCE_SETS)
        if change.name in _REBOOT or (sources and had_none):
            yield Sighting(
                f"{change.name} changed from {change.old:g} to {change.new:g} at {at(change.time_us)}",
                start_us=change.time_us,
                end_us=change.time_us,
            )


@check(
    code="XN7-14",
    severity=Severity.NOTE,
    title="VISO_ORIENT without effect",
    firmware="Type 1 passes poses on unchanged; the orientation rotates attitudes of types 2 and 3, and deltas.",
    source="AP_VisualOdom_MAV.cpp, AP_VisualOdom_MAV::handle_pose_estimate",
    fix="Rotate the data in the sender, or use VISO_TYPE 2 or 3.",
    witness=Witness.LOG,
)
def orient_without_effect(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.viso_type == _MAV and evidence.param("VISO_ORIENT") != 0 and not _deltas(evidence):
        yield Sighting(f"VISO_ORIENT is {evidence.param('VISO_ORIENT'):.0f}, VISO_TYPE is 1")


@check(
    code="XN7-15",
    severity=Severity.WARNING,
    title="A value that makes no sense",
    firmware="Ranges are for ground stations; the firmware accepts any value.",
    source="AP_VisualOdom.cpp, AP_VisualOdom::var_info",
    fix="Set it within its range.",
    witness=Witness.LOG,
)
def value_out_of_range(evidence: Evidence) -> Iterator[Sighting]:
    delay, quality = evidence.param("VISO_DELAY_MS"), evidence.param("VISO_QUAL_MIN")
    scale = evidence.param("VISO_SCALE")
    if not limits.VISO_DELAY_RANGE_MS[0] <= delay <= limits.VISO_DELAY_RANGE_MS[1]:
        yield Sighting(f"VISO_DELAY_MS is {delay:.0f}; 0 to 250 make sense")
    if quality > 100:
        yield Sighting(f"VISO_QUAL_MIN is {quality:.0f}; the best quality is 100")
    if scale <= 0:
        yield Sighting(f"VISO_SCALE is {scale:g}: positions vanish or are mirrored")
    for name, most in (("VISO_POS_M_NSE", 100.0), ("VISO_YAW_M_NSE", 1.5)):
        if evidence.param(name) > most:
            yield Sighting(f"{name} is {evidence.param(name):g}, above the limit of {most:g}")


@check(
    code="XN7-16",
    severity=Severity.NOTE,
    title="Parameters were assumed",
    firmware="What your autopilot does depends on its own parameters.",
    source="AP_VisualOdom.cpp, AP_VisualOdom::var_info; AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::var_info",
    fix="Give them: --defaults FILE.parm, or --param NAME=VALUE.",
)
def assumed_parameters(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.set_up.assumed:
        values = ", ".join(
            f"{parameter.name} {parameter.value:g} ({parameter.why})" for parameter in evidence.set_up.assumed
        )
        yield Sighting(f"these were not given, so defaults were assumed: {values}")


@check(
    code="XN7-17",
    severity=Severity.NOTE,
    title="External navigation is not set up",
    firmware="With VISO_TYPE 0 every message is dropped, and without a source that is 6 the filter uses none.",
    source=DISABLED.rule.source,
    fix=(
        "Nothing, if none is wanted. Else set VISO_TYPE 1 and the EK3_SRC1_ parameters to 6 for what the camera "
        "measures, reboot, and send ODOMETRY."
    ),
    witness=Witness.LOG,
)
def not_set_up(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.stream.vision and evidence.is_off and not evidence.requests:
        yield Sighting("nothing asks for external navigation, and no message of it is there")


def _armed_unhealthy(evidence: Evidence) -> Iterator[tuple[float, str]]:
    """Yield when the vehicle was armed while the vision sensor was unhealthy, in s, and what shows that."""
    own, sensor = evidence.vehicle.own_filter, evidence.vision_sensor
    if own is None or evidence.is_sensor_shared:
        return
    taken_us = np.array([message.arrival_us for message in evidence.stream.vision if message.is_taken], dtype=np.int64)
    for start_s, end_s in own.armed or ():
        start_us, end_us = int(start_s * 1e6), int(end_s * 1e6)
        if sensor is not None and len(sensor.time_us):
            latest = int(np.searchsorted(sensor.time_us, start_us, side="right")) - 1
            is_near = latest >= 0 and start_us - sensor.time_us[latest] < limits.STATUS_NEAR_US
            if is_near and sensor.enabled[latest] and not sensor.healthy[latest]:
                within = sensor.enabled & (sensor.time_us >= start_us) & (sensor.time_us <= end_us)
                ill = share(int((within & ~sensor.healthy).sum()), int(within.sum()))
                yield start_s, f"SYS_STATUS, unhealthy in {ill} messages while armed"
        elif len(taken_us) and len(own.time_us) and own.time_us[0] < start_us - limits.STATUS_NEAR_US:
            latest = int(np.searchsorted(taken_us, start_us, side="right")) - 1
            if latest < 0:
                yield start_s, f"no message before {at(taken_us[0])}"
            elif start_us - taken_us[latest] > limits.HEALTHY_US:
                yield start_s, f"no message for {1e-6 * (start_us - taken_us[latest]):.1f} s"


@check(
    code="XN7-18",
    severity=Severity.ERROR,
    title="Arming does not wait for the vision sensor",
    firmware=(
        "The vision check is bit 18 of ARMING_CHECK (with bit 0 every check is made), later of ARMING_SKIPCHK, which "
        "names the checks to leave out. Without it, or by force, a vehicle arms whether external navigation comes or "
        "not."
    ),
    source="AP_Arming.cpp, AP_Arming::visodom_checks",
    fix=(
        "Turn the check on: ARMING_CHECK 1, or add 262144 (bit 18) to it; from 4.7 on take bit 18 off ARMING_SKIPCHK. "
        "Do not arm by force, and find out why no message comes."
    ),
    witness=Witness.LOG,
)
def arms_without_vision(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.set_up.known.get("VISO_TYPE"):
        return
    checks, setting = evidence.checks_vision, evidence.arming_parameter
    why = {
        None: "whether arming checks it is not in the recording",
        False: f"{setting} leaves the vision check (bit 18) out",
        True: f"{setting} asks for the check, so it was armed by force, or the check was changed",
    }[checks]
    found = list(_armed_unhealthy(evidence))
    for start_s, shown in found[:1]:
        often = "" if len(found) == 1 else f", {len(found)} times"
        yield Sighting(
            f"armed at {at(1e6 * start_s)}{often} with an unhealthy vision sensor ({shown}): {why}",
            start_us=int(1e6 * start_s),
            severity=None if EXTNAV in (evidence.source("POSXY"), evidence.source("VELXY")) else Severity.WARNING,
        )
    if checks is False and not found:
        yield Sighting(f"{why}: the vehicle would arm with an unhealthy camera", severity=Severity.NOTE)


@check(
    code="XN7-19",
    severity=Severity.WARNING,
    title="Velocities of sets that are not active are fused, too",
    firmware=(
        "Bit 0 of EK3_SRC_OPTIONS fuses the velocities that any source set names, whichever set is active: those of a "
        "camera beside those of a GPS. In 4.6 the bit is set by default."
    ),
    source="AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::useVelXYSource",
    fix="Take bit 0 off EK3_SRC_OPTIONS, unless both velocities are good, in the same axes, and wanted at once.",
    witness=Witness.LOG,
)
def all_velocities_fused(evidence: Evidence) -> Iterator[Sighting]:
    named = evidence.velocities_of_other_sets
    if not named or not (evidence.stream.velocities or _deltas(evidence)):
        return
    own = evidence.vehicle.own_filter
    over = None if own is None else own.over_one(VELOCITY, ~own.fed_by_extnav(VELOCITY))
    much = over is not None and over.over_s >= limits.RATIO_SHORT_S
    contradict = ""
    if over is not None and much:
        contradict = (
            f"; the velocity test ratio was above 1 for {over.over_s:.1f} s: the velocities contradict each other"
        )
    yield Sighting(
        f"EK3_SRC_OPTIONS is {evidence.param('EK3_SRC_OPTIONS'):.0f}, and {listed(named)} {_is(named)} 6 (ExtNav) "
        f"while set 1 has another source: the stream's velocities are fused all the time{contradict}",
        severity=Severity.ERROR if much else None,
    )
