# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of a main loop made of what the autopilot itself believed: attitude, velocity and position.

XKF1 of the lane that was used most has velocity and position, XKQ the attitude, or ATT; a log without XKF1 has POS. The
motion is the smoothest that keeps to these: sensors that feel it have no bias and no noise, and vibration is gone. What
the filter jumped is taken out, as no vehicle jumps.
"""

from typing import Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ap_core.location import METRES_PER_UNIT
from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.inputs.measurements import Array
from viso.geometry.rotation import (
    inverse,
    normalized,
    product,
    quats_from_euler,
    quats_from_rotation_vectors,
    rotate,
    rotation_vectors_from_quats,
)
from viso.vehicle.sensors.flight import PASS_US, Basis, Flight, chosen, growing
from viso.vehicle.sensors.flown.imu_records import edges_of, flight_of, gaps_in, hermite, passes_of

JERK_NOISE: Final = 20.0
"""m/s^3 a root of Hz: how lively the motion may be between records."""

POSITION_SIGMA_M: Final = 0.05
VELOCITY_SIGMA: Final = 0.02
JUMP_M: Final = 0.3
JUMP_RAD: Final = 0.1
RESET_RAD: Final = 0.02
MOST_ACCEL: Final = 20.0
TURN_ACCEL: Final = 20.0  # rad/s^2
_FEWEST: Final = 50
_S: Final = 1e-6
_YAW_RESET: Final = 62
_UNKNOWN: Final = 1e6  # a deviation, in m or m/s


def estimates(log: LogColumns, lane: int) -> Flight | None:
    """Return the flight by the estimate of a lane; None for a log without enough of it."""
    attitude = _attitudes(log, lane)
    track, has_velocity = _track(log, lane)
    if min(len(attitude), len(track)) < _FEWEST:
        return None
    common = (track[:, 0] >= attitude[0, 0]) & (track[:, 0] <= attitude[-1, 0])
    pass_us = passes_of(track[common, 0])
    if not len(pass_us):
        return None
    begin_s, end_s = edges_of(pass_us)
    quats, before = _smooth_attitude(attitude, end_s), _smooth_attitude(attitude, begin_s)
    sigma = VELOCITY_SIGMA if has_velocity else _UNKNOWN
    vel, acc = smoothed(track[:, 0], _without_jumps(track), sigma)
    gained = hermite(track[:, 0], vel, acc, end_s) - hermite(track[:, 0], vel, acc, begin_s)
    gained[:, 2] -= GRAVITY_MSS * PASS_US * _S
    del_vel, del_ang = rotate(inverse(quats), gained), rotation_vectors_from_quats(product(inverse(before), quats))
    notes = [] if has_velocity else ["no XKF1 in the log: velocity is what POS moves by"]
    return flight_of(log, lane, Basis.ESTIMATE, pass_us, del_vel, del_ang, (*notes, *gaps_in(track[:, 0])))


# What the log has


def _track(log: LogColumns, lane: int) -> tuple[Array, bool]:
    """Return time in s, position and velocity NED [N, 7], and whether the velocity is known."""
    states = _of_lane(log, "XKF1", ["PN", "PE", "PD", "VN", "VE", "VD"], lane)
    if len(states):
        return states, True
    places, _ = chosen(log, "POS", ["TimeUS", "Lat", "Lng", "Alt"])
    if not len(places):
        return np.zeros((0, 7)), False
    north, east = ((places[:, axis] - places[0, axis]) * 1e7 * METRES_PER_UNIT for axis in (1, 2))
    east *= np.cos(np.radians(places[0, 1]))
    columns = (places[:, 0] * _S, north, east, places[0, 3] - places[:, 3], np.zeros((len(places), 3)))
    return np.column_stack(columns)[growing(places[:, 0])], False


def _of_lane(log: LogColumns, kind: str, labels: list[str], lane: int) -> Array:
    """Return time in s and fields of the records of a lane."""
    table, _ = chosen(log, kind, ["TimeUS", *labels], lane)
    table = table[growing(table[:, 0])]
    table[:, 0] *= _S
    return table


def _attitudes(log: LogColumns, lane: int) -> Array:
    """Return time in s and quaternion [N, 5], turned about the vertical so that the heading never jumps."""
    rows = _of_lane(log, "XKQ", ["Q1", "Q2", "Q3", "Q4"], lane)
    if len(rows) < _FEWEST:
        angles, _ = chosen(log, "ATT", ["TimeUS", "Roll", "Pitch", "Yaw"])
        angles = angles[growing(angles[:, 0])]
        rows = np.column_stack([angles[:, 0] * _S, quats_from_euler(np.radians(angles[:, 1:]))])
    resets = [time_us * _S for time_us, what in chosen(log, "EV", ["TimeUS", "Id"])[0].tolist() if what == _YAW_RESET]
    return _without_turns(rows, np.array(resets))


# What no vehicle does


def _surprise(steps: Array, intervals: Array) -> Array:
    """Return by how much steps [N, 3] differ from what the rate before or after them leads to, the nearer one."""
    rates = steps / intervals
    around = np.concatenate([rates[:1], rates, rates[-1:]])
    from_before, from_after = steps - around[:-2] * intervals, steps - around[2:] * intervals
    is_before = np.linalg.norm(from_before, axis=1) < np.linalg.norm(from_after, axis=1)
    surprise: Array = np.where(is_before[:, None], from_before, from_after)
    return surprise


def _without_turns(rows: Array, resets_s: Array) -> Array:
    if len(rows) < 2:
        return rows
    time_s, quats = rows[:, 0], rows[:, 1:].copy()
    intervals = np.diff(time_s)[:, None]
    steps = rotation_vectors_from_quats(product(inverse(quats[:-1]), quats[1:]))
    surprise = _surprise(steps, intervals)
    at_reset = np.diff(np.searchsorted(resets_s, time_s)) > 0
    explained = np.where(at_reset, RESET_RAD, JUMP_RAD + 0.5 * TURN_ACCEL * intervals[:, 0] ** 2)
    for number in np.flatnonzero(np.linalg.norm(surprise, axis=1) > explained).tolist():
        expected = product(quats[number], quats_from_rotation_vectors(steps[number] - surprise[number]))
        w, _, _, z = product(quats[number + 1], inverse(expected)).tolist()
        quats[: number + 1] = product(normalized((w, 0.0, 0.0, z)), quats[: number + 1])
    return np.column_stack([time_s, quats])


def _without_jumps(track: Array) -> Array:
    """Return positions and velocities [N, 6] without the jumps of the position."""
    intervals = np.diff(track[:, 0])[:, None]
    moved = 0.5 * (track[1:, 4:] + track[:-1, 4:]) * intervals
    surprise = _surprise(np.diff(track[:, 1:4], axis=0) - moved, intervals)
    explained = JUMP_M + 0.5 * MOST_ACCEL * intervals[:, 0] ** 2
    jumps = np.where((np.linalg.norm(surprise, axis=1) > explained)[:, None], surprise, 0.0)
    smooth = track[:, 1:].copy()
    smooth[1:, :3] -= np.cumsum(jumps, axis=0)
    return smooth


# The smoothest motion


def _smooth_attitude(rows: Array, at_s: Array) -> Array:
    """Return the attitudes [K, 4] at times, on a smooth curve through those of rows [N, 5]."""
    flips = np.cumprod(np.where(np.einsum("ni,ni->n", rows[1:, 1:], rows[:-1, 1:]) < 0, -1.0, 1.0))
    wxyz = rows[:, 1:] * np.concatenate([[1.0], flips])[:, None]
    curve = hermite(rows[:, 0], wxyz, np.gradient(wxyz, rows[:, 0], axis=0), at_s)
    unit: Array = curve / np.linalg.norm(curve, axis=1, keepdims=True)
    return unit


def smoothed(time_s: Array, states: Array, velocity_sigma: float) -> tuple[Array, Array]:
    """Return velocity and acceleration [N, 3] of the motion that keeps to positions and velocities [N, 6] best.

    A Kalman filter of position, velocity and acceleration, driven by white jerk, and back again (Rauch, Tung,
    Striebel); the axes share the covariance.
    """
    measured = states.reshape(-1, 2, 3)
    noise = np.diag([POSITION_SIGMA_M**2, velocity_sigma**2])
    mean, cov = np.concatenate([measured[0], np.zeros((1, 3))]), np.diag([1.0, 1.0, 1.0])
    filtered, expected = [], []
    last_s = time_s[0]
    for now_s, sample in zip(time_s.tolist(), measured, strict=True):
        step, driven = _transition(now_s - last_s)
        mean, cov = step @ mean, step @ cov @ step.T + driven
        expected.append((step, mean, cov))
        gain = np.linalg.solve(cov[:2, :2] + noise, cov[:2]).T
        mean, cov = mean + gain @ (sample - mean[:2]), cov - gain @ cov[:2]
        cov = 0.5 * (cov + cov.T)  # which rounding would undo, in a long flight with ruin
        filtered.append((mean, cov))
        last_s = now_s
    back = [mean]
    for (mean, cov), (step, ahead, ahead_cov) in zip(filtered[-2::-1], expected[:0:-1], strict=True):
        gain = np.linalg.solve(ahead_cov, step @ cov).T
        back.append(mean + gain @ (back[-1] - ahead))
    whole = np.array(back[::-1])
    return whole[:, 1], whole[:, 2]


def _transition(dt: float) -> tuple[Array, Array]:
    step = np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    by_jerk = np.array(
        [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]]
    )
    return step, JERK_NOISE**2 * by_jerk
