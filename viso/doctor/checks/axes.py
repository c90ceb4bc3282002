# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN2: axes, compared with the vehicle's own attitude and path."""

import math
from collections.abc import Iterator

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.beside_vehicle import is_related
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.frames import is_misordered
from viso.doctor.evidence.compare import ALIGNING_TYPES, Comparison
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.tracks import Floats, down_in_body, reordered
from viso.estimators.axis_rotations import BODY_WORDS, AxisMap, orient_name, rotation_matrix
from viso.geometry.rotation import euler_from_quats


def _is_ros(compared: Comparison) -> bool:
    """Return whether an attitude is of an FLU body in a world whose z is up."""
    orientation, world = compared.orientation, compared.world
    return orientation.sufficient and orientation.name == "FLU" and world.sufficient and world.is_up


@check(
    code="XN2-02",
    severity=Severity.ERROR,
    title="Attitude in ROS axes",
    firmware=(
        "The autopilot expects the attitude of an FRD body in a world with z down. With ROS axes (FLU in ENU), pitch "
        "and yaw turn the wrong way."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
    fix=(
        "From ROS send positions as (y, x, -z), or (x, -y, -z) if the world has no north, and the attitude with them; "
        "MAVROS does it for you."
    ),
    witness=Witness.LOG,
)
def ros_axes(evidence: Evidence) -> Iterator[Sighting]:
    for compared in evidence.comparisons:
        if _is_ros(compared):
            track = compared.poses.track
            text = f"against the vehicle's own attitude the body is FLU, and the world {compared.world.name}"
            correlation = compared.orientation.choice.correlation
            yield Sighting.in_track(f"{track.sender}: {text} (correlation {correlation:.2f})", track)


@check(
    code="XN2-06",
    severity=Severity.ERROR,
    title="Attitude of the camera, not of the vehicle",
    firmware="Type 1 uses the attitude as the vehicle's; types 2 and 3 rotate it by VISO_ORIENT.",
    source="AP_VisualOdom_IntelT265.cpp, AP_VisualOdom_IntelT265::rotate_attitude",
    fix="Set VISO_ORIENT, or rotate the attitude in the sender.",
    witness=Witness.LOG,
)
def camera_attitude(evidence: Evidence) -> Iterator[Sighting]:
    for compared in evidence.comparisons:
        orientation = compared.orientation
        if not orientation.sufficient or orientation.axes.is_identity or _is_ros(compared):
            continue
        is_obeyed, orient = evidence.viso_type in ALIGNING_TYPES, int(evidence.param("VISO_ORIENT"))
        set_so = f" once VISO_ORIENT {orient} is taken off" if is_obeyed and orient else ""
        yield Sighting.in_track(
            f"{compared.poses.track.sender}: against the vehicle's own attitude the axes point {orientation.name} "
            f"rather than FRD{set_so}: {orientation.text} (correlation {orientation.choice.correlation:.2f}, next best "
            f"{orientation.choice.second_correlation:.2f})",
            compared.poses.track,
            fix=_mounting_fix(orientation.axes, orient if is_obeyed else None),
        )


def _mounting_fix(axes: AxisMap, orient: int | None) -> str:
    """Return how to correct axes that differ after VISO_ORIENT is taken off; ``orient`` is None if it has no effect."""
    mounted = AxisMap.of(axes.matrix @ rotation_matrix(orient)) if orient else axes
    rotation = mounted.rotation
    number = "of the custom kind" if rotation is None else f"{int(rotation)} ({orient_name(rotation)})"
    by_code = "turn the attitude in the sender: " + mounted.describe("camera {} is vehicle", BODY_WORDS)
    if orient is None:
        return f"{by_code[0].upper()}{by_code[1:]}; or use VISO_TYPE 2 with VISO_ORIENT {number}."
    return f"Set VISO_ORIENT to {number}, or {by_code}."


@check(
    code="XN2-07",
    severity=Severity.ERROR,
    title="The stream's world is not z down",
    firmware="The autopilot expects attitudes and positions in a world with z down.",
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
    fix="Convert positions and attitude to a world with x forward or north, y right or east, z down.",
    witness=Witness.LOG,
)
def world_not_down(evidence: Evidence) -> Iterator[Sighting]:
    for compared in evidence.comparisons:
        world = compared.world
        tilted = world.sufficient and world.axes.signed_axes[2] != 3
        if compared.orientation.sufficient and tilted and not _is_ros(compared):
            track = compared.poses.track
            yield Sighting.in_track(
                f"{track.sender}: against the vehicle's own attitude the stream's world is {world.name}", track
            )


@check(
    code="XN2-08",
    severity=Severity.ERROR,
    title="Height upside down",
    firmware="z is down: with EK3_SRC1_POSZ 6 the vehicle takes a climb for a descent.",
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion",
    fix="Send -z, and also convert the other axes and the attitude to a world with z down.",
    witness=Witness.LOG,
)
def height_mirrored(evidence: Evidence) -> Iterator[Sighting]:
    if evidence.vehicle.height is None:
        return
    for poses in evidence.stream.poses:
        there = evidence.vehicle.height.at(poses.track.arrival_us)
        down = poses.pos_m[:, 2]
        fine = np.isfinite(there) & np.isfinite(down)
        if (
            np.count_nonzero(fine) < limits.FEWEST_HEIGHTS
            or np.ptp(there[fine]) < limits.LEAST_CLIMB_M
            or np.std(down[fine]) == 0
        ):
            continue
        correlation = float(np.corrcoef(there[fine], down[fine])[0, 1])
        if correlation < limits.MIRRORED_CORRELATION:
            climbed = float(np.ptp(there[fine]))
            text = f"z grows as the vehicle climbs, over {climbed:.1f} m (correlation {correlation:.2f})"
            yield Sighting.in_track(f"{poses.track.sender}: {text}", poses.track)


@check(
    code="XN2-09",
    severity=Severity.ERROR,
    title="Positions in other axes than the vehicle's path",
    firmware=(
        "The autopilot uses positions as north, east, down, or rotates them to that by the yaw of the attitude. With "
        "other axes the vehicle flies the wrong way to correct itself."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
    fix="Convert positions and velocities to the world of the attitude, with z down.",
    witness=Witness.LOG,
)
def position_axes(evidence: Evidence) -> Iterator[Sighting]:
    for compared in evidence.paths:
        axes = compared.axes
        if axes is None or not axes.sufficient or axes.axes.is_identity or not is_related(evidence, compared.poses):
            continue
        yield Sighting.in_track(
            f"{compared.poses.track.sender}: against the vehicle's own path ({compared.origin}), positions are "
            f"{axes.name} rather than NED, once the heading of the attitude is taken off: {axes.text} "
            f"(correlation {axes.choice.correlation:.2f}, next best {axes.choice.second_correlation:.2f})",
            compared.poses.track,
        )


@check(
    code="XN2-10",
    severity=Severity.ERROR,
    title="Quaternion in another order",
    firmware=(
        "The order of q is w, x, y, z. If the numbers are x, y, z, w, a level vehicle seems tilted by as much as its "
        "yaw, and the velocity of ODOMETRY is rotated by that."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
    fix="Put w first: ROS, TUM's files, Eigen's coeffs() and scipy have it last.",
)
def quaternion_order(evidence: Evidence) -> Iterator[Sighting]:
    """Find quaternions that make sense only as x, y, z, w: by velocities, or by the vehicle's own roll and pitch."""
    by_velocity = [motion.pose_sender for motion in evidence.stream.motions if is_misordered(motion)]
    for poses in evidence.stream.poses:
        track = poses.track
        if track.sender in by_velocity:
            text = "the velocity fits the path only if the quaternion is read as x, y, z, w"
            yield Sighting.in_track(f"{track.sender}: {text}", track)
        elif poses.euler_rad is None and evidence.vehicle.attitude is not None:
            vehicle = evidence.vehicle.attitude.at(track.arrival_us)
            apart = [_median_tilt(quats, vehicle) for quats in (poses.quat_wxyz, reordered(poses.quat_wxyz))]
            if apart[0] > limits.TILTED_RAD and apart[1] < limits.LEVEL_RAD:
                yield Sighting.in_track(
                    f"{track.sender}: roll and pitch are {math.degrees(apart[0]):.0f} deg from the vehicle's own, and "
                    f"{math.degrees(apart[1]):.0f} deg if the quaternion is read as x, y, z, w",
                    track,
                )


@check(
    code="XN2-11",
    severity=Severity.WARNING,
    title="The vehicle sinks below where it stood",
    firmware=(
        "z is down: a vehicle that takes off goes to negative z. With EK3_SRC1_POSZ 6 the autopilot takes a climb for "
        "a descent, and climbs on to correct it."
    ),
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion",
    fix=(
        "From ROS send positions as (y, x, -z), or (x, -y, -z) if the world has no north, and the attitude with them. "
        "If the vehicle really flew below its start, do nothing."
    ),
)
def sinks_below_start(evidence: Evidence) -> Iterator[Sighting]:
    """Find poses that begin at rest and go down only, if nothing else shows the vehicle's height or attitude."""
    if (
        evidence.vehicle.height is not None
        or evidence.vehicle.level is not None
        or evidence.vehicle.attitude is not None
    ):
        return
    for poses in evidence.stream.poses:
        pos = poses.pos_m[np.isfinite(poses.pos_m).all(axis=1)]
        if len(pos) < FEWEST_MESSAGES or np.ptp(pos[: limits.FEWEST_AT_REST], axis=0).max() > limits.REST_M:
            continue
        sunk = pos[:, 2] - pos[0, 2]
        if sunk.max() >= limits.LEAST_SINKING_M and -sunk.min() < limits.MOST_RISE_SHARE * sunk.max():
            deepest = f"z grows by up to {sunk.max():.1f} m from where it begins, and never falls below that"
            yield Sighting.in_track(f"{poses.track.sender}: {deepest}: is z up there?", poses.track)


def _median_tilt(quat_wxyz: Floats, vehicle_rad: Floats) -> float:
    """Return the median angle between two attitudes' verticals in rad; NaN if too few are known."""
    sent = euler_from_quats(quat_wxyz)
    fine = np.isfinite(np.column_stack((sent, vehicle_rad))).all(axis=1)
    if np.count_nonzero(fine) < FEWEST_MESSAGES:
        return math.nan
    cosine = np.sum(down_in_body(sent[fine]) * down_in_body(vehicle_rad[fine]), axis=1)
    return float(np.median(np.arccos(np.clip(cosine, -1, 1))))
