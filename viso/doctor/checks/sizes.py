# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN5: sizes of positions and velocities, compared with each other."""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.beside_vehicle import is_related
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, masked
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.motion import Agreement, Motion, agreement, typical_speed
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES, time_base_us
from viso.doctor.evidence.tracks import Floats, Poses, down_in_body, median_of

_DECODE: Final = "GCS_Common.cpp, GCS_MAVLINK::handle_common_vision_position_estimate_data and handle_odometry"
_SCALED: Final = "AP_VisualOdom_MAV.cpp, AP_VisualOdom_MAV::handle_pose_estimate"
_FUSE: Final = "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseVelPosNED"
_UNITS: Final = ((1000.0, "millimetres"), (100.0, "centimetres"), (0.001, "kilometres"))


def _scaled_fit(motion: Motion) -> Agreement | None:
    """Return the fit; the scale is removed first, so that outliers show."""
    speed, path = typical_speed(motion.used), typical_speed(motion.path)
    if not motion.is_enough or speed < 1e-4 or path < 1e-4:
        return None
    ratio = path / speed
    scale, correlation = agreement(motion.path, motion.used * ratio)
    return Agreement(scale * ratio, correlation)


@check(
    code="XN5-07",
    severity=Severity.ERROR,
    title="Positions are not in metres",
    firmware="They are read as metres: the filter rejects them, or the vehicle flies away with them.",
    source=_DECODE,
    fix="Send metres; motion capture systems often give millimetres.",
)
def length_unit(evidence: Evidence) -> Iterator[Sighting]:
    reported = set()
    low, high = limits.UNIT_SCALE_WITHIN
    for motion in evidence.stream.motions:
        fit = _scaled_fit(motion)
        for factor, unit in _UNITS:
            if fit is not None and fit.correlation > limits.UNIT_CORRELATION and low < fit.scale / factor < high:
                reported.add(motion.pose_sender)
                text = f"the path is {fit.scale:.3g} times what velocities say: positions look like {unit}"
                yield Sighting.in_track(f"{motion.pose_sender}: {text}", motion)
    for poses in evidence.stream.poses:
        speed = _path_speed(poses)
        if poses.track.sender not in reported and speed > limits.FASTEST_M_S:
            numbers = poses.track.numbers.tolist()
            yield Sighting(f"{poses.track.sender}: positions change by {speed:.0f} m in a second", numbers)
            continue
        beyond = None if poses.track.sender in reported else _beyond_vehicle(evidence, poses)
        if beyond is not None:
            yield Sighting.in_track(f"{poses.track.sender}: {beyond}", poses.track)


def _beyond_vehicle(evidence: Evidence, poses: Poses) -> str | None:
    """Return how a path is faster, or bends harder, than a vehicle can that leans as this one; None if it does not."""
    attitude, speeds, bend = evidence.vehicle.best_attitude, _speeds(poses), _acceleration(poses)
    speed = float(np.quantile(speeds, 0.75)) if len(speeds) >= FEWEST_MESSAGES else 0.0
    if bend > limits.HARDEST_M_S2:
        return f"the path changes its velocity by {bend:.0f} m/s in a second: {_in_units(speed)}"
    if attitude is None or not evidence.vehicle.is_copter:
        return None
    euler_rad = attitude.at(poses.track.arrival_us)
    upright = down_in_body(euler_rad[np.isfinite(euler_rad).all(axis=1)])[:, 2]
    if len(upright) < FEWEST_MESSAGES:
        return None
    lean = math.acos(min(1.0, max(float(np.quantile(upright, 0.1)), limits.STEEPEST_LEAN)))
    fastest = limits.COPTER_WIND_M_S + limits.COPTER_M_S * math.sqrt(math.tan(lean))
    hardest = limits.COPTER_GUSTS_M_S2 + limits.COPTER_TIMES_LEAN * limits.GRAVITY_M_S2 * math.tan(lean)
    leans = f"at a lean of {math.degrees(lean):.0f} deg (less in nine of ten)"
    if speed > fastest:
        return f"the path is as fast as {speed:.0f} m/s {leans}, which no copter reaches: {_in_units(speed)}"
    if bend > hardest:
        return f"the path changes its velocity by {bend:.1f} m/s in a second {leans}: {_in_units(speed)}"
    return None


def _in_units(speed: float) -> str:
    return f"as centimetres its speed would be {speed / 100:.2g} m/s, as millimetres {speed / 1000:.2g} m/s"


