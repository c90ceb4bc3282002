# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN2: axes, compared with the vehicle's own attitude and path."""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import EXTNAV
from viso.doctor.checks import limits
from viso.doctor.checks.beside_vehicle import is_related
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.frames import is_misordered
from viso.doctor.evidence.compare import ALIGNING_TYPES, LAST, Comparison, level_reading, median_tilt, oriented
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.tracks import down_in_body
from viso.doctor.evidence.vehicle_data import HeightSeries
from viso.doctor.evidence.vehicle_position import SOURCE_SETS
from viso.estimators.angles import ANGLES, YAW, Carrier
from viso.estimators.axis_rotations import BODY_WORDS, AxisMap, orient_name, rotation_matrix
from viso.geometry.rotation import euler_from_quats

_TILTED: Final = "roll and pitch are {:.0f} deg from the vehicle's own, and {:.0f} deg if q is read as {}"


_TURN_BOTH: Final = (
    "Convert the world as well (XN2-07): VISO_ORIENT turns the body alone. Motion capture whose y points up can be set "
    "to z up there, as in Motive; then send positions as (x, -y, -z), and the attitude with them."
)


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
        if compared.exchanged or compared.reading is not None:
            continue
        is_obeyed, orient = evidence.viso_type in ALIGNING_TYPES, int(evidence.param("VISO_ORIENT"))
        mounting = orient if is_obeyed else None
        set_so = f" once VISO_ORIENT {orient} is taken off" if is_obeyed and orient else ""
        yield Sighting.in_track(
            f"{compared.poses.track.sender}: against the vehicle's own attitude the axes point {orientation.name} "
            f"rather than FRD{set_so}: {orientation.text} (correlation {orientation.choice.correlation:.2f}, next best "
            f"{orientation.choice.second_correlation:.2f})",
            compared.poses.track,
            fix=_TURN_BOTH if _is_world_tilted(compared) else _mounting_fix(orientation.axes, mounting),
        )


def _is_world_tilted(compared: Comparison) -> bool:
    """Return whether the z axis of the stream's world does not point down."""
    return compared.world.sufficient and compared.world.axes.signed_axes[2] != 3


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
    code="XN2-12",
    severity=Severity.ERROR,
    title="Roll, pitch and yaw exchanged, or of the wrong sign",
    firmware=(
        "The autopilot takes roll to the right, pitch up and yaw to the right (clockwise from above) as positive, in "
        "this order. With EK3_SRC1_YAW 6 a yaw that turns the other way, or not at all, makes the vehicle circle."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_common_vision_position_estimate_data",
    fix="Send roll, pitch and yaw of the vehicle, in this order.",
    witness=Witness.LOG,
)
def exchanged_angles(evidence: Evidence) -> Iterator[Sighting]:
    for compared in evidence.comparisons:
        if compared.exchanged and compared.reading is None:
            found = ", ".join(_carried(carrier) for carrier in compared.exchanged)
            uses = [f"EK3_SRC{number}_YAW" for number in SOURCE_SETS if evidence.source("YAW", number) == EXTNAV]
            is_used = uses or evidence.viso_type in ALIGNING_TYPES or compared.poses.track.sender.name == "ODOMETRY"
            yield Sighting.in_track(
                f"{compared.poses.track.sender}: against the vehicle's own turns, {found}",
                compared.poses.track,
                severity=None if is_used else Severity.NOTE,
                fix=_exchange_fix(compared.exchanged, is_quaternion=compared.poses.euler_rad is None),
            )


def _carried(carrier: Carrier) -> str:
    angle, sent = ANGLES[carrier.angle], ANGLES[carrier.sent]
    fit = f"(correlation {carrier.sign * carrier.correlation:.2f}"
    if carrier.sent == carrier.angle:
        return f"the {sent} that is sent turns the opposite way {fit})"
    whose = "minus the vehicle's" if carrier.sign < 0 else "the vehicle's"
    return f"what is sent as {sent} is {whose} {angle} {fit}; of the {angle} sent {carrier.own_correlation:.2f})"


