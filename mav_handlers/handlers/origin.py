# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handler of SET_GPS_GLOBAL_ORIGIN (GCS_Common.cpp, handle_set_gps_global_origin and set_ekf_origin)."""

from typing import Final

import numpy as np

from ap_core.cint import int_of_float
from ap_core.verdict import Verdict
from mav_handlers.context import Context
from mav_handlers.ports import Location, OriginResult
from mav_handlers.verdicts import HANDLED, ORIGIN_REFUSED
from mav_handlers.wire.messages import SET_GPS_GLOBAL_ORIGIN

MAX_LAT: Final = 900_000_000
MAX_LNG: Final = 1_800_000_000


def set_ekf_origin(ctx: Context, location: Location) -> OriginResult:
    """Set the EKF origin and tell of it as the release does; everybody is told when home follows."""
    if abs(location.lat) > MAX_LAT or abs(location.lng) > MAX_LNG:
        return OriginResult.INVALID
    if location.lat == 0 and location.lng == 0 and location.alt_cm == 0:
        return OriginResult.INVALID
    result = ctx.vehicle.set_origin(location)
    if result is OriginResult.SET:
        ctx.vehicle.release.tell_origin(ctx.endpoint, ctx.channel, ctx.now_us)
    return result


def handle_set_gps_global_origin(ctx: Context, message: SET_GPS_GLOBAL_ORIGIN) -> Verdict:
    """Set the origin from degE7 and mm; the altitude loses precision in float32, as in the firmware."""
    alt_cm = int_of_float(float(np.float32(message.altitude) * np.float32(0.1)))
    location = Location(message.latitude, message.longitude, alt_cm)
    return HANDLED if set_ekf_origin(ctx, location) is OriginResult.SET else ORIGIN_REFUSED
