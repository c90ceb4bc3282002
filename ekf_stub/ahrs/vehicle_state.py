# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an AHRS knows of the vehicle around it: its state (AP_DAL::start_frame), and what it is fitted with."""

from dataclasses import dataclass
from typing import Final

from ap_core.location import Location
from ap_core.param import FromParams, ParamTable
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import NO_GPS, AllGps, RangeState
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
        gps: the newest solutions of GPS.
        gps_lag_s: the lag of the primary GPS by its driver, s.
        ranges: those of the range finders, the same object until they change; None without range finders.
    """

    camera: VisualOdomFrame = NO_CAMERA
    armed: bool = False
    flying_since_us: int | None = None
    home: Location | None = None
    expected: tuple[bool, bool] = (False, False)
    gps: AllGps = NO_GPS
    gps_lag_s: float = 0.0
    ranges: RangeState | None = None


def has_flow(params: ParamTable) -> bool:
    """Return whether there is to be a flow sensor (AP_OpticalFlow::enabled)."""
    return params.get_int("FLOW_TYPE") != 0


def compass_in_use(params: ParamTable) -> FromParams[bool]:
    """Return the cached value of whether there is a compass, and in use."""
    return FromParams(params, lambda: params.get_int("COMPASS_ENABLE") != 0 and params.get_int("COMPASS_USE") != 0)


def imu_pos(params: ParamTable, imu: int = 0) -> Vector3f:
    """Return the place of an IMU on the vehicle, m, body (FRD)."""
    return Vector3f(*(params.get_float(f"INS_POS{imu + 1}_{axis}") for axis in "XYZ"))


def imu_mask(params: ParamTable) -> int:
    """Return which IMUs get a core; none when EK3_ENABLE is off."""
    return params.get_int("EK3_IMU_MASK") if params.get_int("EK3_ENABLE") else 0
