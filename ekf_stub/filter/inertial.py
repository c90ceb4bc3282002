# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data: what comes each pass of the main loop, and the steps of the filter that it adds up to.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readIMUData).

What runs at 400 Hz has its vectors as pure quaternions: to add two or to turn one takes numpy-quaternion 0.1 us, where
an array of three takes 0.3 us and 5 us (1.3 us for the product, 4 us for the matrix).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.reports.core_report import Three

Array = npt.NDArray[np.float64]

EKF_TARGET_DT: Final = 0.012
LOOP_DT: Final = 0.0025  # of the main loop, in which the firmware's average of it settles
GRAVITY_MSS: Final = 9.80665
MIN_DT: Final = 1e-4
MAX_DT: Final = 1.0
MAX_DEL_VEL: Final = 100.0
MAX_DEL_ANG: Final = 10.0
DUE_DT: Final = EKF_TARGET_DT - 0.5 * LOOP_DT  # of a step; and of one that may not be made yet
LATE_DT: Final = 2.0 * EKF_TARGET_DT
_SLOW: Final = 0.02  # weight of the newest interval in an average


# Not frozen, as none is ever changed and to make a frozen one takes three times as long.
@dataclass
class InertialDelta:
    """What an IMU has measured since the last pass: m/s (specific force, gravity included) and rad, body (FRD).

    ``del_vel_dt`` and ``del_ang_dt`` are the seconds over which each was measured. What a pass works out of them it
    works out once: several parts of the filter ask for it.
    """

    del_vel: Array
    del_ang: Array
    del_vel_dt: float
    del_ang_dt: float

    @cached_property
    def pure_vel(self) -> quaternion.quaternion:
        """``del_vel`` as a pure quaternion."""
        return pure_quat(self.del_vel)

    @cached_property
    def pure_ang(self) -> quaternion.quaternion:
        """``del_ang`` as a pure quaternion."""
        return pure_quat(self.del_ang)

    @cached_property
    def turn(self) -> quaternion.quaternion:
        """The rotation as a quaternion."""
        return quat_of_rotation(self.del_ang)

    @cached_property
    def accel(self) -> Three | None:
        """Specific force in m/s/s, None for no interval."""
        return _rate(self.del_vel, self.del_vel_dt)

    @cached_property
    def gyro(self) -> Three | None:
        """Body rates in rad/s, None for no interval."""
        return _rate(self.del_ang, self.del_ang_dt)

    @cached_property
    def is_sound(self) -> bool:
        """Whether it is finite, and no more than a vehicle survives."""
        return is_sound(self)


class InertialStep(NamedTuple):
    """Inertial data of one step of the filter; ``time_ms`` is that of its end."""

    time_ms: int
    del_vel: Array
    del_ang: Array
    del_vel_dt: float
    del_ang_dt: float


def _rate(delta: Array, dt: float) -> Three | None:
    x, y, z = delta.tolist()
    return (x / dt, y / dt, z / dt) if dt > 0 else None


def limited(value: float, low: float, high: float) -> float:
    """Return the value, not below ``low`` nor above ``high``; ``low`` for what is not a number."""
    if high < value:  # as max(low, min(value, high)), in half the time
        value = high
    return value if value > low else low


def pure_quat(vector: Array) -> quaternion.quaternion:
    """Return a vector as a quaternion without a real part."""
    return quaternion.quaternion(0.0, *vector.tolist())


def quat_of_rotation(vector: Array) -> quaternion.quaternion:
    """Return the quaternion of a rotation vector in rad."""
    return (pure_quat(vector) * 0.5).exp()


def rotation_of_quat(quat: quaternion.quaternion) -> Array:
    """Return the rotation vector of a quaternion, rad, the shorter way round."""
    shorter = quat if quat.w >= 0 else -quat
    rotation: Array = (shorter.log() * 2.0).vec
    return rotation


