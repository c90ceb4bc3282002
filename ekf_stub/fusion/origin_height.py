# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How high the origin is (AP_NavEKF3/AP_NavEKF3_Measurements.cpp, correctEkfOriginHeight).

Bits of EK3_OGN_HGT_MASK: 1 GPS corrects it while height comes from the barometer, 2 while it comes from a range
finder; 4 it is the heights measured that are corrected, and not what is told of the origin.
"""

from typing import Final

from ap_core.fmath import f32
from ekf_stub.filter.inertial import limited
from ekf_stub.inputs.gps_reading import CENTI

BY_BARO, BY_RANGE, IN_MEASUREMENTS = 1, 2, 4
BARO_DRIFT_M_S: Final = float(f32(0.05))
STEEPEST: Final = 0.25
MAX_RATIO: Final = 25.0


class OriginHeight:
    """The height of a core's origin above mean sea level.

    Attributes:
        alt_cm: as it was set.
        reference_m: as GPS has it by now.
        variance: of that, m^2.
    """

    def __init__(self) -> None:
        self.alt_cm, self.reference_m, self.variance = 0, 0.0, 0.0
        self._corrected_ms = 0

    def put(self, alt_cm: int) -> None:
        """Put the origin at a height."""
        self.alt_cm, self.reference_m = alt_cm, CENTI * alt_cm

    @property
    def excess_m(self) -> float:
        """How much higher the origin is than it was set."""
        return float(f32(self.reference_m - CENTI * self.alt_cm))

    def correct(
        self, horizon_ms: int, innovation_m: float, variance: float, *, drift_m_s: float, is_good: bool
    ) -> None:
        """Correct it by a solution of the GPS, if that is good enough to be believed.

        ``innovation_m`` is the filter's height less that of GPS, ``variance`` that of this difference, m^2,
        ``drift_m_s`` how fast the sensor that gives the height may drift.
        """
        dt = limited(0.001 * (horizon_ms - self._corrected_ms), 0.0, 1.0)
        self._corrected_ms = horizon_ms
        self.variance += (drift_m_s * dt) ** 2
        total = self.variance + variance
        if is_good and innovation_m**2 / total < MAX_RATIO:
            gain = self.variance / total
            self.reference_m -= gain * innovation_m
            self.variance -= gain * self.variance
