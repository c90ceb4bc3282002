# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The biases of the IMUs that a core does not use, so that it can go over to one of them without a jump.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readIMUData, learnInactiveBiases).
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array, InertialStep, limited
from ekf_stub.reports.core_report import Three

GAIN: Final = float(np.float32(1e-4))
MAX_GYRO_ERROR: Final = math.radians(5.0)
MAX_ACCEL_ERROR: Final = 1.0


class ImuRates(NamedTuple):
    """What all IMUs say in a frame.

    ``gyro`` and ``accel`` are the numbers of the sensors that a core uses, ``gyros`` and ``accels`` what each IMU
    measures: rad/s and m/s/s, body, filtered at 10 Hz, None for a sensor that is not to be used.
    """

    gyro: int
    accel: int
    gyros: Sequence[Three | None]
    accels: Sequence[Three | None]


class _Biases:
    """Those of the gyros, or of the accelerometers; each as long as a step of the filter lasts.

    Args:
        active: the sensor in use.
        max_error: by how much more than that sensor another may be off for it to count, a second.
    """

    def __init__(self, active: int, max_error: float) -> None:
        self._active = active
        self._max_error = max_error
        self._biases: dict[int, Three] = {}

    def switch(self, active: int) -> tuple[Three, Three] | None:
        """Go over to a sensor; return the biases of that before and of this one, None when they are the same."""
        before, self._active = self._active, active
        if active == before:
            return None
        none = (0.0, 0.0, 0.0)
        return self._biases.get(before, none), self._biases.get(active, none)

    def learn(self, bias: Three, rates: Sequence[Three | None], dt_ekf_avg: float) -> None:
        """Draw the bias of each other sensor to where it measures what the one in use does."""
        used = rates[self._active] if self._active < len(rates) else None
        gain, limit = GAIN * dt_ekf_avg, self._max_error
        for sensor, rate in enumerate(rates):
            if rate is None:
                continue
            if sensor == self._active:
                self._biases[sensor] = bias
            elif used is not None:
                its = self._biases.get(sensor, (0.0, 0.0, 0.0))
                x, y, z = (
                    old - gain * limited((mine - own / dt_ekf_avg) - (other - old / dt_ekf_avg), -limit, limit)
                    for mine, own, other, old in zip(used, bias, rate, its, strict=True)
                )
                self._biases[sensor] = x, y, z


class InactiveBiases:
    """The biases of all IMUs as one core knows them, which uses the data of ``imu`` at first."""

    def __init__(self, imu: int) -> None:
        self._gyros, self._accels = _Biases(imu, MAX_GYRO_ERROR), _Biases(imu, MAX_ACCEL_ERROR)

    def update(self, rates: ImuRates, state: ErrorState, dt_ekf_avg: float) -> tuple[Array, Array] | None:
        """Give the state the biases of the sensors in use, and learn those of the others.

        Returns by how much the biases of gyro and accelerometer have changed with the sensors; None when the core uses
        those that it has used.
        """
        changes = [np.zeros(3), np.zeros(3)]
        gyros, accels = self._gyros.switch(rates.gyro), self._accels.switch(rates.accel)
        if gyros is not None:
            state.gyro_bias = np.array(gyros[1])
            changes[0] = np.subtract(gyros[1], gyros[0])
        if accels is not None:
            state.accel_bias = np.array(accels[1])
            changes[1] = np.subtract(accels[1], accels[0])
        gyro_bias, accel_bias = state.gyro_bias.tolist(), state.accel_bias.tolist()
        self._gyros.learn(gyro_bias, rates.gyros, dt_ekf_avg)
        self._accels.learn(accel_bias, rates.accels, dt_ekf_avg)
        return None if gyros is None and accels is None else (changes[0], changes[1])


def with_biases(step: InertialStep, gyro: Array, accel: Array, dt_ekf_avg: float) -> InertialStep:
    """Return a step of other sensors, so that the biases of those in use, larger by so much, correct it."""
    return step._replace(
        del_ang=step.del_ang + gyro * (step.del_ang_dt / dt_ekf_avg),
        del_vel=step.del_vel + accel * (step.del_vel_dt / dt_ekf_avg),
    )
