# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When barometer and compass are read, and what an ideal compass says.

The reference reads both ten times per second, and its filter sees a reading in the next pass of the main loop.
"""

from typing import Final

from ekf_stub.core.vectors import Quat
from ekf_stub.inputs.measurements import Array
from viso.vehicle.sensors.errors import to_single
from viso.vehicle.sensors.vectors import to_body

PERIOD_US: Final = 100_000
PHASE_US: Final = 50_000
FIELD_NED_MGAUSS: Final = (238.0, 0.0, -529.0)
"""Strength and dip of the reference's place, without its declination."""


def last_reading_us(now_us: int) -> int | None:
    """Return when the newest reading was taken that a pass of the main loop sees, in us since boot; None if never."""
    reading_us = (now_us - 1 - PHASE_US) // PERIOD_US * PERIOD_US + PHASE_US
    return reading_us if reading_us >= 0 else None


def ideal_field(quat: Quat) -> Array:
    """Return the magnetic field in mGauss, body (FRD), of an attitude, body to earth (NED); declination is 0."""
    return to_single(to_body(quat, FIELD_NED_MGAUSS))