def is_sound(inertial: InertialDelta | InertialStep) -> bool:
    """Return whether inertial data is finite, and no more than a vehicle survives."""
    vel_x, vel_y, vel_z = inertial.del_vel.tolist()
    ang_x, ang_y, ang_z = inertial.del_ang.tolist()
    return (
        abs(vel_x) + abs(vel_y) + abs(vel_z) <= MAX_DEL_VEL
        and abs(ang_x) + abs(ang_y) + abs(ang_z) <= MAX_DEL_ANG
        and 0.0 <= inertial.del_vel_dt <= MAX_DT
        and 0.0 <= inertial.del_ang_dt <= MAX_DT
    )


def row_of(delta: InertialDelta) -> Array:
    """Return inertial data as eight numbers: change of velocity, rotation, and the seconds of either."""
    return np.array((*delta.del_vel.tolist(), *delta.del_ang.tolist(), delta.del_vel_dt, delta.del_ang_dt))


def delta_of(row: Array) -> InertialDelta:
    """Return the inertial data that eight numbers are."""
    return InertialDelta(row[:3], row[3:6], row.item(6), row.item(7))


def are_usable(rows: Array) -> npt.NDArray[np.bool_]:
    """Tell of rows of inertial data which are sound, and of intervals that are long enough."""
    sizes, dt = np.abs(rows[:, :6]), rows[:, 6:]
    vel, ang = sizes[:, 0] + sizes[:, 1] + sizes[:, 2], sizes[:, 3] + sizes[:, 4] + sizes[:, 5]
    usable: npt.NDArray[np.bool_] = (vel <= MAX_DEL_VEL) & (ang <= MAX_DEL_ANG)
    return usable & ((dt >= MIN_DT) & (dt <= MAX_DT)).all(axis=1)


class InertialGuard:
    """Keeps unsound inertial data from the filter, which goes on with what was last sound; level rest at first.

    ``refused`` tells in how many passes it did, ``newest`` is what was last sound.
    """

    def __init__(self) -> None:
        rest = np.array([0.0, 0.0, -GRAVITY_MSS * LOOP_DT])
        self.newest = InertialDelta(rest, np.zeros(3), LOOP_DT, LOOP_DT)
        self.refused = 0

    def sound(self, delta: InertialDelta) -> InertialDelta:
        """Return the data of a pass, or what stands in for it."""
        if delta.is_sound:
            self.newest = delta
        else:
            self.refused += 1
        return self.newest


class DownSampler:
    """Adds up sound inertial data until a step of the filter is due: 12 ms, give or take half a pass; at most 24 ms.

    ``dt_ekf_avg`` is the average interval of the steps, s.
    """

    def __init__(self) -> None:
        self.dt_ekf_avg = EKF_TARGET_DT
        self._clear()

    def _clear(self) -> None:
        self._turned = quaternion.one
        self._del_vel = quaternion.zero
        self._vel_dt = self._ang_dt = 0.0

    def add(self, delta: InertialDelta, time_ms: int, *, may_step: bool = True) -> InertialStep | None:
        """Take the data of a pass; return the step that it completes, if it does.

        Velocities are summed in the body frame at the end of each pass, rotations as quaternions, against coning.
        A step that may not be made yet waits.
        """
        vel_dt, ang_dt = delta.del_vel_dt, delta.del_ang_dt
        self._vel_dt += vel_dt if vel_dt > MIN_DT else MIN_DT
        ang_dt = self._ang_dt = self._ang_dt + (ang_dt if ang_dt > MIN_DT else MIN_DT)
        turned = self._turned = (self._turned * delta.turn).normalized()
        self._del_vel += turned * delta.pure_vel * turned.conjugate()
        return self._complete(time_ms) if ang_dt >= (DUE_DT if may_step else LATE_DT) else None

    def _complete(self, time_ms: int) -> InertialStep:
        step = InertialStep(time_ms, self._del_vel.vec, rotation_of_quat(self._turned), self._vel_dt, self._ang_dt)
        interval = limited(0.5 * (self._ang_dt + self._vel_dt), 0.5 * self.dt_ekf_avg, 2 * self.dt_ekf_avg)
        self.dt_ekf_avg += _SLOW * (interval - self.dt_ekf_avg)
        self._clear()
        return step