def _acceleration(poses: Poses) -> float:
    """Return the median size of the horizontal acceleration of a path over a second, in m/s^2; 0 if unknown."""
    time_s, fine = time_base_us(poses.track) * 1e-6, np.isfinite(poses.pos_m).all(axis=1)
    time_s, pos_m = time_s[fine], poses.pos_m[fine, :2]
    if len(time_s) < FEWEST_MESSAGES or np.any(np.diff(time_s) < 0) or time_s[-1] - time_s[0] < 3:
        return 0.0
    middle = time_s[(time_s > time_s[0] + 1) & (time_s < time_s[-1] - 1)]
    before, now, after = (
        np.column_stack([np.interp(middle + by_s, time_s, column) for column in pos_m.T]) for by_s in (-1.0, 0.0, 1.0)
    )
    return median_of(np.linalg.norm(after - 2 * now + before, axis=1))


def _speeds(poses: Poses) -> Floats:
    """Return the speeds of a path in m/s, over steps of a quarter of a second."""
    time_s = time_base_us(poses.track) * 1e-6
    last = np.searchsorted(time_s, time_s + 0.25)
    first = np.flatnonzero(last < len(time_s))
    last = last[first]
    step = np.linalg.norm(poses.pos_m[last] - poses.pos_m[first], axis=1) / (time_s[last] - time_s[first])
    return np.asarray(step[np.isfinite(step)], dtype=np.float64)


def _path_speed(poses: Poses) -> float:
    """Return the median speed of a path in m/s; 0 if too little is known."""
    speeds = _speeds(poses)
    return float(np.median(speeds)) if len(speeds) >= FEWEST_MESSAGES else 0.0


def _like_feet(factor: float) -> str:
    return "; such a factor has a path in feet" if abs(factor / limits.FOOT - 1) < limits.FOOT_OFF else ""


@check(
    code="XN5-12",
    severity=Severity.WARNING,
    title="Path and velocities differ in size",
    firmware=(
        "VISO_SCALE scales positions, never velocities; the filter gets two measurements that contradict each other."
    ),
    source=_SCALED,
    fix="Correct the scale at the source, or set VISO_SCALE.",
)
def path_against_velocities(evidence: Evidence) -> Iterator[Sighting]:
    low, high = limits.SCALE_WITHIN
    for motion in evidence.stream.motions:
        fit = _scaled_fit(motion)
        if fit is None or fit.correlation < limits.FITS_CORRELATION:
            continue
        if abs(fit.scale - 1) > limits.PATH_SCALE_OFF and low < fit.scale < high:
            scale = evidence.param("VISO_SCALE") / fit.scale
            cure = f"set VISO_SCALE to {scale:.3f}, or correct the source; else correct them."
            yield Sighting.in_track(
                f"{motion.pose_sender}: the path is {fit.scale:.3f} times as long as velocities of "
                f"{motion.velocity_sender.name} say (correlation {fit.correlation:.3f}){_like_feet(fit.scale)}",
                motion,
                fix=f"If velocities are right, {cure}",
            )


@check(
    code="XN5-18",
    severity=Severity.WARNING,
    title="Positions of another scale than the vehicle's path",
    firmware=(
        "Positions are multiplied by VISO_SCALE and read as metres. A wrong scale stretches or shrinks every flown "
        "path."
    ),
    source=_SCALED,
    fix="Set VISO_SCALE, or correct the scale at the source.",
    witness=Witness.LOG,
)
def position_scale(evidence: Evidence) -> Iterator[Sighting]:
    setting = evidence.param("VISO_SCALE")
    for compared in evidence.paths:
        found = compared.scale
        off = found.scale - setting
        if not found.sufficient or abs(off) <= max(
            limits.VEHICLE_SCALE_OFF * setting, limits.SCALE_SIGMAS * found.sigma
        ):
            continue
        if not is_related(evidence, compared.poses):
            continue
        track = compared.poses.track
        cure = f"Set VISO_SCALE to {found.scale:.3f}, or correct the source's scale."
        yield Sighting.in_track(
            f"{track.sender}: against the vehicle's own path ({compared.origin}) positions have to be multiplied by "
            f"{found.scale:.3f} +- {found.sigma:.3f} (correlation {found.correlation:.2f}), and VISO_SCALE is "
            f"{setting:.3g}{_like_feet(1 / found.scale)}",
            track,
            fix=f"{cure} VISO_SCALE leaves velocities alone.",
        )


@check(
    code="XN5-14",
    severity=Severity.ERROR,
    title="Velocity always zero",
    firmware=(
        "With EK3_SRC1_VELXY 6 the velocities tell the filter that the vehicle stands still, while its positions move."
    ),
    source=_FUSE,
    fix="Fill in the velocity, or set EK3_SRC1_VELXY and VELZ to 0.",
)
def velocity_always_zero(evidence: Evidence) -> Iterator[Sighting]:
    for motion in evidence.stream.motions:
        path, used = typical_speed(motion.path), typical_speed(motion.used)
        if motion.is_enough and used < limits.ZERO_SPEED_SHARE * min(path, 1.0):
            text = f"velocity stays 0 while the path moves at {path:.2f} m/s"
            yield Sighting.in_track(f"{motion.velocity_sender}: {text}", motion)


