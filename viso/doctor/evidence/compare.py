# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stream compared with the vehicle's own attitude and path: delay, axes, and the scale of positions."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from ap_core.internal_error import InternalErrors
from ap_core.rotations import quaternion_from_rotation
from ekf_stub.ahrs.sources import EXTNAV
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.tracks import Floats, HandledMessage, Ints, Poses, down_in_body
from viso.doctor.evidence.vehicle_data import AttitudeSeries
from viso.doctor.evidence.vehicle_position import PositionSeries
from viso.estimators.angles import ANGLES, YAW, Carrier, carriers, unfolded
from viso.estimators.delay import PIECE_S, Delay, delays_over_time, estimate_delay
from viso.estimators.orientation import ChosenAxes, WorldAxes, estimate_orientation, estimate_world_axes
from viso.estimators.positions import Scale, estimate_position_axes, estimate_scale
from viso.geometry.rotation import euler_from_quats, product, quats_from_euler

ALIGNING_TYPES: Final = (2, 3)
NO_TURNING: Final = np.zeros((0, 4))
_FEWEST: Final = 40


class DelayGrowth(NamedTuple):
    """A delay that grows: from when, in s since boot, its first and last value in ms, and ms a second between."""

    from_s: float
    first_ms: float
    last_ms: float
    ms_a_second: float


_LEAST_GROWTH_MS: Final = 100.0
_FEWEST_PIECES: Final = 5
_LEAST_ORDER: Final = 0.85  # rank correlation with time
_EXACT_MS: Final = 2.0


