# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flow sensor compared with the vehicle's motion: scale, axes and delay.

A sensor that looks down sees its own turning, and its velocity over its distance to the ground: about the body's x that
is gyro.x - v.y / range, about y gyro.y + v.x / range. The turning shows most: if flow is the filter's source of
velocity, that velocity agrees with any scale.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from viso.doctor.evidence.ground_sensors import FlowSeries, GroundSensors
from viso.doctor.evidence.tracks import Bools, Floats, Ints, Poses
from viso.doctor.evidence.vehicle_data import AttitudeSeries, HeightSeries
from viso.doctor.evidence.vehicle_position import PositionSeries
from viso.estimators.turning import attitudes_of
from viso.geometry.rotation import euler_from_quats

FEWEST_FITTED: Final = 50
"""Fewer records of flow are not fitted."""

_LEAST_TURNING: Final = 0.04  # rad/s, rms of each axis
_LEAST_SHIFT: Final = 0.05  # rad/s, rms of velocity over range
_LEAST_HEIGHT_M: Final = 0.5
_LONGEST_GAP_US: Final = 500_000  # over which motion is interpolated
_LAGS_MS: Final = tuple(range(-100, 310, 10))
_OTHER_LAG_MS: Final = 30  # lags nearer to the best explain about as much
_AROUND_US: Final = 150_000  # on either side of a position, for its velocity
_EXPLAINED: Final = 0.9
_EXPLAINED_WHOLE: Final = 0.7
"""The same if turning and velocity are both known: the rest is noise, which does not change the mean."""

_MOST_FITTED: Final = 20_000  # records; more are thinned out
_LEAST_SPREAD: Final = 1e-12
_CLEARLY_LESS: Final = 0.01  # of what is explained, both axes together
_TRUTH_ORIGINS: Final = ("SIM", "SIM_STATE", "SIMSTATE")

AXES: Final[dict[str, Floats]] = {
    "as they should be": np.array([[1.0, 0.0], [0.0, 1.0]]),
    "turned by 90 degrees": np.array([[0.0, 1.0], [-1.0, 0.0]]),
    "turned by 180 degrees": np.array([[-1.0, 0.0], [0.0, -1.0]]),
    "turned by 270 degrees": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "x with the wrong sign": np.array([[-1.0, 0.0], [0.0, 1.0]]),
    "y with the wrong sign": np.array([[1.0, 0.0], [0.0, -1.0]]),
    "x and y in each other's place": np.array([[0.0, 1.0], [1.0, 0.0]]),
    "x and y in each other's place, with wrong signs": np.array([[0.0, -1.0], [-1.0, 0.0]]),
}
"""What may be wrong with a sensor's axes, with the matrix from what it should report to what it reports."""


@dataclass(frozen=True, slots=True, eq=False)
class FlowFit:
    """How a sensor's rates follow the vehicle's motion.

    Attributes:
        flow: the sensor's.
        of: what was compared with the motion, ``flow`` or the sensor's own ``gyro``.
        count: how many records were compared.
        why_not: why there is no fit; "" if there is one.
        by: whose motion that is.
        is_whole: whether both turning and velocity were known.
        by_turning: whether the turning shows the fit; else the velocity over the ground does.
        matrix: 2 x 2, from what the sensor should report to what it reports.
        explained: 0 to 1, the part of each axis' variance that the motion explains.
        lag_ms: how much later the sensor is than the motion.
        is_timed: whether the lag is clear: another one explains much less.
    """

    flow: FlowSeries
    of: str
    count: int = 0
    why_not: str = ""
    by: str = ""
    is_whole: bool = False
    by_turning: bool = True
    matrix: Floats | None = None
    explained: tuple[float, float] = (0.0, 0.0)
    lag_ms: float = 0.0
    is_timed: bool = False

    @property
    def is_judged(self) -> bool:
        """Whether the motion explains enough to judge scale and axes."""
        enough = _EXPLAINED_WHOLE if self.is_whole else _EXPLAINED
        return self.matrix is not None and min(self.explained) >= enough

    @property
    def axes(self) -> str:
        """Which of ``AXES`` is nearest to the matrix."""
        if self.matrix is None:
            return ""
        unit = self.matrix / max(float(np.linalg.norm(self.matrix)), 1e-9)
        return max(AXES, key=lambda name: float((AXES[name] * unit).sum()))

    @property
    def turned_deg(self) -> float:
        """The angle by which the sensor is turned, clockwise from above; only if its axes are not mirrored."""
        matrix = np.eye(2) if self.matrix is None else self.matrix
        return float(np.degrees(np.arctan2(matrix[0, 1] - matrix[1, 0], matrix[0, 0] + matrix[1, 1])))

    @property
    def is_mirrored(self) -> bool:
        """Whether no rotation makes its axes right."""
        return self.matrix is not None and bool(np.linalg.det(AXES[self.axes]) < 0)

    @property
    def factors(self) -> tuple[float, float]:
        """The factor of each axis, once the axes are right."""
        if self.matrix is None:
            return 1.0, 1.0
        if self.is_mirrored:
            right = AXES[self.axes].T @ self.matrix
        else:
            angle = np.radians(self.turned_deg)
            right = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ self.matrix
        return float(right[0, 0]), float(right[1, 1])


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """The motion that a flow sensor shows, by time.

    Attributes:
        by: whose it is.
        gyro: M x 4, us and body rates.
        shift: M x 3, us and velocity over the ground by range: -v.y / range, v.x / range; empty if it is not known.
        is_free: whether that velocity does not come from the flow.
    """

    by: str
    gyro: Floats
    shift: Floats
    is_free: bool

    def at(self, time_us: Floats) -> tuple[Floats, Floats]:
        """Return N x 2 rates of turning, and N x 2 of velocity over range; NaN where they are not known."""
        return _at(self.gyro, time_us)[:, :2], _at(self.shift, time_us)


