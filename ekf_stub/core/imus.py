# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each of several IMUs says, which of them a core uses, and the biases of those that it does not use.

Source: AP_DAL/AP_DAL_InertialSensor.cpp; AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readIMUData, learnInactiveBiases).
"""

import math
from typing import Final, final

from ekf_stub.core.inertial import LOOP_DT, Inertial, filter_share, filtered
from ekf_stub.core.state import State
from ekf_stub.core.vectors import ZERO, Vec3, add, limited, scaled, sub

MAX_IMUS: Final = 3
TIME_COLUMNS: Final = 3  # of a row: time since boot in us, time flying in ms, a bit for each core that is late
IMU_COLUMNS: Final = 8  # and of each IMU: change of velocity (3), rotation (3), and the seconds of either


@final
class Imu:
    """One IMU.

    Attributes:
        has_data: whether it has ever said anything; whoever hands in rows sets it.
        has_gyro, has_accel: whether gyro and accelerometer may be used.
        del_vel, del_ang, del_vel_dt, del_ang_dt: its data of the last pass, see ``Inertial``.
        gyro, accel: rates, rad/s and m/s/s, filtered at 10 Hz.
    """

    def __init__(self) -> None:
        self.has_data = False
        self.has_gyro = True
        self.has_accel = True
        self.del_vel: Vec3 = ZERO
        self.del_ang: Vec3 = ZERO
        self.del_vel_dt = 0.0
        self.del_ang_dt = 0.0
        self.gyro: Vec3 = ZERO
        self.accel: Vec3 = ZERO


@final
class Imus:
    """The IMUs, each as of the last pass.

    Attributes:
        imus: by number.
        first_gyro, first_accel: the first ones that may be used.
        loop_dt: of the main loop as the first row comes, s.
    """

    def __init__(self, count: int = 1) -> None:
        self.imus = [Imu() for _ in range(count)]
        self.first_gyro = 0
        self.first_accel = 0
        self.loop_dt = LOOP_DT
        self._share = 0.0

    def columns(self) -> int:
        """Return how long a row is."""
        return TIME_COLUMNS + IMU_COLUMNS * len(self.imus)

    def read(self, rows: list[float], at: int) -> None:
        """Take the row that begins at a place."""
        if self._share == 0.0:
            self._share = filter_share(self.loop_dt)
        share = self._share
        k = at + TIME_COLUMNS
        for imu in self.imus:
            if imu.has_data:
                imu.del_vel = rows[k], rows[k + 1], rows[k + 2]
                imu.del_ang = rows[k + 3], rows[k + 4], rows[k + 5]
                imu.del_vel_dt, imu.del_ang_dt = rows[k + 6], rows[k + 7]
                if imu.del_ang_dt > 0:
                    imu.gyro = filtered(imu.gyro, imu.del_ang, imu.del_ang_dt, share)
                if imu.del_vel_dt > 0:
                    imu.accel = filtered(imu.accel, imu.del_vel, imu.del_vel_dt, share)
            k += IMU_COLUMNS

    def are_several(self) -> bool:
        """Return whether more than one has data."""
        count = 0
        for imu in self.imus:
            if imu.has_data:
                count += 1
        return count > 1

    def gyro_of(self, imu: int) -> int:
        """Return the gyro that a core of an IMU uses: its own while that may be used, else the first one."""
        own = self._imu(imu)
        return imu if own is not None and own.has_data and own.has_gyro else self.first_gyro

    def accel_of(self, imu: int) -> int:
        """Return the accelerometer that a core of an IMU uses, likewise."""
        own = self._imu(imu)
        return imu if own is not None and own.has_data and own.has_accel else self.first_accel

    def _imu(self, imu: int) -> Imu | None:
        return self.imus[imu] if imu < len(self.imus) else None

    def has_data_of(self, imu: int) -> bool:
        """Return whether there are inertial data of a core of an IMU."""
        gyro, accel = self._imu(self.gyro_of(imu)), self._imu(self.accel_of(imu))
        return gyro is not None and gyro.has_data and accel is not None and accel.has_data

    def inertial_of(self, imu: int) -> Inertial:
        """Return the inertial data of a core of an IMU."""
        gyro, accel = self.imus[self.gyro_of(imu)], self.imus[self.accel_of(imu)]
        return Inertial(accel.del_vel, gyro.del_ang, accel.del_vel_dt, gyro.del_ang_dt)


_GAIN: Final = 9.999999747378752e-05  # float32 of 1e-4
_MAX_GYRO_ERROR: Final = math.radians(5.0)
_MAX_ACCEL_ERROR: Final = 1.0


@final
class InactiveBiases:
    """The biases of all IMUs as one core knows them, each as long as a step of the filter lasts.

    ``imu`` is the one that the core uses at first.
    """

    def __init__(self, imu: int) -> None:
        self.gyro = imu
        self.accel = imu
        self._gyro_biases = [ZERO] * MAX_IMUS
        self._accel_biases = [ZERO] * MAX_IMUS

    def update(self, imus: Imus, imu: int, state: State, dt_ekf_avg: float) -> None:
        """Give the state the biases of the sensors that a core of an IMU uses, and learn those of the others."""
        gyro, accel = imus.gyro_of(imu), imus.accel_of(imu)
        if gyro != self.gyro:
            state.set_gyro_bias(self._gyro_biases[gyro])
        if accel != self.accel:
            state.set_accel_bias(self._accel_biases[accel])
        self.gyro, self.accel = gyro, accel
        self._learn(imus, state, dt_ekf_avg)

    def _learn(self, imus: Imus, state: State, dt: float) -> None:
        """Draw the bias of each other sensor to where it measures what the one in use does."""
        used_gyro, used_accel = imus.imus[self.gyro], imus.imus[self.accel]
        for number, imu in enumerate(imus.imus):
            if not imu.has_data:
                continue
            if imu.has_gyro and number == self.gyro:
                self._gyro_biases[number] = state.gyro_bias
            elif imu.has_gyro and used_gyro.has_gyro and used_gyro.has_data:
                self._gyro_biases[number] = _drawn(
                    self._gyro_biases[number], imu.gyro, used_gyro.gyro, state.gyro_bias, dt, _MAX_GYRO_ERROR
                )
            if imu.has_accel and number == self.accel:
                self._accel_biases[number] = state.accel_bias
            elif imu.has_accel and used_accel.has_accel and used_accel.has_data:
                self._accel_biases[number] = _drawn(
                    self._accel_biases[number], imu.accel, used_accel.accel, state.accel_bias, dt, _MAX_ACCEL_ERROR
                )

    def corrected(self, step: Inertial, state: State, dt_ekf_avg: float) -> Inertial:
        """Return a step, if it is of other sensors, so that the state's biases correct it by theirs."""
        if step.gyro == self.gyro and step.accel == self.accel:
            return step
        del_ang, del_vel = step.del_ang, step.del_vel
        if step.gyro != self.gyro:
            change = sub(state.gyro_bias, self._gyro_biases[step.gyro])
            del_ang = add(del_ang, scaled(change, step.del_ang_dt / dt_ekf_avg))
        if step.accel != self.accel:
            change = sub(state.accel_bias, self._accel_biases[step.accel])
            del_vel = add(del_vel, scaled(change, step.del_vel_dt / dt_ekf_avg))
        return Inertial(del_vel, del_ang, step.del_vel_dt, step.del_ang_dt, step.time_ms)


def _drawn(bias: Vec3, rate: Vec3, used_rate: Vec3, used_bias: Vec3, dt: float, limit: float) -> Vec3:
    """Return the bias of a sensor drawn to where it measures the rate that another one does, without its bias."""
    apart = sub(sub(used_rate, scaled(used_bias, 1.0 / dt)), sub(rate, scaled(bias, 1.0 / dt)))
    gain = _GAIN * dt
    return (
        bias[0] - gain * limited(apart[0], -limit, limit),
        bias[1] - gain * limited(apart[1], -limit, limit),
        bias[2] - gain * limited(apart[2], -limit, limit),
    )
