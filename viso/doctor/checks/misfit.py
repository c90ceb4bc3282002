# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN8: does the stream move as the vehicle does at all, as other sources than the stream show it?

Constant differences of axes, scale and delay are removed first; other checks find them.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import EXTNAV
from viso.doctor.checks import limits
from viso.doctor.checks.beside_vehicle import (
    SentPath,
    aligned_us,
    departs_from_us,
    departure_mask,
    heading_departures,
    is_of_one_time,
    lasting,
    likeness_of,
    paths_of_poses,
    paths_of_velocities,
    reference_of,
)
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, share
from viso.doctor.evidence.compare import ALIGNING_TYPES
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.motion import FEWEST_WINDOWS, LEAST_SPEED, Motion, motions_of, typical_speed
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.tracks import Bools, Floats, Ints
from viso.doctor.evidence.vehicle_position import SOURCE_SETS, LevelSeries
from viso.estimators.likeness import Rest, departure, rests
from viso.estimators.positions import interpolated

_FUSE: Final = "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseVelPosNED"
_HEIGHT: Final = "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion"
_YAW: Final = "AP_NavEKF3_MagFusion.cpp, NavEKF3_core::fuseEulerYaw"
_SECOND_US: Final = 1_000_000


def _severity_by_source(evidence: Evidence, *names: str) -> Severity | None:
    """Return None, for the check's own severity, if a set of sources names the stream; else WARNING."""
    taken = any(evidence.source(name, number) == EXTNAV for name in names for number in SOURCE_SETS)
    return None if taken else Severity.WARNING


@check(
    code="XN8-10",
    severity=Severity.ERROR,
    title="The yaw does not follow the vehicle's",
    firmware=(
        "With EK3_SRC1_YAW 6 it is the heading, or is rejected by EK3_YAW_I_GATE until the filter resets to it; else "
        "positions and velocities of a frame that turns are used as if it were fixed."
    ),
    source=_YAW,
    fix=(
        "Look for a source that loses its heading: too few features, a gyro with a bias, an attitude taken from "
        "another frame than the positions. Until that is mended, take the heading from a compass (EK3_SRC1_YAW 1), and "
        "use no positions."
    ),
    witness=Witness.LOG,
)
def yaw_wanders(evidence: Evidence) -> Iterator[Sighting]:
    is_aligned = evidence.viso_type in ALIGNING_TYPES and aligned_us(evidence)
    for heading in () if is_aligned else heading_departures(evidence):
        mask = departure_mask(heading)
        if mask.any():
            off_deg, track = np.degrees(np.abs(heading.off_rad)), heading.poses.track
            middle_deg, worst_deg = float(np.median(off_deg)), float(off_deg[mask].max())
            is_gross = middle_deg > limits.YAW_OFF_MEDIAN_DEG or worst_deg > limits.YAW_OFF_WORST_DEG
            count = share(int(np.count_nonzero(mask)), len(mask))
            yield Sighting.in_track(
                f"{track.sender}: the yaw is more than 10 deg from the vehicle's own ({heading.source}) in {count} "
                f"messages, by {middle_deg:.0f} deg in the middle of all and {worst_deg:.0f} deg at worst within "
                f"{track.span_s:.0f} s, a constant difference taken off; it first leaves it at "
                f"{at(departs_from_us(heading))}",
                track,
                heading.chosen[mask],
                severity=None if is_gross else Severity.WARNING,
            )


def _unlike_path(evidence: Evidence, path: SentPath, what: str, severity: Severity | None) -> Iterator[Sighting]:
    """Yield a sighting if a path does not resemble the vehicle's."""
    found, position = likeness_of(evidence, path), evidence.vehicle.position
    if found is None or position is None:
        return
    is_related = found.correlation >= limits.RELATED_CORRELATION
    is_still = found.ratio < (limits.NO_SCALE_RATIO if is_related else limits.STILL_RATIO)
    if is_related and found.unlike < limits.UNLIKE_SHARE and not is_still:
        return
    is_gross = is_still or (not is_related and found.unlike > limits.MOSTLY_UNLIKE_SHARE)
    yield Sighting.in_track(
        f"{path.track.sender}: the vehicle moved {found.flown_m:.1f} m by its own path ({position.origin}) within "
        f"{found.span_s:.0f} s, and {what} went {found.seen_m:.2f} m meanwhile; turned and moved to fit best "
        f"(correlation {found.correlation:.2f}), the two are {found.median_m:.1f} m apart in the middle, "
        f"{found.worst_m:.1f} m at worst",
        path.track,
        path.chosen,
        severity=severity if is_gross else Severity.WARNING,
    )


@check(
    code="XN8-11",
    severity=Severity.ERROR,
    title="Positions do not move with the vehicle",
    firmware=(
        "They are fused while they pass EK3_POS_I_GATE, and the estimate follows them. When they do not pass, position "
        "times out after 7 s, and the filter resets to them."
    ),
    source=_FUSE,
    fix="Do not fly with this source. Check that it tracks at all, and that the sender sends its newest estimate.",
    witness=Witness.LOG,
)
def positions_unrelated(evidence: Evidence) -> Iterator[Sighting]:
    for _, path in paths_of_poses(evidence):
        yield from _unlike_path(evidence, path, "positions", _severity_by_source(evidence, "POSXY"))