def delay_growth(
    since_arrival: Delay, arrived_us: Ints, quats: Floats, vehicle: tuple[Ints, Floats]
) -> DelayGrowth | None:
    """Return how a delay grows; a constant one that fits exactly is not looked at in pieces."""
    if since_arrival.enough_motion and since_arrival.sigma_ms < _EXACT_MS:
        return None
    delays_ms, middles_s = delays_over_time(arrived_us, quats, *vehicle)
    if len(delays_ms) < _FEWEST_PIECES:
        return None
    part = max(len(delays_ms) // 4, 2)
    first_ms, last_ms = float(np.median(delays_ms[:part])), float(np.median(delays_ms[-part:]))
    order = np.corrcoef(np.argsort(np.argsort(delays_ms)), np.arange(len(delays_ms)))[0, 1]
    if last_ms - first_ms < _LEAST_GROWTH_MS or order < _LEAST_ORDER:
        return None
    begun = max(int(np.argmax(delays_ms > delays_ms[0] + 0.1 * (last_ms - first_ms))) - 1, 0)
    i, j = np.triu_indices(len(delays_ms), 1)
    slope = float(np.median((delays_ms[j] - delays_ms[i]) / (middles_s[j] - middles_s[i])))
    return DelayGrowth(float(middles_s[begun]) - PIECE_S / 2, float(delays_ms[0]), float(delays_ms[-1]), slope)


class Reading(NamedTuple):
    """Quaternions read in another order: its name, and how far they tilt from the vehicle then (median, rad)."""

    name: str
    tilt_rad: float


LAST: Final = "x, y, z, w"
_READINGS: Final = {LAST: (3, 0, 1, 2), "w, z, y, x": (0, 3, 2, 1)}
"""By name, where w, x, y and z stand."""
_TILTED_RAD: Final = math.radians(20)
"""Quaternions that are read in the wrong order tilt as far, unless the vehicle points north all the time."""
_LEVEL_RAD: Final = math.radians(8)
"""Quaternions that are read in the right order agree with the vehicle's roll and pitch as closely."""
_BETTER: Final = 0.1
"""Of a correlation of yaws: a less usual order of a quaternion has to fit better by this."""


def median_tilt(quat_wxyz: Floats, vehicle_rad: Floats) -> float:
    """Return the median angle between two attitudes' verticals in rad; NaN if too few are known."""
    sent = euler_from_quats(quat_wxyz)
    fine = np.isfinite(np.column_stack((sent, vehicle_rad))).all(axis=1)
    if np.count_nonzero(fine) < FEWEST_MESSAGES:
        return math.nan
    cosine = np.sum(down_in_body(sent[fine]) * down_in_body(vehicle_rad[fine]), axis=1)
    return float(np.median(np.arccos(np.clip(cosine, -1, 1))))


def level_reading(quat: Floats, vehicle_rad: Floats) -> Reading | None:
    """Return the order in which N x 4 quaternions agree with the vehicle's roll, pitch and yaw (N x 3).

    Of orders that agree alike it is the most usual. None if they do not tilt as sent, or in every order.
    """
    if not median_tilt(quat, vehicle_rad) > _TILTED_RAD:
        return None
    best, likeness = None, 0.0
    for name, places in _READINGS.items():
        for suffix, signs in (("", (1, 1, 1, 1)), (", of the inverse rotation", (1, -1, -1, -1))):
            read = quat[:, places] * np.array(signs)
            found = Reading(name + suffix, median_tilt(read, vehicle_rad))
            yaw_likeness = _yaw_likeness(read, vehicle_rad)
            if found.tilt_rad < _LEVEL_RAD and (best is None or yaw_likeness > likeness + _BETTER):
                best, likeness = found, yaw_likeness
    return best


def _yaw_likeness(quat_wxyz: Floats, vehicle_rad: Floats) -> float:
    """Return how alike yaw is to the vehicle's, -1 to 1; 0 if the vehicle turns too little."""
    yaw, there = euler_from_quats(quat_wxyz)[:, 2], vehicle_rad[:, 2]
    fine = np.isfinite(yaw) & np.isfinite(there)
    sent, turned = np.unwrap(yaw[fine]), np.unwrap(there[fine])
    if np.ptp(turned) < _TILTED_RAD or np.std(sent) == 0:
        return 0.0
    return float(np.corrcoef(sent, turned)[0, 1])


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """A stream's attitude compared with the vehicle's own; for types 2 and 3 VISO_ORIENT is taken off first.

    Attributes:
        poses: of the stream.
        delay: since the corrected stamps, from which the filter subtracts VISO_DELAY_MS.
        since_arrival: since the times of arrival.
        orientation: of the stream's body.
        world: of the stream's world.
        growth: how the delay since the times of arrival grows; None if it does not.
        reading: the order in which quaternions make sense, if it is not w, x, y, z.
        carriers: the numbers, of those that the message names roll, pitch and yaw, that follow the vehicle's angles.
        transport_ms: what the autopilot subtracts at least from every time of arrival, for the transport of the bytes.
    """

    poses: Poses
    delay: Delay
    since_arrival: Delay
    orientation: ChosenAxes
    world: WorldAxes
    growth: DelayGrowth | None = None
    reading: Reading | None = None
    carriers: tuple[Carrier, ...] = ()
    transport_ms: float = 0.0

    @property
    def shows_axes(self) -> bool:
        """Whether one mounting of the body and one world explain all attitudes."""
        return self.orientation.sufficient and self.world.sufficient

    @property
    def exchanged(self) -> tuple[Carrier, ...]:
        """The angles that come in another number or with the opposite sign; none if a mounting or world fits better."""
        wrong = tuple(carrier for carrier in self.carriers if not carrier.is_right)
        is_yaw_elsewhere = any(
            carrier.sent != carrier.angle and YAW in (carrier.sent, carrier.angle) for carrier in wrong
        )
        is_full = len(self.carriers) == len(ANGLES) and is_yaw_elsewhere
        fits_better = is_full and min(one.correlation for one in wrong) > self.orientation.choice.correlation
        return wrong if fits_better or not self.shows_axes else ()

    @property
    def late_ms(self) -> float:
        """How late poses arrive; 0 if the motion does not show it."""
        return self.since_arrival.delay_ms if self.since_arrival.enough_motion else 0.0


def comparison_of(poses: Poses, comparisons: Sequence[Comparison]) -> Comparison | None:
    """Return the comparison of some poses; None if there is none."""
    return next((comparison for comparison in comparisons if comparison.poses is poses), None)


def quats_are_turned(viso_type: int, orient: int) -> bool:
    """Return whether the autopilot takes VISO_ORIENT off attitudes."""
    return orient != 0 and viso_type in ALIGNING_TYPES


def oriented(quat_wxyz: Floats, viso_type: int, orient: int) -> Floats:
    """Return attitudes with VISO_ORIENT taken off, as types 2 and 3 do (AP_VisualOdom_IntelT265::rotate_attitude)."""
    if not quats_are_turned(viso_type, orient):
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
    turning: Floats = NO_TURNING,
) -> tuple[Comparison, ...]:
    """Compare each track of poses with the vehicle's own attitude, and with its body rates (us, rad/s; M x 4)."""
    if attitude is None or len(attitude) < _FEWEST:
        return ()
    by_number = {message.number: message for message in messages}
    vehicle_us, vehicle_quats = _usable(attitude.time_us, quats_from_euler(attitude.euler_rad))
    viso_type, orient = int(params.get("VISO_TYPE", 0)), int(params.get("VISO_ORIENT", 0))
    turned_rad = _turned_rad(attitude, turning)
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
        sent_rad = pose.euler_rad
        if sent_rad is None or quats_are_turned(viso_type, orient):
            sent_rad = unfolded(euler_from_quats(oriented(pose.quat_wxyz, viso_type, orient)))
        found_carriers = carriers(
            pose.track.arrival_us, sent_rad, attitude.time_us, np.unwrap(attitude.euler_rad, axis=0), turned_rad
        )
        growth = delay_growth(since_arrival, arrived_us, as_sent, (vehicle_us, vehicle_quats))
        is_quaternion = pose.euler_rad is None
        reading = level_reading(pose.quat_wxyz, attitude.at(pose.track.arrival_us)) if is_quaternion else None
        if reading is not None and not reading.name.startswith(LAST) and orientation.sufficient and world.sufficient:
            reading = None  # a mounting of the camera is likelier
        found.append(
            Comparison(pose, delay, since_arrival, orientation, world, growth, reading, found_carriers, transport_ms)
        )
    return tuple(found)


def _turned_rad(attitude: AttitudeSeries, turning: Floats) -> Floats:
    """Return the vehicle's turns in roll, pitch and yaw; a yaw that may follow the stream is that of the gyro."""
    turned = np.unwrap(attitude.euler_rad, axis=0)
    if not attitude.follows_stream or len(turning) < _FEWEST:
        return turned
    roll, pitch = (np.interp(turning[:, 0], attitude.time_us, turned[:, axis]) for axis in (0, 1))
    rate = (np.sin(roll) * turning[:, 2] + np.cos(roll) * turning[:, 3]) / np.maximum(np.cos(pitch), 0.1)
    step_s = np.minimum(np.diff(turning[:, 0]) * 1e-6, 1.0)
    yaw = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * step_s)])
    return np.column_stack((turned[:, :2], np.interp(attitude.time_us, turning[:, 0], yaw)))


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
