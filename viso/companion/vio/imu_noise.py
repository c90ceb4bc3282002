# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How noisy an IMU is."""

import dataclasses
import math


@dataclasses.dataclass(frozen=True, slots=True)
class ImuNoise:
    """The four densities of an IMU's noise, the same for all axes.

    Attributes:
        gyro: white noise of the rotation rate in rad/s/sqrt(Hz).
        accel: white noise of the specific force in m/s^2/sqrt(Hz).
        gyro_walk: random walk of the gyro bias in rad/s^2/sqrt(Hz).
        accel_walk: random walk of the accelerometer bias in m/s^3/sqrt(Hz).

    Raises:
        ValueError: if one is not positive and finite; names the field.
    """

    gyro: float = 1.7e-3
    accel: float = 2e-2
    gyro_walk: float = 2e-5
    accel_walk: float = 1e-3

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            density = getattr(self, field.name)
            if not (density > 0 and math.isfinite(density)):
                raise ValueError(f"{field.name}: not positive and finite")