def _at_rest(evidence: Evidence, path: SentPath) -> list[Rest]:
    position = evidence.vehicle.position
    if position is None or not is_of_one_time(evidence):
        return []
    return rests(
        path.arrival_us, path.pos_m, *reference_of(position), noise_m=position.noise_m, breaks_us=path.breaks_us
    )


@check(
    code="XN8-12",
    severity=Severity.ERROR,
    title="Positions move while the vehicle stands",
    firmware=(
        "The estimate follows them as far as the gate allows, and a vehicle that holds its position flies after the "
        "estimate."
    ),
    source=_FUSE,
    fix="Look for a source that has lost its track and goes on by inertial data alone, or sees something else move.",
    witness=Witness.LOG,
)
def moves_while_standing(evidence: Evidence) -> Iterator[Sighting]:
    noise_m = 0.0 if evidence.vehicle.position is None else evidence.vehicle.position.noise_m
    for _, path in paths_of_poses(evidence):
        moved = [
            stay
            for stay in _at_rest(evidence, path)
            if stay.stream_m
            > max(limits.LEAST_DEPARTURE_M, limits.WANDERS_TIMES * noise_m, limits.WANDERS_TIMES * stay.reference_m)
        ]
        yield from _moved_at_rest(evidence, path, moved, "positions move over", _severity_by_source(evidence, "POSXY"))


def _moved_at_rest(
    evidence: Evidence, path: SentPath, moved: list[Rest], what: str, severity: Severity | None
) -> Iterator[Sighting]:
    if not moved or evidence.vehicle.position is None:
        return
    worst = max(moved, key=lambda rest: rest.stream_m)
    arrival_us = path.arrival_us
    shown = np.zeros(len(arrival_us), dtype=np.bool_)
    for rest in moved:
        shown |= (arrival_us >= rest.start_us) & (arrival_us <= rest.end_us)
    yield Sighting.in_track(
        f"{path.track.sender}: the vehicle stands by its own path ({evidence.vehicle.position.origin}), within "
        f"{worst.reference_m:.2f} m from {at(worst.start_us)} to {at(worst.end_us)}, and {what} "
        f"{worst.stream_m:.2f} m",
        path.track,
        path.chosen[shown],
        severity=severity,
    )


@check(
    code="XN8-13",
    severity=Severity.ERROR,
    title="The height leaves the vehicle's",
    firmware="With EK3_SRC1_POSZ 6 the vehicle climbs or sinks after it.",
    source=_HEIGHT,
    fix=(
        "Take the height from the barometer (EK3_SRC1_POSZ 1, VELZ 0), and look for a scale or a tilt that the source "
        "gets wrong."
    ),
    witness=Witness.LOG,
)
def height_leaves(evidence: Evidence) -> Iterator[Sighting]:
    level = evidence.vehicle.level
    if level is None or not is_of_one_time(evidence):
        return
    for _, path in paths_of_poses(evidence):
        time_s, level_s = (np.asarray(time_us * 1e-6, np.float64) for time_us in (path.arrival_us, level.time_us))
        there, known = interpolated(level_s, level.down_m[:, None], time_s, limits.HEIGHT_GAP_S)
        for part in _parts(path):
            inside = np.flatnonzero(known & part)
            if len(inside) < FEWEST_WINDOWS:
                continue
            sighting = _height_of(evidence, path, inside, there[inside, 0], level)
            if sighting is not None:
                yield sighting
                break


