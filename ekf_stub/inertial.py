# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data: what comes each pass of the main loop, and the steps of the filter that it adds up to.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readIMUData).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import quaternion

Array = npt.NDArray[np.float64]

EKF_TARGET_DT: Final = 0.012
INITIAL_IMU_DT: Final = 0.0025
_MIN_DT: Final = 1e-4
_SLOW: Final = 0.02  # weight of the newest interval in an average


@dataclass(frozen=True, slots=True)
class InertialDelta:
    """What an IMU has measured since the last pass: m/s (specific force, gravity included) and rad, body (FRD).

    ``del_vel_dt`` and ``del_ang_dt`` are the seconds over which each was measured.
    """

    del_vel: Array
    del_ang: Array
    del_vel_dt: float
    del_ang_dt: float


@dataclass(frozen=True, slots=True)
class InertialStep:
    """Inertial data of one step of the filter; ``time_ms`` is that of its end."""

    time_ms: int
    del_vel: Array
    del_ang: Array
    del_vel_dt: float
    del_ang_dt: float


def limited(value: float, low: float, high: float) -> float:
    """Return the value, not below ``low`` nor above ``high``."""
    return max(low, min(value, high))


def quat_of_rotation(vector: Array) -> quaternion.quaternion:
    """Return the quaternion of a rotation vector in rad."""
    return np.exp(quaternion.quaternion(0.0, *(0.5 * vector)))


def rotation_of_quat(quat: quaternion.quaternion) -> Array:
    """Return the rotation vector of a quaternion, rad, the shorter way round."""
    shorter = quat if quat.w >= 0 else -quat
    rotation: Array = quaternion.as_rotation_vector(shorter)
    return rotation


class DownSampler:
    """Adds up inertial data until a step of the filter is due: 12 ms, give or take half a pass.

    Attributes:
        dt_imu_avg: average interval of the main loop, s.
        dt_ekf_avg: average interval of the steps, s.
    """

    def __init__(self) -> None:
        self.dt_imu_avg = INITIAL_IMU_DT
        self.dt_ekf_avg = EKF_TARGET_DT
        self._clear()

    def _clear(self) -> None:
        self._turned = quaternion.one
        self._del_vel: Array = np.zeros(3)
        self._vel_dt = self._ang_dt = 0.0

    def add(self, delta: InertialDelta, loop_dt: float, time_ms: int) -> InertialStep | None:
        """Take the data of a pass; return the step that it completes, if it does.

        Velocities are summed in the body frame at the end of each pass, rotations as quaternions, against coning.
        """
        self.dt_imu_avg += _SLOW * (limited(loop_dt, 0.5 * self.dt_imu_avg, 2 * self.dt_imu_avg) - self.dt_imu_avg)
        self._ang_dt += max(delta.del_ang_dt, _MIN_DT)
        self._vel_dt += max(delta.del_vel_dt, _MIN_DT)
        self._turned = (self._turned * quat_of_rotation(delta.del_ang)).normalized()
        self._del_vel = self._del_vel + quaternion.as_rotation_matrix(self._turned) @ delta.del_vel
        if self._ang_dt < EKF_TARGET_DT - 0.5 * self.dt_imu_avg:
            return None
        step = InertialStep(time_ms, self._del_vel, rotation_of_quat(self._turned), self._vel_dt, self._ang_dt)
        interval = limited(0.5 * (self._ang_dt + self._vel_dt), 0.5 * self.dt_ekf_avg, 2 * self.dt_ekf_avg)
        self.dt_ekf_avg += _SLOW * (interval - self.dt_ekf_avg)
        self._clear()
        return step
