# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN5: the numbers themselves: units, NaN, covariances."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from ap_visualodom.ap_visualodom_backend import ANG_ERR_MAX_RAD, POS_ERR_MAX_M
from mav_handlers.covariance import no_errors, pose_errors
from mav_handlers.wire.messages import ATT_POS_MOCAP
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, masked
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.tracks import Bools, Floats, Poses
from viso.estimators.series import stretches_of
from viso.streams.stream_kinds import Aspect

_DECODE: Final = "GCS_Common.cpp, GCS_MAVLINK::handle_common_vision_position_estimate_data and handle_odometry"
_INGEST: Final = "AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData"
_CLAMP: Final = "AP_VisualOdom_MAV.cpp, AP_VisualOdom_MAV::handle_pose_estimate"
_DIAGONAL_POSITION: Final = (0, 6, 11)
_DIAGONAL_ANGLE: Final = (15, 18, 20)
_FAILED: Final = -1  # of a quality


@check(
    code="XN5-01",
    severity=Severity.ERROR,
    title="NaN in the position",
    firmware="The EKF ignores the whole sample, its yaw included; health and the log still count it.",
    source=_INGEST,
    fix="Do not send unknown poses; or send ODOMETRY with quality -1 and the last good pose.",
)
def nan_position(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        yield from masked("have NaN in the position", poses.track, np.isnan(poses.pos_m).any(axis=1))


@check(
    code="XN5-02",
    severity=Severity.ERROR,
    title="NaN in the attitude",
    firmware="The position is used, the yaw is not; the velocity of an ODOMETRY is lost as well, because q rotates it.",
    source=_INGEST,
    fix="Send the attitude that belongs to the position.",
)
def nan_attitude(evidence: Evidence) -> Iterator[Sighting]:
    text, severity = "have NaN in the attitude", None
    if not evidence.uses_attitude:
        text, severity = f"{text}, which nothing uses: positions alone are fused", Severity.NOTE
    for poses in evidence.stream.poses:
        for sighting in masked(text, poses.track, np.isnan(poses.quat_wxyz).any(axis=1)):
            yield replace(sighting, severity=severity)


@check(
    code="XN5-03",
    severity=Severity.ERROR,
    title="NaN in the velocity",
    firmware="The EKF ignores the velocity.",
    source="AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavVelData",
    fix="If no velocity is known, send VISION_POSITION_ESTIMATE, and set EK3_SRC1_VELXY and VELZ to 0.",
)
def nan_velocity(evidence: Evidence) -> Iterator[Sighting]:
    text, severity = "have NaN in the velocity", None
    if not evidence.uses_velocities:
        text, severity = f"{text}, which no source asks for", Severity.NOTE
    for velocities in evidence.stream.velocities:
        for sighting in masked(text, velocities.track, np.isnan(velocities.sent).any(axis=1)):
            yield replace(sighting, severity=severity)


@check(
    code="XN5-04",
    severity=Severity.ERROR,
    title="Infinite numbers",
    firmware="The EKF does not check for infinity. The effect on the filter is not predictable.",
    source=_INGEST,
    fix="Look for a division by zero in the sender.",
)
def infinite_numbers(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        mask = np.isinf(np.column_stack((poses.pos_m, poses.quat_wxyz))).any(axis=1)
        if poses.euler_rad is not None:
            mask |= np.isinf(poses.euler_rad).any(axis=1)
        yield from masked("have infinity in the pose", poses.track, mask)
    for velocities in evidence.stream.velocities:
        yield from masked("have infinity in the velocity", velocities.track, np.isinf(velocities.sent).any(axis=1))


@check(
    code="XN5-05",
    severity=Severity.ERROR,
    title="Quaternion not of length one",
    firmware=(
        "The autopilot does not normalise it: angles are wrong, and the velocity of an ODOMETRY changes in size and "
        "direction. With all zeros the velocity is not rotated at all."
    ),
    source="AP_Math/quaternion.cpp, Quaternion::operator*",
    fix="Normalise q; its order is w, x, y, z, while ROS has x, y, z, w.",
)
def quaternion_norm(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.poses_with_attitude:
        if poses.euler_rad is None:
            norm = np.linalg.norm(poses.quat_wxyz, axis=1)
            mask = np.isfinite(norm) & (np.abs(norm - 1) > limits.NORM_TOLERANCE)
            if mask.any():
                low, high = norm[mask].min(), norm[mask].max()
                yield from masked(f"have a quaternion of length {low:.3g} to {high:.3g}", poses.track, mask)


@check(
    code="XN5-06",
    severity=Severity.ERROR,
    title="Angles look like degrees",
    firmware="Roll, pitch and yaw are read as rad: the attitude is meaningless.",
    source=_DECODE,
    fix="Convert to rad.",
)
def angles_in_degrees(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        if poses.euler_rad is not None:
            largest = np.abs(poses.euler_rad)
            mask = ((largest > limits.MOST_ANGLE_RAD) & (largest < 1e6)).any(axis=1)
            if mask.any():
                most = float(largest[mask].max())
                yield from masked(f"have angles beyond a full turn, up to {most:.1f} rad", poses.track, mask)


def _is_read(evidence: Evidence, poses: Poses) -> bool:
    ignored = evidence.set_up.firmware.endpoint.mocap_errors is no_errors
    return not (ignored and poses.track.sender.name == ATT_POS_MOCAP.__name__)


def _errors(evidence: Evidence, poses: Poses) -> tuple[Floats, Floats]:
    """Return posErr (m) and angErr (rad) as the endpoint computes them, before they are limited."""
    formula = evidence.set_up.firmware.endpoint.error_formula
    rows, places = np.unique(poses.covariance.view(f"V{poses.covariance.strides[0]}").ravel(), return_inverse=True)
    errors = [pose_errors(row, formula) for row in rows.view(np.float64).reshape(-1, 21).tolist()]
    pos, ang = np.array(errors, np.float64).reshape(-1, 2)[places].T
    return pos, ang


def _is_given(evidence: Evidence, poses: Poses) -> Bools:
    if not _is_read(evidence, poses):
        return np.zeros(len(poses.track), dtype=np.bool_)
    given = ~np.isnan(poses.covariance[:, 0])
    return np.asarray(given & (np.nan_to_num(poses.covariance) != 0).any(axis=1), dtype=np.bool_)


@check(
    code="XN5-08",
    severity=Severity.NOTE,
    title="No covariance",
    firmware="Without a covariance the errors count as 0, and are always raised to the floors.",
    source=_CLAMP,
    fix="Set VISO_POS_M_NSE and VISO_YAW_M_NSE to the accuracy of the source.",
)
def no_covariance(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        why = "a covariance of zeros or NaN" if _is_read(evidence, poses) else "a covariance that is ignored"
        floors = evidence.param("VISO_POS_M_NSE"), evidence.param("VISO_YAW_M_NSE")
        text = f"have {why}: the EKF gets {floors[0]:.2g} m and {floors[1]:.2g} rad"
        yield from masked(text, poses.track, ~_is_given(evidence, poses))


@check(
    code="XN5-09",
    severity=Severity.NOTE,
    title="Noise floors hide the covariance",
    firmware=(
        "The firmware makes one error of the variances, and raises it to the floor. Up to 4.6 the error is the "
        "cube root of the sum of their squares. That is no standard deviation, and is smaller for small errors. "
        "Since 4.7 it is the root of their sum."
    ),
    source=_CLAMP,
    fix="To use the source's figures, lower the floor; up to 4.6, mind the cube root.",
    needs={Aspect.COVARIANCE},
)
def covariance_below_floor(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        given, (pos_err, ang_err) = _is_given(evidence, poses), _errors(evidence, poses)
        for name, diagonal, errors, unit in (
            ("VISO_POS_M_NSE", _DIAGONAL_POSITION, pos_err, "m"),
            ("VISO_YAW_M_NSE", _DIAGONAL_ANGLE, ang_err, "rad"),
        ):
            floor = evidence.param(name)
            mask = given & (errors < floor)
            if mask.any():
                variances = np.clip(poses.covariance[mask][:, diagonal], 0, None)
                sigma = float(np.median(np.sqrt(variances.max(axis=1))))
                taken = float(np.median(errors[mask]))
                yield from masked(
                    f"say {sigma:.2g} {unit} (largest sigma), of which the firmware makes {taken:.2g} and raises it to "
                    f"{name} {floor:.2g}",
                    poses.track,
                    mask,
                )


@check(
    code="XN5-10",
    severity=Severity.ERROR,
    title="NaN inside the covariance",
    firmware=(
        "Only NaN in the first element means that there is no covariance. Elsewhere NaN makes an error of half the "
        "limit (50.1 m, 0.85 rad) and the internal error 0x400: arming is refused until reboot."
    ),
    source="AP_Math.cpp, constrain_value_line",
    fix="Set the first element to NaN, or all to 0.",
    needs={Aspect.COVARIANCE},
)
def nan_covariance(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        if not _is_read(evidence, poses):
            continue
        used = poses.covariance[:, (*_DIAGONAL_POSITION, *_DIAGONAL_ANGLE)]
        mask = ~np.isnan(used[:, 0]) & np.isnan(used[:, 1:]).any(axis=1)
        yield from masked("have NaN behind a first element that is a number", poses.track, mask)


@check(
    code="XN5-11",
    severity=Severity.WARNING,
    title="Covariance so large that samples hardly count",
    firmware="Errors are limited to 100 m and 1.5 rad. From 10 m on, a sample has nearly no weight.",
    source=_CLAMP,
    fix="Check that variances are in m^2 and rad^2.",
    needs={Aspect.COVARIANCE},
)
def huge_covariance(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        given, (pos_err, ang_err) = _is_given(evidence, poses), _errors(evidence, poses)
        for errors, most, limit, unit in (
            (pos_err, limits.HUGE_ERROR_M, float(POS_ERR_MAX_M), "m"),
            (ang_err, float(ANG_ERR_MAX_RAD), float(ANG_ERR_MAX_RAD), "rad"),
        ):
            mask = given & (errors > most)
            if mask.any():
                in_effect = min(float(np.median(errors[mask])), limit)
                yield from masked(f"have a covariance that means {in_effect:.3g} {unit} to the EKF", poses.track, mask)


@check(
    code="XN5-13",
    severity=Severity.WARNING,
    title="Pose freezes in motion",
    firmware="The samples are used unchanged: for the filter the vehicle has stopped.",
    source=_INGEST,
    fix="Do not repeat the last pose when tracking is lost: send quality -1, or nothing.",
)
def frozen_pose(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        track = poses.track
        if len(track) < FEWEST_MESSAGES:
            continue
        same = (np.diff(poses.pos_m, axis=0) == 0).all(axis=1) & (np.diff(poses.quat_wxyz, axis=0) == 0).all(axis=1)
        for first, last in stretches_of(same):
            length = int(track.arrival_us[last] - track.arrival_us[first])
            # A sender may repeat the last pose while it says that tracking failed.
            is_told = bool((poses.quality[first + 1 : last + 1] == _FAILED).all())
            if length >= limits.FROZEN_US and not is_told and _is_in_motion(poses, first, last):
                where = f"for {length * 1e-6:.1f} s at {at(track.arrival_us[first])}"
                text = f"{track.sender}: in full motion the pose stops {where}, the same to the last bit"
                yield Sighting.in_track(text, track, slice(first, last + 1))


def _is_in_motion(poses: Poses, first: int, last: int) -> bool:
    """Return whether the pose stops faster than a vehicle can, or goes on elsewhere, and not from rest to rest."""
    pos_m = poses.pos_m
    start, end = max(0, first - 1), min(len(poses.track) - 1, last + 1)
    time_s = max(float(poses.track.arrival_us[first] - poses.track.arrival_us[start]) * 1e-6, 5e-3)
    speed = float(np.linalg.norm(pos_m[first] - pos_m[start])) / time_s
    leap = float(np.linalg.norm(pos_m[end] - pos_m[last]))
    came = start > 0 and bool((pos_m[start] != pos_m[start - 1]).any())
    goes_on = end + 1 < len(pos_m) and bool((pos_m[end + 1] != pos_m[end]).any())
    return (came and speed / time_s > limits.MOST_BRAKING_M_S2) or (goes_on and leap > limits.THAW_M)
