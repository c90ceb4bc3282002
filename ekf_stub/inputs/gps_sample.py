# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a GPS driver tells the estimator (AP_GPS/AP_GPS.h, GPS_State)."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.reports.core_report import Three

FIX_3D: Final = 3
USUAL_LAG_S: Final = 0.2


def whole_ms(lag_s: float) -> int:
    """Return a lag in ms as the firmware has it, which computes it in single precision and cuts it off."""
    return int(np.float32(1000) * np.float32(lag_s))


@dataclass(frozen=True, slots=True)
class GpsSample:
    """One solution of a GPS.

    ``time_ms`` is since boot. Accuracies and the vertical velocity are None when the receiver gives none; hdop and
    vdop are x 100, 65535 when unknown. ``yaw_deg`` is 0..360 from north. ``last_fix_ms`` is the ``time_ms`` of the last
    solution with a fix, 0 before the first. ``is_healthy`` says whether solutions have come regularly. ``lag_s`` is
    how old a solution is when it comes; the default is what the firmware assumes of most receivers. ``antenna`` is the
    antenna's place from the IMU, m, body (FRD).
    """

    time_ms: int
    fix_type: int
    location: Location
    vel_ned: Vector3f
    num_sats: int
    hdop: int = 65535
    vdop: int = 65535
    has_vertical_velocity: bool = False
    speed_accuracy: float | None = None
    horizontal_accuracy: float | None = None
    vertical_accuracy: float | None = None
    yaw_deg: float | None = None
    last_fix_ms: int = 0
    is_healthy: bool = True
    lag_s: float = USUAL_LAG_S
    antenna: Three = (0.0, 0.0, 0.0)
