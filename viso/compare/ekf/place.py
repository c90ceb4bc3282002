# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a log says about the earth's magnetic field at its origin, which the firmware has from a table of the world."""

import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from ekf_stub.inputs.inertial import Array
from viso.logs.record_fields import finite, text, whole

_ORIGIN_SET: Final = " origin set"
_ORIGIN_SETTLES_US: Final = 500_000  # until all cores have it


def declination_of(headings: Iterable[Any]) -> float | None:
    """Return the first declination that the compasses were given; the firmware's table had it from the origin on.

    ``headings`` are the RMGH records of a log.
    """
    return next((declination for record in headings if (declination := finite(record, "Dec")[0])), None)


def field_of(records: Iterable[Any], declination: float | None) -> Array | None:
    """Return the earth's field by the firmware's table, Gauss, NED, of which no replay record tells.

    The estimate of it begins there as the origin is set. XKF2 has that cut off to 1 mGauss. ``records`` are the MSG and
    XKF2 records of a log.
    """
    if declination is None:
        return None
    set_us: int | None = None
    for record in records:
        (time_us,) = whole(record, "TimeUS")
        if record.get_type() == "MSG":
            if set_us is None and text(record, "Message").endswith(_ORIGIN_SET):
                set_us = time_us
        elif set_us is not None and time_us > set_us + _ORIGIN_SETTLES_US:
            north, east, down = (value + math.copysign(0.5, value) for value in whole(record, "MN", "ME", "MD"))
            level = math.hypot(north, east)
            return 0.001 * np.array([level * math.cos(declination), level * math.sin(declination), down])
    return None
