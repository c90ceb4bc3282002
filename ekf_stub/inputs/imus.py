# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each of several IMUs says, and which of them a core uses.

Source: AP_DAL/AP_DAL_InertialSensor.cpp; AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readIMUData).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

from ekf_stub.filter.inactive_biases import ImuRates
from ekf_stub.filter.inertial import InertialDelta
from ekf_stub.filter.stillness import Filtered
from ekf_stub.reports.core_report import Three

MAX_IMUS: Final = 3


class ImuReading(NamedTuple):
    """What an IMU says in a pass: its data, and whether gyro and accelerometer may be used."""

    delta: InertialDelta
    has_gyro: bool = True
    has_accel: bool = True


def first_usable(readings: Sequence[ImuReading]) -> tuple[int, int]:
    """Return the numbers of the first gyro and of the first accelerometer that may be used, 0 where none may."""
    gyro = next((imu for imu, reading in enumerate(readings) if reading.has_gyro), 0)
    return gyro, next((imu for imu, reading in enumerate(readings) if reading.has_accel), 0)


class Imus:
    """The IMUs, each as it has spoken last.

    Attributes:
        readings: what they say, by number.
        first_gyro, first_accel: the first ones that may be used.
    """

    def __init__(self) -> None:
        self.readings: dict[int, ImuReading] = {}
        self.first_gyro = self.first_accel = 0
        self._filters = [(Filtered(), Filtered()) for _ in range(MAX_IMUS)]
        self._gyros: list[Three | None] = [None] * MAX_IMUS
        self._accels: list[Three | None] = [None] * MAX_IMUS

    def update(self, readings: Sequence[ImuReading], loop_dt: float) -> None:
        """Take what all of them say in a pass of ``loop_dt`` seconds; without readings all is as before."""
        self.readings.update(enumerate(readings))
        if readings:
            self.first_gyro, self.first_accel = first_usable(readings)
        self.filter_rates(loop_dt)

    def filter_rates(self, loop_dt: float) -> None:
        """Filter what they measure, once a pass of ``loop_dt`` seconds (update_filtered)."""
        for imu, (delta, has_gyro, has_accel) in self.readings.items():
            gyro, accel = self._filters[imu]
            gyro.add(delta.gyro, loop_dt)
            accel.add(delta.accel, loop_dt)
            self._gyros[imu] = gyro.value if has_gyro else None
            self._accels[imu] = accel.value if has_accel else None

    def gyro_of(self, imu: int) -> int:
        """Return the gyro that a core of an IMU uses: its own while that may be used, else the first one."""
        reading = self.readings.get(imu)
        return imu if reading is not None and reading.has_gyro else self.first_gyro

    def accel_of(self, imu: int) -> int:
        """Return the accelerometer that a core of an IMU uses, likewise."""
        reading = self.readings.get(imu)
        return imu if reading is not None and reading.has_accel else self.first_accel

    def has_data_of(self, imu: int) -> bool:
        """Return whether there are inertial data of a core of an IMU."""
        return {self.gyro_of(imu), self.accel_of(imu)} <= self.readings.keys()

    def delta_of(self, imu: int) -> InertialDelta:
        """Return the inertial data of a core of an IMU."""
        gyro, accel = self.readings[self.gyro_of(imu)].delta, self.readings[self.accel_of(imu)].delta
        return gyro if gyro is accel else replace(gyro, del_vel=accel.del_vel, del_vel_dt=accel.del_vel_dt)

    def rates_of(self, imu: int) -> ImuRates | None:
        """Return what all of them say to a core of one; None where there is but one."""
        if len(self.readings) < 2:
            return None
        return ImuRates(self.gyro_of(imu), self.accel_of(imu), self._gyros, self._accels)
