# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an AHRS is told of the vehicle around it (AP_DAL/AP_DAL.cpp, AP_DAL::start_frame)."""

from dataclasses import dataclass
from typing import Final

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.range_state import RangeState
from ekf_stub.log.ext_nav_log import VisualOdomFrame

NO_CAMERA: Final = VisualOdomFrame(Vector3f(), 0, healthy=False, enabled=False)


@dataclass(slots=True)
class VehicleState:
    """The vehicle as of the first of the passes that come; it stays the same in all that are run at once.

    Attributes:
        camera: where the camera is, how late it is, and whether it is healthy and enabled.
        armed: whether the vehicle is armed.
        flying_since_us: since when it has been flying, us since boot; None on the ground.
        home: None while unset.
        expected: whether a take-off is expected, and whether a touchdown is.
        gps: the newest solution of the GPS; None without a GPS.
        gps_lag_s: how late the GPS is said to be, s.
        ranges: what the range finders say, the same until that changes; None without any.
    """

    camera: VisualOdomFrame = NO_CAMERA
    armed: bool = False
    flying_since_us: int | None = None
    home: Location | None = None
    expected: tuple[bool, bool] = (False, False)
    gps: GpsSample | None = None
    gps_lag_s: float = 0.0
    ranges: RangeState | None = None
