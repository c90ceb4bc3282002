# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN8: does the stream's frame agree with the vehicle's attitude, and would it be aligned?"""

import itertools
import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import EXTNAV, SourceXY
from ekf_stub.core.params import ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW
from viso.doctor.checks import limits
from viso.doctor.checks.beside_vehicle import ALIGNED, aligned_us, lasting
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, share
from viso.doctor.evidence.compare import ALIGNING_TYPES, comparison_of, oriented
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.tracks import Bools, Floats, Ints, Poses, down_in_body
from viso.doctor.evidence.vehicle_position import SOURCE_SETS
from viso.geometry.rotation import euler_from_quats

_ALIGN: Final = "AP_VisualOdom_IntelT265.cpp, AP_VisualOdom_IntelT265::align_yaw_to_ahrs"
_BY_EXTNAV: Final = "is using external nav data"
_YAW_BY_STREAM: Final = (
    "Rotate the stream's frame to north in the sender, if north matters, as beside a GPS; EK3_SRC1_YAW is 6 already, "
    "so the vehicle's yaw should be the stream's: look why the filter does not follow it (XN9-10, yaw)."
)
_NEVER_US: Final = 1 << 62


@check(
    code="XN8-01",
    severity=Severity.NOTE,
    title="The camera's frame is rotated to north",
    firmware=(
        "Once the AHRS has settled, types 2 and 3 rotate the camera's frame so that its yaw agrees, and report it in a "
        "text."
    ),
    source=_ALIGN,
    fix="Nothing, if the shift is the angle that you expect between the camera's frame and north.",
)
def alignment_shift(evidence: Evidence) -> Iterator[Sighting]:
    for time_us, _, text in evidence.trial.texts:
        if text.startswith(ALIGNED):
            known = "" if evidence.vehicle.attitude is not None else ", if the vehicle points north at first"
            yield Sighting(f'at {at(time_us)} it would say "{text}"{known}', start_us=time_us, end_us=time_us)


