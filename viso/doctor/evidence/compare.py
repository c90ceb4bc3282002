# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stream compared with the vehicle's own attitude and path: delay, axes, and the scale of positions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.internal_error import InternalErrors
from ap_core.rotations import quaternion_from_rotation
from ekf_stub.ahrs.sources import EXTNAV
from viso.doctor.evidence.tracks import Floats, HandledMessage, Ints, Poses
from viso.doctor.evidence.vehicle_data import AttitudeSeries
from viso.doctor.evidence.vehicle_position import PositionSeries
from viso.estimators.delay import Delay, estimate_delay
from viso.estimators.orientation import ChosenAxes, WorldAxes, estimate_orientation, estimate_world_axes
from viso.estimators.positions import Scale, estimate_position_axes, estimate_scale
from viso.geometry.rotation import product, quats_from_euler

ALIGNING_TYPES: Final = (2, 3)
_FEWEST: Final = 40


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """A stream's attitude compared with the vehicle's own; for types 2 and 3 VISO_ORIENT is taken off first.

    Attributes:
        poses: of the stream.
        delay: since the corrected stamps, from which the filter subtracts VISO_DELAY_MS.
        since_arrival: since the times of arrival.
        orientation: of the stream's body.
        world: of the stream's world.
        transport_ms: what the autopilot subtracts at least from every time of arrival, for the transport of the bytes.
    """

    poses: Poses
    delay: Delay
    since_arrival: Delay
    orientation: ChosenAxes
    world: WorldAxes
    transport_ms: float = 0.0

    @property
    def late_ms(self) -> float:
        """How late poses arrive; 0 if the motion does not show it."""
        return self.since_arrival.delay_ms if self.since_arrival.enough_motion else 0.0


def comparison_of(poses: Poses, comparisons: Sequence[Comparison]) -> Comparison | None:
    """Return the comparison of some poses; None if there is none."""
    return next((comparison for comparison in comparisons if comparison.poses is poses), None)


def oriented(quat_wxyz: Floats, viso_type: int, orient: int) -> Floats:
    """Return attitudes with VISO_ORIENT taken off, as types 2 and 3 do (AP_VisualOdom_IntelT265::rotate_attitude)."""
    if orient == 0 or viso_type not in ALIGNING_TYPES:
        return quat_wxyz
    back = quaternion_from_rotation(orient, InternalErrors()).inverse()
    return product(quat_wxyz, back.to_wxyz())


def _corrected_us(poses: Poses, messages: Mapping[int, HandledMessage]) -> Ints:
    """Return the times that the autopilot gives to poses (CTimeMS), or that of arrival if it made no record."""
    times = poses.track.arrival_us.copy()
    for index, number in enumerate(poses.track.numbers.tolist()):
        for name, values in messages[number].records:
            if name == "VISP" and isinstance(values[2], int):
                times[index] = values[2] * 1000
    return times


def _usable(time_us: Ints, quat_wxyz: Floats) -> tuple[Ints, Floats]:
    """Return the quaternions that are finite and of about unit length, in order of time."""
    with np.errstate(all="ignore"):
        norm = np.linalg.norm(quat_wxyz, axis=1)
    fine = np.isfinite(norm) & (np.abs(norm - 1) < 0.1)
    time_us, quat_wxyz = time_us[fine], quat_wxyz[fine] / norm[fine, None]
    time_us, first = np.unique(time_us, return_index=True)
    return time_us, quat_wxyz[first]


def compare(
    poses: Sequence[Poses],
    messages: Sequence[HandledMessage],
    attitude: AttitudeSeries | None,
    params: Mapping[str, float],
) -> tuple[Comparison, ...]:
    """Compare each track of poses with the vehicle's own attitude."""
    if attitude is None or len(attitude) < _FEWEST:
        return ()
    by_number = {message.number: message for message in messages}
    vehicle_us, vehicle_quats = _usable(attitude.time_us, quats_from_euler(attitude.euler_rad))
    viso_type, orient = int(params.get("VISO_TYPE", 0)), int(params.get("VISO_ORIENT", 0))
    found = []
    for pose in poses:
        quats = oriented(pose.quat_wxyz, viso_type, orient)
        corrected_us = _corrected_us(pose, by_number)
        time_us, quats = _usable(corrected_us, quats)
        if len(time_us) < _FEWEST:
            continue
        delay = estimate_delay(time_us, quats, vehicle_us, vehicle_quats)
        lag_ms = delay.delay_ms if delay.enough_motion else 0.0
        orientation = estimate_orientation(time_us, quats, vehicle_us, vehicle_quats, delay_ms=lag_ms)
        world = estimate_world_axes(
            time_us, quats, vehicle_us, vehicle_quats, body_axes=orientation.axes, delay_ms=lag_ms
        )
        arrived_us, as_sent = _usable(pose.track.arrival_us, pose.quat_wxyz)
        since_arrival = estimate_delay(arrived_us, as_sent, vehicle_us, vehicle_quats)
        transport_ms = float(np.min(pose.track.arrival_us - corrected_us)) * 1e-3
        found.append(Comparison(pose, delay, since_arrival, orientation, world, transport_ms))
    return tuple(found)


@dataclass(frozen=True, slots=True, eq=False)
class PathComparison:
    """A stream's path compared with the vehicle's own.

    Attributes:
        poses: of the stream, as sent.
        origin: of the vehicle's path, such as GPS.
        scale: the factor for positions.
        axes: of the positions; None if the stream's heading is not known.
    """

    poses: Poses
    origin: str
    scale: Scale
    axes: ChosenAxes | None


def _heading_deg(compared: Comparison | None, params: Mapping[str, float]) -> float | None:
    """Return the compass direction of the stream's x; None if it is not known."""
    if compared is not None and compared.orientation.sufficient and compared.world.sufficient:
        is_level = compared.world.axes.signed_axes[2] == 3
        return compared.world.heading_deg if is_level else None
    is_aligned = int(params.get("VISO_TYPE", 0)) in ALIGNING_TYPES or params.get("EK3_SRC1_YAW") == EXTNAV
    return None if is_aligned else 0.0


def compare_paths(
    poses: Sequence[Poses],
    position: PositionSeries | None,
    comparisons: Sequence[Comparison],
    params: Mapping[str, float],
) -> tuple[PathComparison, ...]:
    """Compare each track of poses with the vehicle's own path."""
    if position is None:
        return ()
    found = []
    for pose in poses:
        if len(pose.track) < _FEWEST:
            continue
        compared = comparison_of(pose, comparisons)
        delay_ms = 0.0 if compared is None else compared.late_ms
        paths = pose.track.arrival_us, pose.pos_m, position.time_us, position.ned_m
        heading_deg = _heading_deg(compared, params)
        axes = None
        if heading_deg is not None:
            axes = estimate_position_axes(*paths, heading_deg=heading_deg, delay_ms=delay_ms)
        found.append(PathComparison(pose, position.origin, estimate_scale(*paths, delay_ms=delay_ms), axes))
    return tuple(found)
