# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's arithmetic as functions of numbers and arrays, compiled by numba. Needs the extra numba.

Formulas and their order are those of `nominal_state`, `process_model`, `error_state` and `covariance` in
`ekf_stub.filter`, which define them. Products of matrices leave out what is known to be zero, and so round otherwise
than the BLAS does.
"""

import math
from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np

from ekf_stub.filter.covariance import ROUNDING
from ekf_stub.filter.error_state import MAX_INNOVATION, MAX_TILT_VAR, MIN_NOISE_VAR, OBSERVABLE_COSINE, SHARP
from ekf_stub.filter.inertial import GRAVITY_MSS, MAX_DEL_ANG, MAX_DEL_VEL, MAX_DT, MIN_DT, Array
from ekf_stub.filter.nominal_state import MAX_ACCEL_WITHOUT_AIDING
from ekf_stub.filter.process_model import MAX_GROWING_POS_VAR
from ekf_stub.filter.states import ACCEL, ATT, GYRO, MIN_ACCEL_VAR, MIN_ACCEL_VAR_RATIO, POS, STATES, VEL

_GRAVITY: Final = GRAVITY_MSS
_VEL: Final = VEL.start
_POS: Final = POS.start
_GYRO: Final = GYRO.start
_ACCEL: Final = ACCEL.start
_ATT_END: Final = ATT.stop
QUATERNION_EPS: Final = 1e-14  # of numpy-quaternion

F = TypeVar("F", bound=Callable[..., Any])
Quat = tuple[float, float, float, float]


def compiled(function: F) -> F:
    """Return what numba makes of a function as it is first called; to the types it is the function."""
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))


@compiled
def normalized(w: float, x: float, y: float, z: float) -> Quat:
    length = math.sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


@compiled
def times(first: Quat, second: Quat) -> Quat:
    a, b, c, d = first
    w, x, y, z = second
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


@compiled
def turned_by(quat: Quat, x: float, y: float, z: float) -> Quat:
    """Return a quaternion after a rotation by a vector, of which half is given, in rad."""
    length = math.sqrt(x * x + y * y + z * z)
    w, scale = 1.0, 0.0
    if length > QUATERNION_EPS:
        w, scale = math.cos(length), math.sin(length) / length
    product: Quat = times(quat, (w, scale * x, scale * y, scale * z))
    turned: Quat = normalized(*product)
    return turned


@compiled
def set_rotation(rotation: Array, quat: Quat) -> None:
    w, x, y, z = quat
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@compiled
def limit(values: Array, lowest: Array, highest: Array) -> None:
    for index in range(len(values)):
        if values[index] < lowest[index]:
            values[index] = lowest[index]
        if values[index] > highest[index]:
            values[index] = highest[index]


@compiled
def move(
    quat: Quat,
    states: Array,
    rotation: Array,
    accel_filtered: Array,
    del_ang: Array,
    del_vel: Array,
    del_ang_dt: float,
    dt: float,
    dt_ekf_avg: float,
    earth_rate: Array,
    aided: bool,
    lowest: Array,
    highest: Array,
) -> Quat:
    """Move on by a step (NominalState.move): change states, rotation and filtered acceleration; return the attitude."""
    angle, velocity, del_vel_ned = np.empty(3), np.empty(3), np.empty(3)
    for axis in range(3):
        turn = 0.0
        for row in range(3):
            turn += earth_rate[row] * rotation[row, axis]
        angle[axis] = del_ang[axis] - states[_GYRO - _ATT_END + axis] * (del_ang_dt / dt_ekf_avg)
        angle[axis] -= turn * del_ang_dt
        velocity[axis] = del_vel[axis] - states[_ACCEL - _ATT_END + axis] * (dt / dt_ekf_avg)
    for row in range(3):
        total = 0.0
        for axis in range(3):
            total += rotation[row, axis] * velocity[axis]
        del_vel_ned[row] = total
    del_vel_ned[2] += _GRAVITY * dt
    after: Quat = turned_by(quat, angle[0] * 0.5, angle[1] * 0.5, angle[2] * 0.5)
    set_rotation(rotation, after)
    for axis in range(3):
        accel_filtered[axis] = 0.95 * accel_filtered[axis] + 0.05 / max(dt, MIN_DT) * del_vel_ned[axis]
    horizontal = math.hypot(accel_filtered[0], accel_filtered[1])
    if not aided and horizontal > MAX_ACCEL_WITHOUT_AIDING:
        del_vel_ned[0] *= MAX_ACCEL_WITHOUT_AIDING / horizontal
        del_vel_ned[1] *= MAX_ACCEL_WITHOUT_AIDING / horizontal
    for axis in range(3):
        vel = states[_VEL - _ATT_END + axis]
        states[_POS - _ATT_END + axis] += dt * (vel + 0.5 * del_vel_ned[axis])
        states[_VEL - _ATT_END + axis] = vel + del_vel_ned[axis]
    limit(states, lowest, highest)
    return after


@compiled
def by_rotation(quat: Quat) -> Array:
    w, x, y, z = 0.5 * quat[0], 0.5 * quat[1], 0.5 * quat[2], 0.5 * quat[3]
    return np.array(((-x, -y, -z), (w, -z, y), (z, w, -x), (-y, x, w)))


@compiled
def by_attitude(quat: Quat, del_ang: Array, del_vel: Array) -> Array:
    """Return how attitude and velocity after a step depend on the attitude before it, shape (7, 4)."""
    w, x, y, z = 2 * quat[0], 2 * quat[1], 2 * quat[2], 2 * quat[3]
    ax, ay, az = 0.5 * del_ang[0], 0.5 * del_ang[1], 0.5 * del_ang[2]
    vx, vy, vz = del_vel[0], del_vel[1], del_vel[2]
    return np.array(
        (
            (1.0, -ax, -ay, -az),
            (ax, 1.0, az, -ay),
            (ay, -az, 1.0, ax),
            (az, ay, -ax, 1.0),
            (vz * y - vy * z, vy * y + vz * z, vz * w + vy * x - 2 * vx * y, vz * x - vy * w - 2 * vx * z),
            (vx * z - vz * x, vx * y - 2 * vy * x - vz * w, vx * x + vz * z, vx * w - 2 * vy * z + vz * y),
            (vy * x - vx * y, vx * z + vy * w - 2 * vz * x, vy * z - vx * w - 2 * vz * y, vx * x + vy * y),
        )
    )


@compiled
def transit(out: Array, cov: Array, by_att: Array, by_turn: Array, rotation: Array, dt: float, first_axis: int) -> None:
    """Multiply the transition by a matrix. A position follows its velocity from ``first_axis`` on."""
    for row in range(_ATT_END):
        a, b, c, d = by_att[row]
        x, y, z = by_turn[row]
        for column in range(STATES):
            total = a * cov[0, column] + b * cov[1, column] + c * cov[2, column] + d * cov[3, column]
            total -= x * cov[_GYRO, column]
            total -= y * cov[_GYRO + 1, column]
            out[row, column] = total - z * cov[_GYRO + 2, column]
    for row in range(_VEL, _POS):
        a, b, c, d = by_att[row]
        x, y, z = rotation[row - _VEL]
        for column in range(STATES):
            total = a * cov[0, column] + b * cov[1, column] + c * cov[2, column] + d * cov[3, column]
            total -= x * cov[_ACCEL, column]
            total -= y * cov[_ACCEL + 1, column]
            out[row, column] = total - z * cov[_ACCEL + 2, column] + cov[row, column]
    out[_POS:] = cov[_POS:]
    for axis in range(first_axis, 3):
        for column in range(STATES):
            out[_POS + axis, column] += dt * cov[_VEL + axis, column]


@compiled
def grow(
    cov: Array,
    quat: Quat,
    rotation: Array,
    del_ang: Array,
    del_vel: Array,
    dt: float,
    attitude_variance: float,
    variances: Array,
) -> None:
    """Move a covariance on by a step (ProcessModel.predict)."""
    by_turn, by_att = by_rotation(quat), by_attitude(quat, del_ang, del_vel)
    first_axis = 2 if cov[_POS, _POS] + cov[_POS + 1, _POS + 1] > MAX_GROWING_POS_VAR else 0
    half, turned, predicted = np.empty((STATES, STATES)), np.empty((STATES, STATES)), np.empty((STATES, STATES))
    transit(half, cov, by_att, by_turn, rotation, dt, first_axis)
    turned[:] = half.T  # as rows, which are worked on at once
    transit(predicted, turned, by_att, by_turn, rotation, dt, first_axis)
    for row in range(_ATT_END):
        for column in range(_ATT_END):
            total = 0.0
            for axis in range(3):
                total += by_turn[row, axis] * by_turn[column, axis]
            predicted[row, column] += attitude_variance * total
    for row in range(STATES):
        for column in range(row + 1):
            cov[row, column] = cov[column, row] = 0.5 * (predicted[row, column] + predicted[column, row])
    for state in range(_VEL, STATES):
        cov[state, state] += variances[state - _VEL]


@compiled
def clear(cov: Array, first: int, end: int, variance: float, highest: float) -> None:
    """Forget what some errors have to do with others, and give them a variance (covariance.clear)."""
    for state in range(first, end):
        for other in range(STATES):
            cov[state, other] = cov[other, state] = 0.0
    value = highest
    if variance <= highest:
        value = variance if variance > 0.0 else 0.0
    for state in range(first, end):
        cov[state, state] = value


@compiled
def lift(cov: Array, lowest_var: Array) -> None:
    """Raise variances that are too small (covariance.lift)."""
    largest = max(cov[_ACCEL, _ACCEL], cov[_ACCEL + 1, _ACCEL + 1], cov[_ACCEL + 2, _ACCEL + 2])
    for axis in range(3):
        lowest_var[_ACCEL + axis] = max(MIN_ACCEL_VAR_RATIO * largest, MIN_ACCEL_VAR)
    for state in range(STATES):
        if cov[state, state] < lowest_var[state]:
            cov[state, state] = lowest_var[state]


@compiled
def bound(cov: Array, lowest_var: Array, highest_var: Array) -> None:
    """Shrink errors whose variance is too large, and raise what is too small (covariance.lower, covariance.lift)."""
    for state in range(STATES):
        if cov[state, state] > highest_var[state]:
            scale = math.sqrt(highest_var[state] / cov[state, state])
            for other in range(STATES):
                cov[state, other] *= scale
            for other in range(STATES):
                cov[other, state] *= scale
            cov[state, state] = highest_var[state]
    lift(cov, lowest_var)


@compiled
def freeze_unobservable(
    cov: Array, rotation: Array, frozen: Array, on_ground: bool, is_moved: bool, highest_var: Array
) -> None:
    """Let biases rest that cannot be told from tilt; ``frozen`` has their variances, or NaN (ErrorState.predict)."""
    for axis in range(3):
        state = _ACCEL + axis
        observable = not on_ground or (abs(rotation[2, axis]) > OBSERVABLE_COSINE and not is_moved)
        if not observable and math.isnan(frozen[axis]):
            frozen[axis] = cov[state, state]
        elif observable and not math.isnan(frozen[axis]):
            clear(cov, state, state + 1, frozen[axis], highest_var[state])
            frozen[axis] = math.nan


@compiled
def isolate(cov: Array, learns_biases: bool, frozen: Array, forgets_frozen: bool, highest_var: Array) -> None:
    """Keep what is not estimated apart (ErrorState.predict)."""
    if not learns_biases:
        clear(cov, _GYRO, _ACCEL, 0.0, highest_var[_GYRO])
        clear(cov, _ACCEL, _ACCEL + 3, 10 * MIN_ACCEL_VAR, highest_var[_ACCEL])
    for axis in range(3):
        if not math.isnan(frozen[axis]):
            state = _ACCEL + axis
            with_later = cov[state, state + 1 : _ACCEL + 3].copy()
            clear(cov, state, state + 1, frozen[axis], highest_var[state])
            if not forgets_frozen:
                cov[state, state + 1 : _ACCEL + 3] = with_later
                cov[state + 1 : _ACCEL + 3, state] = with_later


@compiled
def tilt_variance(cov: Array, quat: Quat) -> float:
    """Return the variance of the direction of down (ErrorState.tilt_variance)."""
    w, x, y, z = quat
    variance: float = 4 * ((x * x + y * y) * (cov[0, 0] + cov[3, 3]) + (w * w + z * z) * (cov[1, 1] + cov[2, 2]))
    return min(variance, MAX_TILT_VAR)


@compiled
def is_sound(del_ang: Array, del_vel: Array, del_ang_dt: float, del_vel_dt: float) -> bool:
    """Return whether inertial data is finite, and no more than a vehicle survives (inertial.is_sound)."""
    ang, vel = abs(del_ang[0]) + abs(del_ang[1]) + abs(del_ang[2]), abs(del_vel[0]) + abs(del_vel[1]) + abs(del_vel[2])
    are_short = 0.0 <= del_ang_dt <= MAX_DT and 0.0 <= del_vel_dt <= MAX_DT
    return are_short and ang <= MAX_DEL_ANG and vel <= MAX_DEL_VEL


@compiled
def predict(
    cov: Array,
    quat: Quat,
    states: Array,
    rotation: Array,
    accel_filtered: Array,
    frozen: Array,
    del_ang: Array,
    del_vel: Array,
    del_ang_dt: float,
    del_vel_dt: float,
    dt: float,
    dt_ekf_avg: float,
    earth_rate: Array,
    aided: bool,
    on_ground: bool,
    is_moved: bool,
    learns_biases: bool,
    forgets_frozen: bool,
    attitude_variance: float,
    variances: Array,
    lowest: Array,
    highest: Array,
    lowest_var: Array,
    highest_var: Array,
) -> tuple[float, float, float, float, float]:
    """Move all on by a step (ErrorState.predict): change what is in arrays; return the attitude and tilt's variance.

    The latter is below 0, and nothing is changed, when the inertial data are unsound.
    """
    if not is_sound(del_ang, del_vel, del_ang_dt, del_vel_dt):
        return *quat, -1.0
    turned, sped = np.empty(3), np.empty(3)
    for axis in range(3):
        turned[axis] = del_ang[axis] - states[_GYRO - _ATT_END + axis]
        sped[axis] = del_vel[axis] - states[_ACCEL - _ATT_END + axis]
    quat = move(
        quat,
        states,
        rotation,
        accel_filtered,
        del_ang,
        del_vel,
        del_ang_dt,
        del_vel_dt,
        dt_ekf_avg,
        earth_rate,
        aided,
        lowest,
        highest,
    )
    if learns_biases:
        freeze_unobservable(cov, rotation, frozen, on_ground, is_moved, highest_var)
    grow(cov, quat, rotation, turned, sped, dt, attitude_variance, variances)
    isolate(cov, learns_biases, frozen, forgets_frozen, highest_var)
    bound(cov, lowest_var, highest_var)
    w, x, y, z = quat
    return w, x, y, z, tilt_variance(cov, quat)


@compiled
def fuse(
    cov: Array,
    spread: Array,
    expected: float,
    innovation: float,
    variance: float,
    quat: Quat,
    states: Array,
    lowest: Array,
    highest: Array,
    lowest_var: Array,
    after: Array,
) -> tuple[bool, float, float, float, float]:
    """Fuse a scalar (ErrorState.fuse_spread): set ``after`` and change ``states``; return whether, and the attitude.

    Nothing is changed but ``after`` when a variance would become negative.
    """
    w, x, y, z = quat
    variance = max(variance, MIN_NOISE_VAR)
    sigma = math.sqrt(max(expected, 0.0) + variance)
    gain = spread / sigma
    for row in range(STATES):
        for column in range(STATES):
            after[row, column] = cov[row, column] - gain[row] * gain[column]
    for state in range(STATES):
        if after[state, state] < 0.0:
            return False, w, x, y, z
    if expected > SHARP * variance:
        for state in range(STATES):
            after[state, state] += ROUNDING * cov[state, state]
    lift(after, lowest_var)
    scale = -innovation / sigma
    w, x, y, z = w + gain[0] * scale, x + gain[1] * scale, y + gain[2] * scale, z + gain[3] * scale
    if w * w + x * x + y * y + z * z > 0.0:
        w, x, y, z = normalized(w, x, y, z)
    else:
        w, x, y, z = quat
    for state in range(_ATT_END, STATES):
        states[state - _ATT_END] += gain[state] * scale
    limit(states, lowest, highest)
    return True, w, x, y, z


@compiled
def set_spread(spread: Array, cov: Array, w: float, x: float, y: float, z: float) -> float:
    """Set how errors go with what depends on the attitude alone, as given; return its variance."""
    for state in range(STATES):
        spread[state] = cov[state, 0] * w + cov[state, 1] * x + cov[state, 2] * y + cov[state, 3] * z
    variance: float = w * spread[0] + x * spread[1] + y * spread[2] + z * spread[3]
    return variance


@compiled
def update_states(
    cov: Array,
    quat: Quat,
    states: Array,
    wanted: Array,
    lowest: Array,
    highest: Array,
    lowest_var: Array,
    innovations: Array,
) -> tuple[int, float, float, float, float]:
    """Fuse measurements of states, a row for each: the state, what was measured, its variance (update_states).

    Change ``cov`` and ``states``, set ``innovations``; return how many were refused, and the attitude.
    """
    refused, after = 0, np.empty((STATES, STATES))
    for row in range(len(wanted)):
        state, variance = int(wanted[row, 0]), wanted[row, 2]
        innovation, expected = states[state - _ATT_END] - wanted[row, 1], cov[state, state]
        innovations[row] = innovation
        if not (abs(innovation) <= MAX_INNOVATION and 0.0 <= variance < math.inf and expected < math.inf):
            refused += 1
            continue
        was_fused, w, x, y, z = fuse(
            cov, cov[state], expected, innovation, variance, quat, states, lowest, highest, lowest_var, after
        )
        if was_fused:
            quat = w, x, y, z
            cov[:] = after
    w, x, y, z = quat
    return refused, w, x, y, z