@check(
    code="XN8-02",
    severity=Severity.NOTE,
    title="Alignment is refused",
    firmware=(
        "With yaw from external navigation the camera's yaw is the vehicle's heading, and nothing is aligned: north is "
        "where the camera's x axis points."
    ),
    source=_ALIGN,
    fix=(
        "Start with the vehicle facing north, or accept that headings are relative; else EK3_SRC1_YAW 1 with a compass."
    ),
)
def alignment_refused(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.viso_type in ALIGNING_TYPES and evidence.source("YAW") == EXTNAV and evidence.stream.poses:
        yield Sighting(f"VISO_TYPE is {evidence.viso_type}, and EK3_SRC1_YAW is 6 (ExtNav)")


@check(
    code="XN8-03",
    severity=Severity.ERROR,
    title="Alignment never happens",
    firmware=(
        "Types 2 and 3 wait for a yaw that comes from a compass, for ever; the camera's frame stays as it is, against "
        "whatever yaw the filter has."
    ),
    source=_ALIGN,
    fix="Enable a compass, or set EK3_SRC1_YAW to 6.",
)
def alignment_waits(evidence: Evidence) -> Iterator[Sighting]:
    if (
        evidence.viso_type in ALIGNING_TYPES
        and evidence.source("YAW") != EXTNAV
        and not evidence.has_compass
        and evidence.stream.poses
    ):
        yield Sighting(
            f"VISO_TYPE is {evidence.viso_type}, EK3_SRC1_YAW is {evidence.source('YAW')}, and there is no compass"
        )


def _mean_angle(angles: Floats) -> tuple[float, float]:
    """Return mean and spread of angles in rad, wrapped."""
    vector = complex(np.mean(np.exp(1j * angles)))
    return math.atan2(vector.imag, vector.real), math.sqrt(max(0.0, -2 * math.log(max(abs(vector), 1e-9))))


@check(
    code="XN8-04",
    severity=Severity.ERROR,
    title="The stream's frame is rotated",
    firmware=(
        "Type 1 aligns nothing. With yaw from a compass, the stream's positions and velocities point another way than "
        "the vehicle; with yaw from the stream, those of a GPS do. The vehicle circles instead of holding its "
        "position."
    ),
    source="AP_VisualOdom_MAV.cpp, AP_VisualOdom_MAV::handle_pose_estimate",
    fix="Rotate the stream's frame to north in the sender, set EK3_SRC1_YAW to 6, or use VISO_TYPE 2.",
    witness=Witness.LOG,
)
def rotated_frame(evidence: Evidence) -> Iterator[Sighting]:
    by_north = SourceXY.GPS in (evidence.source("POSXY"), evidence.source("VELXY"))
    by_stream = evidence.source("YAW") == EXTNAV
    severity = Severity.NOTE if by_stream and not by_north else None
    for poses, chosen, sent, vehicle in _beside_vehicle(evidence) if evidence.viso_type == 1 else ():
        aligned = poses.track.arrival_us[chosen] >= (_yaw_taken_us(evidence) if by_stream else 0)
        if np.count_nonzero(aligned) < FEWEST_MESSAGES:
            continue
        mean, spread = _mean_angle((sent[:, 2] - vehicle[:, 2])[aligned])
        if abs(mean) > limits.ATTITUDE_OFF_RAD and spread < limits.ATTITUDE_OFF_RAD:
            text = f"{poses.track.sender}: its yaw is {math.degrees(mean):.0f} deg from the vehicle's own"
            fix = _YAW_BY_STREAM if by_stream else None
            yield Sighting.in_track(text, poses.track, chosen[aligned], fix, severity)


def _yaw_taken_us(evidence: Evidence) -> int:
    """Return when the vehicle's filter took its yaw from the stream, by its own words; 0 if they are not known."""
    own = evidence.vehicle.own_filter
    texts = () if own is None else own.texts
    taken = (time_us for time_us, text in texts if text.endswith((" yaw aligned", _BY_EXTNAV)))
    return next(taken, 0)


def _apart(poses: Poses, chosen: Ints, mask: Bools, text: str, severity: Severity | None = None) -> Sighting:
    """Return what the masked ones of some chosen messages show."""
    track, shown = poses.track, chosen[mask]
    where = f"in {share(len(shown), len(track))} messages, the first at {at(track.arrival_us[shown[0]])}"
    return Sighting.in_track(f"{track.sender}: {text}, {where}", track, shown, severity=severity)


def _beside_vehicle(evidence: Evidence) -> Iterator[tuple[Poses, Ints, Floats, Floats]]:
    """Yield poses, the indices of those that can be compared, and their attitude and the vehicle's as Euler angles.

    VISO_ORIENT is taken off first, as types 2 and 3 do. Attitudes of a filter that has lost itself do not count.
    """
    attitude = evidence.vehicle.best_attitude
    if attitude is None:
        return
    for poses in evidence.poses_with_attitude:
        quats = oriented(poses.quat_wxyz, evidence.viso_type, int(evidence.param("VISO_ORIENT")))
        sent, vehicle = euler_from_quats(quats), attitude.at(poses.track.arrival_us)
        usable = np.isfinite(np.column_stack((sent, vehicle))).all(axis=1)
        usable &= ~evidence.vehicle.is_attitude_wrong(poses.track.arrival_us)
        chosen = np.flatnonzero(usable)
        if len(chosen) >= FEWEST_MESSAGES:
            yield poses, chosen, sent[chosen], vehicle[chosen]


@check(
    code="XN8-05",
    severity=Severity.ERROR,
    title="Roll and pitch differ from the vehicle's",
    firmware=(
        "Types 2 and 3 compare: more than 10 deg, and arming fails with VisOdom: roll/pitch diff. Type 1 does not, but "
        "the velocity of ODOMETRY is rotated by a wrong attitude."
    ),
    source="AP_VisualOdom_IntelT265.cpp, AP_VisualOdom_IntelT265::pre_arm_check",
    fix=(
        "Set VISO_ORIENT to how the camera is mounted (types 2 and 3), or send the vehicle's attitude, not the "
        "camera's."
    ),
    witness=Witness.LOG,
)
def tilted_attitude(evidence: Evidence) -> Iterator[Sighting]:
    severity = None if evidence.viso_type in ALIGNING_TYPES else Severity.WARNING
    if not evidence.uses_attitude:
        severity = Severity.NOTE
    for poses, chosen, sent, vehicle in _beside_vehicle(evidence):
        compared = comparison_of(poses, evidence.comparisons)
        if compared is not None and (compared.exchanged or compared.reading is not None):  # XN2-12, XN2-10
            continue
        angle = np.arccos(np.clip(np.sum(down_in_body(sent) * down_in_body(vehicle), axis=1), -1, 1))
        mask = lasting(poses.track.arrival_us[chosen], angle > limits.ATTITUDE_OFF_RAD)
        if mask.any():
            middle = math.degrees(float(np.median(angle[mask])))
            unused = "" if evidence.uses_attitude else " (VISO_TYPE is 1, and nothing uses the attitude)"
            text = f"roll and pitch are {middle:.0f} deg from the vehicle's own{unused}"
            yield _apart(poses, chosen, mask, text, severity)


@check(
    code="XN8-08",
    severity=Severity.ERROR,
    title="The yaw leaves the vehicle's after alignment",
    firmware=(
        "Types 2 and 3 align the yaw once. Afterwards they compare: more than 10 deg, and arming fails with VisOdom: "
        "yaw diff. In flight positions and velocities turn away from north with the camera's yaw."
    ),
    source="AP_VisualOdom_IntelT265.cpp, AP_VisualOdom_IntelT265::pre_arm_check",
    fix=(
        "Look for a camera that drifts or a compass that is disturbed; align again with the auxiliary function VISODOM "
        "ALIGN (80) before take-off."
    ),
    witness=Witness.LOG,
)
def yaw_after_alignment(evidence: Evidence) -> Iterator[Sighting]:
    """Find yaw that departs from the vehicle's own after an alignment."""
    starts_us = sorted(aligned_us(evidence)) if evidence.viso_type in ALIGNING_TYPES else []
    for poses, chosen, sent, vehicle in _beside_vehicle(evidence) if starts_us else ():
        times, off = poses.track.arrival_us[chosen], sent[:, 2] - vehicle[:, 2]
        mask, worst = np.zeros(len(times), dtype=np.bool_), 0.0
        for start, end in itertools.pairwise([*starts_us, _NEVER_US]):
            first = (times >= start) & (times < min(start + limits.ALIGNED_FOR_US, end))
            inside = (times >= start) & (times < end)
            if first.any():
                since = np.abs(np.angle(np.exp(1j * (off - _mean_angle(off[first])[0]))))
                left = lasting(times, np.asarray(inside & (since > limits.ATTITUDE_OFF_RAD), dtype=np.bool_))
                mask |= left
                worst = max(worst, float(since[left].max(initial=0.0)))
        if mask.any():
            text = f"since it was aligned the yaw has left the vehicle's own by up to {math.degrees(worst):.0f} deg"
            yield _apart(poses, chosen, mask, text, None if worst > limits.YAW_FAR_OFF_RAD else Severity.WARNING)


@check(
    code="XN8-06",
    severity=Severity.NOTE,
    title="Too short for alignment",
    firmware="Types 2 and 3 align the yaw 20 s after the AHRS has started, and not before.",
    source=_ALIGN,
    fix="Wait for the text VisOdom: yaw shifted before arming.",
)
def too_short_to_align(evidence: Evidence) -> Iterator[Sighting]:
    aligns = evidence.viso_type in ALIGNING_TYPES and evidence.source("YAW") != EXTNAV and evidence.has_compass
    if aligns and evidence.stream.poses and not aligned_us(evidence):
        yield Sighting(
            f"the stream ends at {at(evidence.stream.end_us)}, before the AHRS has settled, 20 s after it started"
        )


@check(
    code="XN8-07",
    severity=Severity.WARNING,
    title="A switch of sources will jump",
    firmware=(
        "While another source is active, types 2 and 3 move the camera's position along with the vehicle's, so that a "
        "switch is smooth; while flow is, only with EK3_SRC_OPTIONS 2. Type 1 aligns nothing in any release; 4.7 "
        "and the masters since February 2026 align in no type."
    ),
    source="AP_VisualOdom_Backend.cpp, AP_VisualOdom_Backend::align_position_to_ahrs",
    fix="Start the camera where the vehicle's origin is, or fly another release; see --firmware.",
)
def switch_jumps(evidence: Evidence) -> Iterator[Sighting]:
    by_set = [evidence.source("POSXY", number) for number in SOURCE_SETS]
    others = [
        n for n, source in zip(SOURCE_SETS, by_set, strict=True) if source != EXTNAV and _gives_motion(evidence, n)
    ]
    if not evidence.stream.poses or EXTNAV not in by_set or not others:
        return
    kind, aligns = evidence.viso_type, _aligns_positions(evidence)
    if kind in ALIGNING_TYPES and not aligns:
        yield Sighting(
            f"VISO_TYPE is {kind}, a source set takes positions from external navigation, set {others[0]} from another "
            f"source, and the firmware is {evidence.set_up.firmware.name}"
        )
    elif kind in ALIGNING_TYPES:
        by_flow = (0, SourceXY.OPTFLOW)
        flow = [n for n in others if (evidence.source("POSXY", n), evidence.source("VELXY", n)) == by_flow]
        if flow and not _options(evidence) & ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW:
            yield Sighting(
                f"VISO_TYPE is {kind}, source set {flow[0]} flies by optical flow, and EK3_SRC_OPTIONS is "
                f"{_options(evidence)}",
                fix=alignment_advice(evidence),
                severity=Severity.NOTE,
            )
    elif kind == 1:
        yield Sighting(
            f"VISO_TYPE is 1, source set {by_set.index(EXTNAV) + 1} takes positions from external navigation, and set "
            f"{others[0]} from another source",
            fix=(
                "Start the camera where the vehicle's origin is, or shift the stream in the sender to "
                f"LOCAL_POSITION_NED before a switch. {alignment_advice(evidence)}"
            ),
            severity=Severity.NOTE,
        )


def _gives_motion(evidence: Evidence, number: int) -> bool:
    return any(evidence.source(name, number) not in (0, EXTNAV) for name in ("POSXY", "VELXY"))


def _options(evidence: Evidence) -> int:
    return int(evidence.param("EK3_SRC_OPTIONS"))


def _aligns_positions(evidence: Evidence) -> bool:
    """Return whether types 2 and 3 move the camera's position along with the vehicle's on this release."""
    return any(evidence.set_up.firmware.visual_odom.axes_to_align(True, True))


def alignment_advice(evidence: Evidence) -> str:
    """Return how a switch to external navigation becomes smooth by the autopilot itself, if the release can do that."""
    if not _aligns_positions(evidence):
        return "This release aligns the camera's position in no VISO_TYPE (4.6 does in 2 and 3)."
    options, kind = _options(evidence), evidence.viso_type
    none = "" if kind in ALIGNING_TYPES else " Type 1 aligns nothing."
    aligning = f"VISO_TYPE 2 and 3 move the camera's position along while a GPS or beacons give the position.{none}"
    if options & ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW:
        return f"{aligning} While optical flow does, EK3_SRC_OPTIONS {options} makes them do so, too."
    fix = (
        f"{aligning} For optical flow set EK3_SRC_OPTIONS {options | ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW} (with bit 1)."
    )
    if evidence.set_up.firmware.ekf.aligns_source_in_use:
        fix += " On this release that moves a set of POSXY 6 and VELXY 5 along while it is in use: take VELXY 6 there."
    return fix


@check(
    code="XN7-20",
    severity=Severity.WARNING,
    title="External navigation is moved along while it is in use",
    firmware=(
        "Up to 4.6, bit 1 of EK3_SRC_OPTIONS moves the camera's position to the vehicle's whenever VELXY of the active "
        "set is optical flow, also if its POSXY is 6. Then the position holds to nothing, and drifts as flow does."
    ),
    source="AP_NavEKF/AP_NavEKF_Source.cpp, AP_NavEKF_Source::align_inactive_sources",
    fix="Set VELXY of this set to 6, or take bit 1 off EK3_SRC_OPTIONS; later releases leave a source in use alone.",
)
def moved_in_use(evidence: Evidence) -> Iterator[Sighting]:
    both = (EXTNAV, SourceXY.OPTFLOW)
    found = [n for n in SOURCE_SETS if (evidence.source("POSXY", n), evidence.source("VELXY", n)) == both]
    moves = evidence.set_up.firmware.ekf.aligns_source_in_use and evidence.viso_type in ALIGNING_TYPES
    if found and moves and evidence.stream.poses and _options(evidence) & ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW:
        yield Sighting(
            f"VISO_TYPE is {evidence.viso_type}, EK3_SRC_OPTIONS {_options(evidence)}, EK3_SRC{found[0]}_POSXY 6 "
            f"(ExtNav) and EK3_SRC{found[0]}_VELXY 5 (optical flow)"
        )