def _exchange_fix(exchanged: Sequence[Carrier], *, is_quaternion: bool) -> str:
    """Return what the sender has to send in place of what it sends."""
    parts = [
        f"as {ANGLES[carrier.angle]} {'minus ' if carrier.sign < 0 else ''}what is now sent as {ANGLES[carrier.sent]}"
        for carrier in sorted(exchanged, key=lambda carrier: carrier.angle)
    ]
    fix = f"Send {', '.join(parts)}."
    if [(carrier.angle, carrier.sent) for carrier in exchanged] == [(YAW, YAW)]:
        fix += (
            " A yaw that grows to the left is that of ROS (ENU, FLU): send pi/2 - yaw with positions (y, x, -z), or "
            "-yaw with positions (x, -y, -z) if the world has no north."
        )
    if is_quaternion:
        fix += " A quaternion from world to body turns the opposite way too: there send its inverse."
    return fix


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
        if compared.shows_axes and _is_world_tilted(compared) and not _is_ros(compared) and compared.reading is None:
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
    height, level = evidence.vehicle.height, evidence.vehicle.level
    if level is not None and np.ptp(level.down_m) > limits.LEVEL_TIMES_NOISE * level.noise_m:
        height = HeightSeries(level.time_us, level.down_m)  # this one does not follow the stream
    if height is None:
        return
    for poses in evidence.stream.poses:
        there = height.at(poses.track.arrival_us)
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
    """Find quaternions that make sense only in another order: by velocities, or by the vehicle's own roll and pitch."""
    by_velocity = [motion.pose_sender for motion in evidence.stream.motions if is_misordered(evidence, motion)]
    for poses in evidence.poses_with_attitude:
        track = poses.track
        if track.sender in by_velocity:
            text = "the velocity fits the path only if the quaternion is read as x, y, z, w"
            yield Sighting.in_track(f"{track.sender}: {text}", track)
        elif poses.euler_rad is None and evidence.vehicle.attitude is not None:
            vehicle = evidence.vehicle.attitude.at(track.arrival_us)
            as_sent, found = median_tilt(poses.quat_wxyz, vehicle), level_reading(poses.quat_wxyz, vehicle)
            if found is not None:
                text = _TILTED.format(math.degrees(as_sent), math.degrees(found.tilt_rad), found.name)
                fix = None if found.name == LAST else f"Send q as w, x, y, z: what is sent is {found.name}."
                yield Sighting.in_track(f"{track.sender}: {text}", track, fix=fix)


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
    """Find poses that begin at rest and go down only, if nothing else shows the vehicle's height."""
    vehicle = evidence.vehicle
    if vehicle.height is not None or vehicle.level is not None or vehicle.is_submarine:
        return
    for poses in evidence.stream.poses:
        pos = poses.pos_m[np.isfinite(poses.pos_m).all(axis=1)]
        if len(pos) < FEWEST_MESSAGES or np.ptp(pos[: limits.FEWEST_AT_REST], axis=0).max() > limits.REST_M:
            continue
        sunk = pos[:, 2] - pos[0, 2]
        if sunk.max() >= limits.LEAST_SINKING_M and -sunk.min() < limits.MOST_RISE_SHARE * sunk.max():
            deepest = f"z grows by up to {sunk.max():.1f} m from where it begins, and never falls below that"
            yield Sighting.in_track(f"{poses.track.sender}: {deepest}: is z up there?", poses.track)


@check(
    code="XN2-13",
    severity=Severity.WARNING,
    title="The body lies on its side",
    firmware=(
        "The autopilot takes attitudes as those of the vehicle, forward, right, down. Types 2 and 3 refuse to arm "
        "beyond 10 deg of roll and pitch; the velocity of ODOMETRY is rotated by a wrong attitude."
    ),
    source="AP_VisualOdom_IntelT265.cpp, AP_VisualOdom_IntelT265::pre_arm_check",
    fix="Turn the attitude from the axes of the IMU or the camera to those of the vehicle.",
)
def body_on_its_side(evidence: Evidence) -> Iterator[Sighting]:
    """Find attitudes that lie on their side all the time, if the vehicle's own are not known."""
    low, high = limits.ON_ITS_SIDE_RAD
    for poses in evidence.stream.poses if evidence.vehicle.best_attitude is None else ():
        down = down_in_body(
            euler_from_quats(oriented(poses.quat_wxyz, evidence.viso_type, int(evidence.param("VISO_ORIENT"))))
        )
        down = down[np.isfinite(down).all(axis=1)]
        if len(down) < limits.FEWEST_COMPARED:
            continue
        tilt = np.arccos(np.clip(down[:, 2], -1, 1))
        if not low < np.median(tilt) < high or np.mean((tilt > low) & (tilt < high)) < limits.ON_ITS_SIDE_SHARE:
            continue
        middle = np.median(down, axis=0)
        axis = int(np.abs(middle[:2]).argmax())
        name, word = "xy"[axis], "down" if middle[axis] > 0 else "up"
        yield Sighting.in_track(
            f"{poses.track.sender}: roll and pitch are {math.degrees(float(np.median(tilt))):.0f} deg from level all "
            f"the time: the body's {name} points {word}, as in an IMU or a camera whose axes are not the vehicle's",
            poses.track,
            fix=(
                f"Send the attitude of the vehicle. For a trajectory, --axes WORLD/BODY names the directions of its "
                f"axes: the letter of {name} is {word[0].upper()}, as in RDF (optical), a camera whose y points "
                "down and z forward; --mounting turns by what is left over."
            ),
        )