@check(
    code="XN5-15",
    severity=Severity.WARNING,
    title="Velocity spikes",
    firmware="Each sample is tested against the gate EK3_VEL_I_GATE. One that passes is fused at full weight.",
    source=_FUSE,
    fix="Filter velocities at the source, or derive them from the filter there instead of from differences.",
)
def velocity_spikes(evidence: Evidence) -> Iterator[Sighting]:
    for velocities in evidence.stream.velocities:
        used, track = velocities.used, velocities.track
        if len(track) < FEWEST_MESSAGES:
            continue
        between = 0.5 * (used[:-2] + used[2:])
        off = np.linalg.norm(used[1:-1] - between, axis=1)
        sides = np.linalg.norm(used[2:] - used[:-2], axis=1)
        usual = median_of(off)
        mask = np.zeros(len(track), dtype=np.bool_)
        mask[1:-1] = (off > max(limits.GLITCH_M_S, limits.SPIKE_TIMES * usual)) & (
            sides < limits.SPIKE_SIDES_SHARE * off
        )
        if mask.any():
            yield from masked(f"have a velocity that is up to {np.max(off[mask[1:-1]]):.1f} m/s off", track, mask)


@check(
    code="XN5-16",
    severity=Severity.WARNING,
    title="Velocity leaves the path",
    firmware="Rejected velocities never time out while positions pass; those that pass pull the estimate away.",
    source=_FUSE,
    fix="Look at the source's velocity in that stretch.",
)
def velocity_leaves_path(evidence: Evidence) -> Iterator[Sighting]:
    """Find stretches in which velocities differ much from the path, though they fit elsewhere."""
    for motion in evidence.stream.motions:
        if len(motion.numbers) < FEWEST_MESSAGES:
            continue
        fit = agreement(motion.path, motion.used)
        off = np.linalg.norm(motion.path - motion.used, axis=1)
        usual = float(np.median(off))
        mask = off > max(limits.GLITCH_M_S, limits.STRETCH_TIMES * usual)
        mask &= np.linalg.norm(motion.used, axis=1) > 2 * np.linalg.norm(motion.path, axis=1) + 1
        is_stretch = limits.FEWEST_IN_STRETCH <= np.count_nonzero(mask) < limits.STRETCH_SHARE * len(mask)
        if usual < limits.STRETCH_ELSEWHERE_M_S and is_stretch and fit.scale > 0:
            chosen = np.flatnonzero(mask)
            text = f"velocity leaves the path by up to {off[mask].max():.1f} m/s"
            start = at(motion.arrival_us[chosen[0]])
            yield Sighting.in_track(f"{motion.velocity_sender}: {text} from {start} on", motion, chosen)


@check(
    code="XN5-17",
    severity=Severity.WARNING,
    title="Positions drift against velocities",
    firmware="The filter gets two measurements that contradict each other, and follows the one with the smaller error.",
    source=_FUSE,
    fix="Look for a drift of the source's map or a bias of its velocity.",
)
def position_drift(evidence: Evidence) -> Iterator[Sighting]:
    low, high = limits.DRIFT_WITHIN_M_S
    for motion in evidence.stream.motions:
        if len(motion.numbers) < 3 * FEWEST_MESSAGES:
            continue
        off = motion.path - motion.used
        bias = np.median(off, axis=0)
        spread = np.median(np.abs(off - bias), axis=0)
        size = float(np.linalg.norm(bias))
        if low < size < high and size > limits.DRIFT_TIMES_SPREAD * float(np.linalg.norm(spread)):
            text = f"positions move by {size:.2f} m/s more than velocities say, all the time"
            yield Sighting.in_track(f"{motion.pose_sender}: {text}", motion)


@check(
    code="XN5-19",
    severity=Severity.ERROR,
    title="Positions are too far from the origin",
    firmware=(
        "Positions are binary32 until they reach the filter: their steps grow with the distance from the origin. A "
        "motion smaller than a step does not show, and then appears as a jump."
    ),
    source=_DECODE,
    fix=(
        "Subtract the first position from all of them at the source, in double precision. UTM and other coordinates of "
        "the earth are millions of metres. viso play --from-zero does so."
    ),
)
def far_from_origin(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        largest = np.abs(poses.pos_m).max(axis=1)
        distance = median_of(largest[np.isfinite(largest)])
        step = float(np.spacing(np.float32(distance)))
        if step >= limits.COARSE_STEP_M:
            text = f"positions are {distance:.3g} m from the origin, where a binary32 counts in steps of {step:.2g} m"
            severity = None if step >= limits.TOO_COARSE_STEP_M else Severity.WARNING
            yield Sighting.in_track(f"{poses.track.sender}: {text}", poses.track, slice(None), severity=severity)
