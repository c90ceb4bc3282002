# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A pass of the main loop as functions of arrays, compiled by numba. Needs the extra numba.

Formulas and their order are those of `stillness`, `inertial.DownSampler` and `output_predictor` in `ekf_stub.filter`,
which define them. All that is kept from pass to pass is in one array: an array costs a call 50 ns, a
number in it nothing.
"""

import math
from typing import Final

from ekf_stub.compiled.compiled_kernel import QUATERNION_EPS, Quat, compiled, normalized, times, turned_by
from ekf_stub.filter.inertial import DUE_DT, GRAVITY_MSS, LATE_DT, LOOP_DT, MIN_DT, Array
from ekf_stub.filter.output_predictor import ATTITUDE_GAIN, BAD_ACCEL_INTEGRAL_GAIN, INTEGRAL_GAIN
from ekf_stub.filter.states import ACCEL, ATT, GYRO, POS, VEL
from ekf_stub.filter.stillness import (
    ACCEL_DIFF_LIMIT,
    ACCEL_LIMIT,
    CUTOFF_HZ,
    GYRO_DIFF_LIMIT,
    GYRO_LIMIT,
    HYSTERESIS,
)

# Where things are in the array, see `CompiledPass`.
GYRO_FILTERED, ACCEL_FILTERED = 0, 3
BIAS_RATES = 6  # six
GYRO_BEFORE, ACCEL_BEFORE, GYRO_DIFF, ACCEL_DIFF = 12, 15, 18, 19
RATIOS = 20  # four
DT_EKF_AVG = 24
DEL_VEL, VEL_DT, TURNED, ANG_DT = 25, 28, 29, 33
STEP = 34  # del_vel, del_ang, del_vel_dt, del_ang_dt
NOW = 42  # quat_wxyz, vel, pos
ANGLE_CORRECTION, POS_INTEGRAL, VEL_INTEGRAL = 52, 55, 58
HEIGHT_RATE, FILTERED_DOWN, FILTERED_ACCEL = 61, 62, 63
ANGLE_ERROR, VEL_ERROR, POS_ERROR = 64, 67, 70  # three each
HEAD = 73
SIZE: Final = 74
OUTPUT_SIZE: Final = 10

# What is known of the test for standing still, and of a pass.
IS_STILL: Final = 1
HAS_BEFORE: Final = 2
HAS_RATIOS: Final = 4
IS_STEP: Final = 8

_ALPHA: Final = LOOP_DT / (LOOP_DT + 1.0 / (2.0 * math.pi * CUTOFF_HZ))
_SLOW_SAMPLING: Final = 0.02
_SLOW_TEST: Final = 0.01
_STATE_VEL: Final = VEL.start - ATT.stop
_STATE_POS: Final = POS.start - ATT.stop
_STATE_GYRO: Final = GYRO.start - ATT.stop
_STATE_ACCEL: Final = ACCEL.start - ATT.stop


@compiled
def rotated(quat: Quat, x: float, y: float, z: float) -> tuple[float, float, float]:
    w, i, j, k = quat
    _, x, y, z = times(times(quat, (0.0, x, y, z)), (w, -i, -j, -k))
    return x, y, z


@compiled
def length(values: Array, first: int) -> float:
    return math.sqrt(values[first] ** 2 + values[first + 1] ** 2 + values[first + 2] ** 2)


@compiled
def clamped(value: float, low: float, high: float) -> float:
    """Return the value within limits; ``low`` for what is not a number (inertial.limited)."""
    if not value >= low:
        return low
    return min(value, high)


@compiled
def sense(mem: Array, del_vel: Array, del_ang: Array, vel_dt: float, ang_dt: float) -> None:
    """Filter the data of a pass (Stillness.sense)."""
    for axis in range(3):
        if ang_dt > 0:
            mem[GYRO_FILTERED + axis] += _ALPHA * (del_ang[axis] / ang_dt - mem[GYRO_FILTERED + axis])
        if vel_dt > 0:
            mem[ACCEL_FILTERED + axis] += _ALPHA * (del_vel[axis] / vel_dt - mem[ACCEL_FILTERED + axis])


@compiled
def smoothed(mem: Array, filtered: int, before: int, diff: int, bias: int) -> float:
    """Follow how fast a rate without its bias changes; return how large it is."""
    size = change = 0.0
    for axis in range(3):
        rate = mem[filtered + axis] - mem[bias + axis]
        change += (rate - mem[before + axis]) ** 2
        size += rate**2
        mem[before + axis] = rate
    mem[diff] += _SLOW_TEST * (math.sqrt(change) / mem[DT_EKF_AVG] - mem[diff])
    return math.sqrt(size)


@compiled
def test(mem: Array, known: int, scale: float) -> int:
    """Test for standing still (Stillness.test); return what is known now."""
    gyro = smoothed(mem, GYRO_FILTERED, GYRO_BEFORE, GYRO_DIFF, BIAS_RATES)
    accel = smoothed(mem, ACCEL_FILTERED, ACCEL_BEFORE, ACCEL_DIFF, BIAS_RATES + 3)
    if not known & HAS_BEFORE:
        mem[GYRO_DIFF], mem[ACCEL_DIFF] = GYRO_DIFF_LIMIT, ACCEL_DIFF_LIMIT
        return (known | HAS_BEFORE) & ~IS_STILL
    mem[RATIOS] = gyro / GYRO_LIMIT
    mem[RATIOS + 1] = (accel - GRAVITY_MSS) / ACCEL_LIMIT
    mem[RATIOS + 2] = mem[GYRO_DIFF] / GYRO_DIFF_LIMIT
    mem[RATIOS + 3] = mem[ACCEL_DIFF] / ACCEL_DIFF_LIMIT
    worst = max(mem[RATIOS], abs(mem[RATIOS + 1]), mem[RATIOS + 2], mem[RATIOS + 3])
    is_still = worst <= scale if known & IS_STILL else worst < scale * HYSTERESIS
    return HAS_BEFORE | HAS_RATIOS | (IS_STILL if is_still else 0)


@compiled
def add(mem: Array, del_vel: Array, del_ang: Array, vel_dt: float, ang_dt: float, may_step: bool) -> bool:
    """Add up the data of a pass (DownSampler.add); say whether a step is complete, which is then at ``STEP``."""
    mem[ANG_DT] += max(ang_dt, MIN_DT)
    mem[VEL_DT] += max(vel_dt, MIN_DT)
    before = mem[TURNED], mem[TURNED + 1], mem[TURNED + 2], mem[TURNED + 3]
    turn = turned_by(before, del_ang[0] * 0.5, del_ang[1] * 0.5, del_ang[2] * 0.5)
    mem[TURNED], mem[TURNED + 1], mem[TURNED + 2], mem[TURNED + 3] = turn
    x, y, z = rotated(turn, del_vel[0], del_vel[1], del_vel[2])
    mem[DEL_VEL] += x
    mem[DEL_VEL + 1] += y
    mem[DEL_VEL + 2] += z
    if mem[ANG_DT] < (DUE_DT if may_step else LATE_DT):
        return False
    complete(mem)
    return True


@compiled
def complete(mem: Array) -> None:
    for axis in range(3):
        mem[STEP + axis] = mem[DEL_VEL + axis]
        mem[DEL_VEL + axis] = 0.0
    set_rotation_vector(mem, STEP + 3, TURNED)
    mem[STEP + 6], mem[STEP + 7] = mem[VEL_DT], mem[ANG_DT]
    dt_ekf = mem[DT_EKF_AVG]
    interval = clamped(0.5 * (mem[ANG_DT] + mem[VEL_DT]), 0.5 * dt_ekf, 2 * dt_ekf)
    mem[DT_EKF_AVG] += _SLOW_SAMPLING * (interval - dt_ekf)
    mem[VEL_DT] = mem[ANG_DT] = 0.0
    mem[TURNED], mem[TURNED + 1], mem[TURNED + 2], mem[TURNED + 3] = 1.0, 0.0, 0.0, 0.0


@compiled
def set_rotation_vector(mem: Array, target: int, quat: int) -> None:
    """Write the rotation vector of a quaternion, the shorter way round (inertial.rotation_of_quat)."""
    sign = 1.0 if mem[quat] >= 0 else -1.0
    w, sine = sign * mem[quat], length(mem, quat + 1)
    scale = math.atan2(sine, w) / sine if sine > QUATERNION_EPS * abs(w) else 0.0
    for axis in range(3):
        mem[target + axis] = scale * (sign * mem[quat + 1 + axis]) * 2.0


@compiled
def integrate(
    mem: Array, del_vel: Array, del_ang: Array, vel_dt: float, ang_dt: float, states: Array, height_filter_hz: float
) -> None:
    """Move the output on by a pass (OutputPredictor.integrate)."""
    by_ang, by_vel = ang_dt / mem[DT_EKF_AVG], vel_dt / mem[DT_EKF_AVG]
    before = mem[NOW], mem[NOW + 1], mem[NOW + 2], mem[NOW + 3]
    x, y, z = mem[ANGLE_CORRECTION], mem[ANGLE_CORRECTION + 1], mem[ANGLE_CORRECTION + 2]
    quat = turned_by(
        before,
        (del_ang[0] - states[_STATE_GYRO] * by_ang + x) * 0.5,
        (del_ang[1] - states[_STATE_GYRO + 1] * by_ang + y) * 0.5,
        (del_ang[2] - states[_STATE_GYRO + 2] * by_ang + z) * 0.5,
    )
    mem[NOW], mem[NOW + 1], mem[NOW + 2], mem[NOW + 3] = quat
    x, y, z = rotated(
        quat,
        del_vel[0] - states[_STATE_ACCEL] * by_vel,
        del_vel[1] - states[_STATE_ACCEL + 1] * by_vel,
        del_vel[2] - states[_STATE_ACCEL + 2] * by_vel,
    )
    z += GRAVITY_MSS * vel_dt
    filter_height(mem, z, vel_dt, 2 * math.pi * clamped(height_filter_hz, 0.1, 30.0))
    move(mem, 0, x, vel_dt)
    move(mem, 1, y, vel_dt)
    move(mem, 2, z, vel_dt)


@compiled
def move(mem: Array, axis: int, del_vel: float, dt: float) -> None:
    before = mem[NOW + 4 + axis]
    vel = mem[NOW + 4 + axis] = before + del_vel
    mem[NOW + 7 + axis] += (vel + before) * (0.5 * dt)


@compiled
def filter_height(mem: Array, del_vel_down: float, dt: float, omega: float) -> None:
    error = clamped(mem[NOW + 9] - mem[FILTERED_DOWN], -1e5, 1e5)
    mem[FILTERED_ACCEL] += error * omega**3 * dt
    mem[HEIGHT_RATE] += del_vel_down + (mem[FILTERED_ACCEL] + error * omega**2 * 3) * dt
    mem[FILTERED_DOWN] += (mem[HEIGHT_RATE] + error * omega * 3) * dt


@compiled
def advance(
    mem: Array,
    del_vel: Array,
    del_ang: Array,
    vel_dt: float,
    ang_dt: float,
    states: Array,
    known: int,
    is_tested: bool,
    scale: float,
    height_filter_hz: float,
    may_step: bool,
) -> int:
    """Take the data of a pass (InertialPass.advance); return what is known, and whether a step is due."""
    sense(mem, del_vel, del_ang, vel_dt, ang_dt)
    known = test(mem, known, scale) if is_tested else 0
    if add(mem, del_vel, del_ang, vel_dt, ang_dt, may_step):
        return known | IS_STEP
    integrate(mem, del_vel, del_ang, vel_dt, ang_dt, states, height_filter_hz)
    return known


@compiled
def advance_all(
    mem: Array,
    rows: Array,
    states: Array,
    known: int,
    is_tested: bool,
    scale: float,
    height_filter_hz: float,
    count: int,
) -> tuple[int, int]:
    """Take the data of several passes (InertialPass.advance_all); return of how many, and what is known."""
    after = known
    for row in range(count):
        del_vel, del_ang, vel_dt, ang_dt = rows[row, :3], rows[row, 3:6], rows[row, 6], rows[row, 7]
        after = advance(mem, del_vel, del_ang, vel_dt, ang_dt, states, known, is_tested, scale, height_filter_hz, True)
        if after != known:
            return row + 1, after
    return count, after


@compiled
def follow(
    mem: Array,
    history: Array,
    del_vel: Array,
    del_ang: Array,
    vel_dt: float,
    ang_dt: float,
    state_quat: Quat,
    states: Array,
    delay_s: float,
    tau_s: float,
    height_filter_hz: float,
    accel_is_bad: bool,
) -> None:
    """Move the output on by the pass of a step, and steer it towards the filter (OutputPredictor.follow)."""
    for axis in range(3):
        mem[BIAS_RATES + axis] = states[_STATE_GYRO + axis] / mem[DT_EKF_AVG]
        mem[BIAS_RATES + 3 + axis] = states[_STATE_ACCEL + axis] / mem[DT_EKF_AVG]
    integrate(mem, del_vel, del_ang, vel_dt, ang_dt, states, height_filter_hz)
    head = int(mem[HEAD])
    history[head] = mem[NOW : NOW + OUTPUT_SIZE]
    head = (head + 1) % len(history)
    mem[HEAD] = head
    delayed, dt_ekf = history[head], mem[DT_EKF_AVG]
    w, x, y, z = times((delayed[0], -delayed[1], -delayed[2], -delayed[3]), state_quat)
    w, x, y, z = normalized(w, x, y, z)
    mem[ANGLE_ERROR], mem[ANGLE_ERROR + 1], mem[ANGLE_ERROR + 2] = x, y, z
    attitude_gain = ATTITUDE_GAIN / max(delay_s, LOOP_DT) * LOOP_DT
    if w < 0:
        attitude_gain = -attitude_gain
    for axis in range(3):
        mem[ANGLE_CORRECTION + axis] = 2 * mem[ANGLE_ERROR + axis] * attitude_gain
    gain = dt_ekf / clamped(tau_s, dt_ekf, 10.0)
    for axis in range(3):
        mem[VEL_ERROR + axis] = states[_STATE_VEL + axis] - delayed[4 + axis]
        mem[POS_ERROR + axis] = states[_STATE_POS + axis] - delayed[7 + axis]
    for axis in range(3):
        is_bad = axis == 2 and accel_is_bad
        counted = states[_STATE_VEL + axis] - mem[NOW + 4 + axis] if is_bad else mem[VEL_ERROR + axis]
        by_integral = BAD_ACCEL_INTEGRAL_GAIN if is_bad else INTEGRAL_GAIN
        steer(mem, history, 4 + axis, mem[VEL_ERROR + axis], counted, VEL_INTEGRAL + axis, gain, by_integral)
        pos_error = mem[POS_ERROR + axis]
        steer(mem, history, 7 + axis, pos_error, pos_error, POS_INTEGRAL + axis, gain, INTEGRAL_GAIN)


@compiled
def steer(
    mem: Array,
    history: Array,
    column: int,
    error: float,
    counted: float,
    integral: int,
    gain: float,
    by_integral: float,
) -> None:
    """Move one number of all the history, and the present one, by what is wrong with it, now and all in all."""
    mem[integral] += counted
    shift = error * gain + mem[integral] * (by_integral * gain * gain)
    for row in range(len(history)):
        history[row, column] += shift
    mem[NOW + column] += shift