def _at(table: Floats, time_us: Floats) -> Floats:
    """Return columns interpolated at some times; NaN before the first, after the last, and in gaps."""
    if len(table) < 2:
        return np.full((len(time_us), table.shape[1] - 1), np.nan)
    known = table[:, 0]
    after = np.clip(np.searchsorted(known, time_us), 1, len(known) - 1)
    near = np.diff(known)[after - 1] < _LONGEST_GAP_US
    inside = np.asarray(near & (time_us >= known[0]) & (time_us <= known[-1]), dtype=np.bool_)
    columns = [np.where(inside, np.interp(time_us, known, column), np.nan) for column in table[:, 1:].T]
    return np.column_stack(columns)


def with_motion_of(ground: GroundSensors, poses: Poses) -> tuple[GroundSensors, AttitudeSeries]:
    """Return the sensors with the motion of the stream's poses in place of the vehicle's, and the poses' attitude."""
    time_us, quats = poses.track.arrival_us, poses.quat_wxyz
    known = np.isfinite(quats).all(axis=1) & np.isfinite(poses.pos_m).all(axis=1)
    found = attitudes_of(time_us[known], quats[known])
    step_s = np.diff(found.time_s)
    rates = found.steps_rad / step_s[:, None]
    turning = np.column_stack([1e6 * (found.time_s[1:] - 0.5 * step_s), rates])
    velocity = _speed(time_us[known].astype(np.float64), poses.pos_m[known])
    attitude = AttitudeSeries(time_us[known], euler_from_quats(quats[known]) * [0.0, 0.0, 1.0])
    return replace(ground, turning=turning, velocity=velocity, by="the stream's poses"), attitude


def _speed(time_us: Floats, pos_m: Floats) -> Floats:
    """Return us and velocity north and east around each position."""
    if not len(time_us):
        return np.zeros((0, 3))
    back, ahead = (np.clip(time_us + by, time_us[0], time_us[-1]) for by in (-_AROUND_US, _AROUND_US))
    moved = [np.interp(ahead, time_us, column) - np.interp(back, time_us, column) for column in pos_m[:, :2].T]
    took_s = np.maximum(ahead - back, 1.0) * 1e-6
    return np.column_stack([time_us, *(angle / took_s for angle in moved)])


def _velocity(ground: GroundSensors, position: PositionSeries | None, uses_flow: bool) -> tuple[Floats, bool]:
    """Return us and velocity north and east, and whether they are free of the flow."""
    if position is None or position.origin not in _TRUTH_ORIGINS:
        return ground.velocity, not uses_flow
    return _speed(position.time_us.astype(np.float64), position.ned_m), True


def _motion(
    ground: GroundSensors,
    attitude: AttitudeSeries | None,
    height: HeightSeries | None,
    position: PositionSeries | None,
    uses_flow: bool,
) -> _Motion:
    velocity, is_free = _velocity(ground, position, uses_flow)
    if attitude is None or not len(velocity):
        return _Motion(ground.by, ground.turning, np.zeros((0, 3)), is_free)
    time_us = velocity[:, 0]
    yaw = attitude.at(time_us.astype(np.int64))[:, 2]
    dist_m = _distance(ground, height, time_us)
    north, east = velocity[:, 1], velocity[:, 2]
    ahead = north * np.cos(yaw) + east * np.sin(yaw)
    right = east * np.cos(yaw) - north * np.sin(yaw)
    shift = np.column_stack([time_us, -right / dist_m, ahead / dist_m])
    return _Motion(ground.by, ground.turning, shift[np.isfinite(shift).all(axis=1)], is_free)