def _height_of(
    evidence: Evidence, path: SentPath, inside: Ints, vehicle_m: Floats, level: LevelSeries
) -> Sighting | None:
    """Return a sighting if z departs from the vehicle's height in some messages of a path."""
    down_m, time_us = path.pos_m[inside, 2], path.arrival_us[inside]
    off_m = departure(down_m, vehicle_m, least_m=4 * level.noise_m)
    off_m = np.asarray(off_m - np.median(off_m[: FEWEST_WINDOWS // 2]), dtype=np.float64)
    climbed_m = float(np.ptp(vehicle_m))
    allowed_m = max(
        limits.LEAST_DEPARTURE_M,
        limits.HEIGHT_OFF_TIMES * level.noise_m,
        limits.HEIGHT_OFF_CLIMB_SHARE * climbed_m,
        limits.HEIGHT_OFF_PATH_SHARE * _length(path, inside),
    )
    mask = lasting(time_us, np.asarray(np.abs(off_m) > allowed_m))
    if not mask.any():
        return None
    worst = int(np.argmax(np.where(mask, np.abs(off_m), 0.0)))
    where = "below" if off_m[worst] > 0 else "above"
    return Sighting.in_track(
        f"{path.track.sender}: at {at(time_us[worst])} z is {abs(off_m[worst]):.1f} m {where} the vehicle's own height "
        f"({level.origin}), both counted from the start; within {np.ptp(time_us) * 1e-6:.0f} s that height changes by "
        f"{climbed_m:.1f} m in all, z by {np.ptp(down_m):.1f} m",
        path.track,
        path.chosen[inside[mask]],
        severity=_severity_by_source(evidence, "POSZ"),
    )


def _parts(path: SentPath) -> Iterator[Bools]:
    """Yield masks of the messages between two breaks of a path."""
    number = np.searchsorted(path.breaks_us, path.arrival_us, side="right")
    for part in np.unique(number).tolist():
        yield np.asarray(number == part, dtype=np.bool_)


def _length(path: SentPath, inside: Ints) -> float:
    """Return the length of a path over the ground, from positions a second apart."""
    second = path.arrival_us[inside] // _SECOND_US
    places = path.pos_m[inside][np.diff(second, prepend=-1) > 0, :2]
    return float(np.sum(np.linalg.norm(np.diff(places, axis=0), axis=1)))


@check(
    code="XN8-14",
    severity=Severity.ERROR,
    title="Velocities do not fit the vehicle's",
    firmware=(
        "They are fused while they pass EK3_VEL_I_GATE, and pull the estimate along; rejected ones do not time out "
        "while positions pass."
    ),
    source=_FUSE,
    fix=(
        "Set EK3_SRC1_VELXY and VELZ to 0 until the source's velocity is right: look at its frame, its unit and its "
        "time."
    ),
    witness=Witness.LOG,
)
def velocities_unrelated(evidence: Evidence) -> Iterator[Sighting]:
    severity = _severity_by_source(evidence, "VELXY", "VELZ")
    for velocities, path in paths_of_velocities(evidence):
        if not np.any(velocities.used[path.chosen]):
            continue
        yield from _unlike_path(evidence, path, "velocities", severity)
        moved = [
            stay
            for stay in _at_rest(evidence, path)
            if stay.stream_m
            > max(limits.STANDING_M_S * (stay.end_us - stay.start_us) * 1e-6, limits.WANDERS_TIMES * stay.reference_m)
        ]
        yield from _moved_at_rest(evidence, path, moved, "velocities lead over", severity)


@check(
    code="XN8-15",
    severity=Severity.ERROR,
    title="Velocities and positions are not of one motion",
    firmware="The filter gets two measurements that contradict each other, and follows the one with the smaller error.",
    source=_FUSE,
    fix=(
        "One of them is wrong: plot the positions' change beside the velocities. With EK3_SRC1_VELXY and VELZ 0 "
        "positions alone are used."
    ),
)
def two_motions(evidence: Evidence) -> Iterator[Sighting]:
    for motion in motions_of(evidence.stream.poses, evidence.stream.velocities, limits.TWO_MOTIONS_WINDOW_S):
        if len(motion.numbers) < FEWEST_WINDOWS or typical_speed(motion.path) < LEAST_SPEED or not np.any(motion.sent):
            continue
        unlike = min(
            _unlike_share(motion.path, sent) for sent in (motion.used, motion.sent, motion.turned, motion.reordered)
        )
        if unlike > limits.MOSTLY_UNLIKE_SHARE:
            yield Sighting.in_track(
                f"{motion.velocity_sender} against {motion.pose_sender.name}: over {_span_s(motion):.0f} s positions "
                f"move at {typical_speed(motion.path):.2f} m/s, velocities say {typical_speed(motion.used):.2f} m/s; "
                f"{100 * unlike:.0f} % of the time they are off by more than half, whatever axes and scale are taken",
                motion,
                severity=_severity_by_source(evidence, "VELXY", "VELZ"),
            )


def _unlike_share(path: Floats, velocities: Floats) -> float:
    """Return the share of windows in which velocities, rotated and scaled to fit best, differ from a path by half."""
    usable = (np.abs(np.column_stack((path, velocities))) < limits.NONSENSE_M_S).all(axis=1)
    path, velocities = path[usable], velocities[usable]
    if len(path) < FEWEST_WINDOWS:
        return 0.0
    speed = np.linalg.norm(path, axis=1)
    steady = speed <= limits.JUMP_TIMES_MEDIAN * np.median(speed)
    left, _, right = np.linalg.svd(path[steady].T @ velocities[steady])
    turned = velocities @ (left @ right).T
    energy = float(np.sum(turned[steady] ** 2))
    scale = float(np.sum(turned[steady] * path[steady])) / energy if energy > 0 else 0.0
    moving = steady & (speed > LEAST_SPEED)
    off = np.linalg.norm(scale * turned - path, axis=1) > limits.OFF_BY_HALF * speed
    return float(np.mean(off[moving])) if np.count_nonzero(moving) >= FEWEST_WINDOWS else 0.0


def _span_s(motion: Motion) -> float:
    return float(motion.arrival_us[-1] - motion.arrival_us[0]) * 1e-6 + limits.TWO_MOTIONS_WINDOW_S
