# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data as sensors hand them in: what comes in each pass of the main loop."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(slots=True)
class InertialDelta:
    """What an IMU has measured since the last pass: m/s (specific force, gravity included) and rad, body (FRD).

    ``del_vel_dt`` and ``del_ang_dt`` are the seconds over which each was measured.
    """

    del_vel: Array
    del_ang: Array
    del_vel_dt: float
    del_ang_dt: float


def row_of(delta: InertialDelta) -> Array:
    """Return inertial data as eight numbers: change of velocity, rotation, and the seconds of either."""
    return np.array(numbers_of(delta))


def numbers_of(delta: InertialDelta) -> list[float]:
    """Return inertial data as eight numbers: change of velocity, rotation, and the seconds of either."""
    return [*delta.del_vel.tolist(), *delta.del_ang.tolist(), delta.del_vel_dt, delta.del_ang_dt]


class ImuReading(NamedTuple):
    """What an IMU says in a pass: its data, and whether gyro and accelerometer may be used."""

    delta: InertialDelta
    has_gyro: bool = True
    has_accel: bool = True


def first_usable(readings: tuple[ImuReading, ...]) -> tuple[int, int]:
    """Return the numbers of the first gyro and of the first accelerometer that may be used, 0 where none may."""
    gyro = next((imu for imu, reading in enumerate(readings) if reading.has_gyro), 0)
    return gyro, next((imu for imu, reading in enumerate(readings) if reading.has_accel), 0)