def _distance(ground: GroundSensors, height: HeightSeries | None, time_us: Floats) -> Floats:
    """Return the distance to the ground in m, by a range finder or else by the height above the start; NaN if small."""
    below = [finder for finder in ground.ranges if finder.looks_down and finder.is_good.any()]
    if below:
        first = min(below, key=lambda finder: finder.is_sent)  # the autopilot's own word before a companion's
        table = np.column_stack([first.time_us, np.where(first.is_good, first.dist_m, np.nan)])
    elif height is not None:
        table = np.column_stack([height.time_us, height.down_m[0] - height.down_m])
    else:
        return np.full(len(time_us), np.nan)
    dist_m = _at(table.astype(np.float64), time_us)[:, 0]
    return np.where(dist_m > _LEAST_HEIGHT_M, dist_m, np.nan)


def fit_flow(
    ground: GroundSensors,
    attitude: AttitudeSeries | None,
    height: HeightSeries | None,
    position: PositionSeries | None,
    uses_flow: bool,
    is_stabilised: bool = False,
) -> tuple[FlowFit, ...]:
    """Fit each flow sensor, and each sensor's own gyro, to the vehicle's motion.

    The position is not the filter's; ``uses_flow`` says whether the filter's velocity may come from the flow. A
    stabilised sensor does not turn, so that its velocity over the ground alone shows, and has no gyro.
    """
    motion = _motion(ground, attitude, height, position, uses_flow)
    if is_stabilised:
        motion = replace(motion, gyro=motion.gyro * [1.0, 0.0, 0.0, 0.0])
    found = []
    for flow in ground.flows:
        valid = np.asarray((flow.quality > 0) & np.isfinite(flow.rate).all(axis=1), dtype=np.bool_)
        found.append(_fitted(flow, "flow", flow.rate, valid, motion))
        has_body = np.asarray(np.isfinite(flow.body).all(axis=1), dtype=np.bool_)
        if has_body.any() and not is_stabilised:
            found.append(_fitted(flow, "gyro", flow.body, has_body, replace(motion, shift=np.zeros((0, 3)))))
    return tuple(found)


def _fitted(flow: FlowSeries, of: str, rates: Floats, valid: Bools, motion: _Motion) -> FlowFit:
    rates, time_us = rates[valid], flow.time_us[valid]
    if len(rates) < FEWEST_FITTED:
        return FlowFit(flow, of, len(rates), f"it said {len(rates)} times that it saw something")
    if not len(motion.gyro):
        return FlowFit(flow, of, len(rates), "nothing tells how the vehicle turned")
    every = -(-len(rates) // _MOST_FITTED)
    fit = FlowFit(flow, of, by=motion.by)
    tried = {lag: _at_lag(fit, rates[::every], time_us[::every], motion, lag) for lag in _LAGS_MS}
    usable = {lag: at_lag for lag, at_lag in tried.items() if at_lag is not None}
    if not usable:
        return FlowFit(flow, of, len(rates), "the vehicle hardly moved where its motion and the flow are both known")
    lag_ms = max(usable, key=lambda lag: sum(usable[lag].explained))
    best = usable[lag_ms]
    others = [sum(at_lag.explained) for lag, at_lag in usable.items() if abs(lag - lag_ms) > _OTHER_LAG_MS]
    return replace(best, is_timed=len(others) > 1 and sum(best.explained) - max(others) > _CLEARLY_LESS)


def _at_lag(fit: FlowFit, rates: Floats, time_us: Ints, motion: _Motion, lag_ms: int) -> FlowFit | None:
    """Return the fit of rates to the motion ``lag_ms`` before; None if there was too little motion."""
    gyro, shift = motion.at(np.asarray(time_us - lag_ms * 1e3, dtype=np.float64))
    if np.isfinite(shift).all(axis=1).sum() < FEWEST_FITTED:
        shift = np.zeros_like(gyro)
    known = np.isfinite(gyro).all(axis=1) & np.isfinite(shift).all(axis=1)
    gyro, shift, rates = gyro[known], shift[known], rates[known]
    if len(rates) < FEWEST_FITTED:
        return None
    turns, moves = gyro.std(axis=0).min() >= _LEAST_TURNING, shift.std(axis=0).min() >= _LEAST_SHIFT
    if not turns and not (moves and motion.is_free):
        return None
    parts = [gyro, shift] if turns else [shift, gyro]
    wanted = np.column_stack([*(part for part in parts if part.any()), np.ones(len(rates))])
    found = np.linalg.lstsq(wanted, rates, rcond=None)[0]
    left = ((rates - wanted @ found) ** 2).sum(axis=0)
    whole = ((rates - rates.mean(axis=0)) ** 2).sum(axis=0)
    explained = np.where(whole > _LEAST_SPREAD, 1 - left / np.maximum(whole, _LEAST_SPREAD), 0.0)
    return replace(
        fit,
        count=len(rates),
        is_whole=bool(gyro.any() and shift.any()),
        by_turning=bool(turns),
        matrix=np.asarray(found[:2].T, dtype=np.float64),
        explained=(float(explained[0]), float(explained[1])),
        lag_ms=float(lag_ms),
    )
