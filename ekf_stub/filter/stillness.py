# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Says whether the vehicle stands still on the ground (AP_NavEKF3_Measurements.cpp, updateMovementCheck).

Only asked while yaw comes from elsewhere than the compass.
"""

import math
from typing import Final

from ekf_stub.filter.inertial import GRAVITY_MSS, LOOP_DT, InertialDelta
from ekf_stub.reports.core_report import StillnessReport, Three

GYRO_LIMIT: Final = math.radians(3.0)
GYRO_DIFF_LIMIT: Final = 0.2
ACCEL_LIMIT: Final = 1.0
ACCEL_DIFF_LIMIT: Final = 5.0
HYSTERESIS: Final = 0.7
CUTOFF_HZ: Final = 10.0
_SLOW: Final = 0.01


class Filtered:
    """A vector through a filter of first order, as AP_DAL_InertialSensor has it."""

    def __init__(self) -> None:
        self.value: Three = (0.0, 0.0, 0.0)
        self._alpha = 0.0

    def add(self, rate: Three | None, loop_dt: float) -> None:
        """Add a measurement; None for none."""
        if not self._alpha:
            self._alpha = loop_dt / (loop_dt + 1.0 / (2.0 * math.pi * CUTOFF_HZ))
        if rate is not None:
            a, (x, y, z), (to_x, to_y, to_z) = self._alpha, self.value, rate
            self.value = x + a * (to_x - x), y + a * (to_y - y), z + a * (to_z - z)


class Stillness:
    """The test, once a pass of the main loop.

    Attributes:
        is_still: the vehicle stands still on the ground, as far as is known.
        gyro, accel: rad/s and m/s/s, body, filtered at 10 Hz.
    """

    def __init__(self) -> None:
        self.gyro, self.accel = Filtered(), Filtered()
        self.reset()

    def reset(self) -> None:
        """Restart the test; the filters go on."""
        self.is_still = False
        self._ratios: tuple[float, float, float, float] | None = None
        # In the firmware there was a rate of 0 before the first, so that the vehicle seems to move for a while.
        self._gyro_before: Three | None = (0.0, 0.0, 0.0)
        self._accel_before: Three = (0.0, 0.0, 0.0)
        self._gyro_diff = self._accel_diff = 0.0

    def sense(self, delta: InertialDelta) -> None:
        """Filter the data of a pass."""
        self.gyro.add(delta.gyro, LOOP_DT)
        self.accel.add(delta.accel, LOOP_DT)

    def skip(self) -> None:
        """Let the test rest, in flight or with a compass."""
        self.is_still = False
        self._ratios = self._gyro_before = None

    @property
    def is_tested(self) -> bool:
        """Whether the test runs, so that its answer counts."""
        return self._ratios is not None

    @property
    def report(self) -> StillnessReport | None:
        """What the last test found; None while it does not run."""
        return None if self._ratios is None else StillnessReport(self.is_still, *self._ratios)

    def test(self, gyro_bias: Three, accel_bias: Three, dt_ekf_avg: float, scale: float) -> None:
        """Test again; biases are in rad/s and m/s/s, ``scale`` is that of all limits (EK3_OGNM_TEST_SF)."""
        (x, y, z), (bias_x, bias_y, bias_z) = self.gyro.value, gyro_bias
        gyro = x - bias_x, y - bias_y, z - bias_z
        (x, y, z), (bias_x, bias_y, bias_z) = self.accel.value, accel_bias
        accel = x - bias_x, y - bias_y, z - bias_z
        if self._gyro_before is None:
            self._gyro_before, self._accel_before = gyro, accel
            self._gyro_diff, self._accel_diff = GYRO_DIFF_LIMIT, ACCEL_DIFF_LIMIT
            self.is_still = False
            return
        self._gyro_diff += _SLOW * (math.dist(gyro, self._gyro_before) / dt_ekf_avg - self._gyro_diff)
        self._accel_diff += _SLOW * (math.dist(accel, self._accel_before) / dt_ekf_avg - self._accel_diff)
        self._gyro_before, self._accel_before = gyro, accel
        ratios = self._ratios = (
            math.hypot(*gyro) / GYRO_LIMIT,
            (math.hypot(*accel) - GRAVITY_MSS) / ACCEL_LIMIT,
            self._gyro_diff / GYRO_DIFF_LIMIT,
            self._accel_diff / ACCEL_DIFF_LIMIT,
        )
        worst = max(ratios[0], abs(ratios[1]), ratios[2], ratios[3])
        self.is_still = worst <= scale if self.is_still else worst < scale * HYSTERESIS
