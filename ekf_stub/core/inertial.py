# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data: what comes in a pass of the main loop, the steps of the filter that it adds up to, and stillness.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readIMUData, updateMovementCheck).
"""

import math
from typing import Final, final

from ekf_stub.core.vectors import (
    ONE,
    ZERO,
    Quat,
    Vec3,
    add,
    larger,
    length,
    limited,
    rotated,
    rotation_vector,
    sub,
    turned,
)

EKF_TARGET_DT: Final = 0.012000000104308128
LOOP_DT: Final = 0.0025  # of the main loop, in which the firmware's average of it settles
GRAVITY_MSS: Final = 9.80665
MIN_DT: Final = 1e-4
_MAX_DT: Final = 1.0
_MAX_DEL_VEL: Final = 100.0
_MAX_DEL_ANG: Final = 10.0
_DUE_DT: Final = 0.012 - 0.5 * 0.0025  # of a step
_LATE_DT: Final = 2.0 * 0.012  # of a step for which there was no time before
# float32 of 0.98 and 0.02, which are together more than 1.
_AVERAGE_KEPT: Final = 0.9800000190734863
_AVERAGE_SHARE: Final = 0.019999999552965164


@final
class Inertial:
    """Inertial data of a pass or of a step.

    Attributes:
        del_vel: change of velocity by specific force, gravity included, m/s, body (FRD).
        del_ang: rotation, rad, body.
        del_vel_dt, del_ang_dt: the seconds over which each was measured.
        time_ms: of its end, since boot; of a step only.
        gyro, accel: of a step, the numbers of its sensors.
    """

    def __init__(self, del_vel: Vec3, del_ang: Vec3, del_vel_dt: float, del_ang_dt: float, time_ms: int = 0) -> None:
        self.del_vel = del_vel
        self.del_ang = del_ang
        self.del_vel_dt = del_vel_dt
        self.del_ang_dt = del_ang_dt
        self.time_ms = time_ms
        self.gyro = 0
        self.accel = 0

    def is_sound(self) -> bool:
        """Return whether it is finite, and no more than a vehicle survives."""
        vx, vy, vz = self.del_vel
        x, y, z = self.del_ang
        return (
            abs(vx) + abs(vy) + abs(vz) <= _MAX_DEL_VEL
            and abs(x) + abs(y) + abs(z) <= _MAX_DEL_ANG
            and 0.0 <= self.del_vel_dt <= _MAX_DT
            and 0.0 <= self.del_ang_dt <= _MAX_DT
        )

    def at_least(self, dt: float) -> "Inertial":
        """Return it with intervals of no less than some seconds."""
        if self.del_vel_dt >= dt and self.del_ang_dt >= dt:
            return self
        longer = Inertial(
            self.del_vel, self.del_ang, larger(self.del_vel_dt, dt), larger(self.del_ang_dt, dt), self.time_ms
        )
        longer.gyro, longer.accel = self.gyro, self.accel
        return longer


@final
class DownSampler:
    """Adds up sound inertial data until a step of the filter is due: 12 ms, give or take half a pass; at most 24 ms.

    ``dt_ekf_avg`` is the average interval of the steps, s.
    """

    def __init__(self) -> None:
        self._turned: Quat = ONE
        self.restart()

    def restart(self) -> None:
        """Restart the step, as the filter restarts.

        FIRMWARE PARITY: the rotation since the last step is kept (NavEKF3_core::InitialiseVariables).
        """
        self.dt_ekf_avg = EKF_TARGET_DT
        self._clear_sums()

    def _clear_sums(self) -> None:
        self._del_vel: Vec3 = ZERO
        self._vel_dt = 0.0
        self._ang_dt = 0.0

    def add(self, delta: Inertial, time_ms: int, may_step: bool) -> Inertial | None:
        """Take the data of a pass; return the step that it completes, if it does.

        Velocities are summed in the body frame at the end of each pass, rotations as quaternions, against coning.
        A step that may not be made yet waits.
        """
        self._vel_dt += larger(delta.del_vel_dt, MIN_DT)
        self._ang_dt += larger(delta.del_ang_dt, MIN_DT)
        self._turned = turned(self._turned, delta.del_ang)
        self._del_vel = add(self._del_vel, rotated(self._turned, delta.del_vel))
        if self._ang_dt < (_DUE_DT if may_step else _LATE_DT):
            return None
        step = Inertial(self._del_vel, rotation_vector(self._turned), self._vel_dt, self._ang_dt, time_ms)
        dt = self.dt_ekf_avg
        interval = limited(0.5 * (self._ang_dt + self._vel_dt), 0.5 * dt, 2 * dt)
        self.dt_ekf_avg = _AVERAGE_KEPT * dt + _AVERAGE_SHARE * interval
        self._turned = ONE
        self._clear_sums()
        return step


# Whether the vehicle stands still

_GYRO_LIMIT: Final = math.radians(3.0)
_GYRO_DIFF_LIMIT: Final = 0.2
_ACCEL_LIMIT: Final = 1.0
_ACCEL_DIFF_LIMIT: Final = 5.0
_HYSTERESIS: Final = 0.7
_DIFF_SHARE: Final = 0.01
_CUTOFF_HZ: Final = 10.0


def filter_share(loop_dt: float) -> float:
    """Return the weight of a new rate in the filter of 10 Hz that AP_DAL_InertialSensor has."""
    return loop_dt / (loop_dt + 1.0 / (2.0 * math.pi * _CUTOFF_HZ))


def filtered(before: Vec3, delta: Vec3, dt: float, share: float) -> Vec3:
    """Return a filtered rate after a change over some seconds."""
    x, y, z = before
    return x + share * (delta[0] / dt - x), y + share * (delta[1] / dt - y), z + share * (delta[2] / dt - z)


@final
class Stillness:
    """The test for standing still on the ground, once a pass (updateMovementCheck).

    Attributes:
        is_still: the vehicle stands still on the ground, as far as is known.
        is_tested: the test runs, so that its answer counts.
        gyro, accel: rad/s and m/s/s, body, filtered at 10 Hz.
        gyro_length_ratio, accel_length_ratio, gyro_diff_ratio, accel_diff_ratio: what the last test measured over its
            limits: the lengths of turn rate and acceleration, and how fast both change.
    """

    def __init__(self) -> None:
        self.gyro: Vec3 = ZERO
        self.accel: Vec3 = ZERO
        self._share = filter_share(LOOP_DT)
        self.reset()

    def reset(self) -> None:
        """Restart the test; the filters go on."""
        self.is_still = False
        self.is_tested = False
        # In the firmware there was a rate of 0 before the first, so that the vehicle seems to move for a while.
        self._has_before = True
        self._gyro_before: Vec3 = ZERO
        self._accel_before: Vec3 = ZERO
        self._gyro_diff = 0.0
        self._accel_diff = 0.0
        self.gyro_length_ratio = 0.0
        self.accel_length_ratio = 0.0
        self.gyro_diff_ratio = 0.0
        self.accel_diff_ratio = 0.0

    def sense(self, delta: Inertial) -> None:
        """Filter the data of a pass."""
        if delta.del_ang_dt > 0:
            self.gyro = filtered(self.gyro, delta.del_ang, delta.del_ang_dt, self._share)
        if delta.del_vel_dt > 0:
            self.accel = filtered(self.accel, delta.del_vel, delta.del_vel_dt, self._share)

    def skip(self) -> None:
        """Let the test rest, in flight or with a compass."""
        self.is_still = False
        self.is_tested = False
        self._has_before = False

    def test(self, gyro_bias: Vec3, accel_bias: Vec3, dt_ekf_avg: float, scale: float) -> None:
        """Test again; biases are in rad/s and m/s/s, ``scale`` is that of all limits (EK3_OGNM_TEST_SF)."""
        gyro, accel = sub(self.gyro, gyro_bias), sub(self.accel, accel_bias)
        if not self._has_before:
            self._has_before = True
            self._gyro_before, self._accel_before = gyro, accel
            self._gyro_diff, self._accel_diff = _GYRO_DIFF_LIMIT, _ACCEL_DIFF_LIMIT
            self.is_still = False
            return
        self._gyro_diff += _DIFF_SHARE * (length(sub(gyro, self._gyro_before)) / dt_ekf_avg - self._gyro_diff)
        self._accel_diff += _DIFF_SHARE * (length(sub(accel, self._accel_before)) / dt_ekf_avg - self._accel_diff)
        self._gyro_before, self._accel_before = gyro, accel
        self.is_tested = True
        self.gyro_length_ratio = length(gyro) / _GYRO_LIMIT
        self.accel_length_ratio = (length(accel) - GRAVITY_MSS) / _ACCEL_LIMIT
        self.gyro_diff_ratio = self._gyro_diff / _GYRO_DIFF_LIMIT
        self.accel_diff_ratio = self._accel_diff / _ACCEL_DIFF_LIMIT
        worst = larger(
            larger(self.gyro_length_ratio, abs(self.accel_length_ratio)),
            larger(self.gyro_diff_ratio, self.accel_diff_ratio),
        )
        self.is_still = worst <= scale if self.is_still else worst < scale * _HYSTERESIS
