# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's origin, as the vehicle keeps it in parameters and takes it from there.

Source: AP_AHRS.cpp, update_state, record_origin, use_recorded_origin_maybe.
"""

from typing import TYPE_CHECKING, Final

from ap_core.cint import int_of_float
from ap_core.clock import NEVER
from ap_core.fmath import f32, ieee754
from ap_core.location import Location
from ap_core.print_format import fixed
from ekf_stub.core.params import GPS
from viso.logs.vehicle_log import ORGN_EKF

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

KEEP: Final = 1 << 3  # of AHRS_OPTIONS
USE_KEPT_WITHOUT_GPS: Final = 1 << 4
_NAMES: Final = ("AHRS_ORIGIN_LAT", "AHRS_ORIGIN_LON", "AHRS_ORIGIN_ALT")
_MAV_SEVERITY_INFO: Final = 6


class Origin:
    """Logs, announces and keeps an origin that the filter has found; gives it the kept one if it may find none."""

    def __init__(self, vehicle: "Vehicle") -> None:
        self._vehicle = vehicle
        self._is_told = not vehicle.firmware.keeps_origin

    def idle_until_us(self) -> int:
        """Return until when ``update`` has nothing to do, us since boot; 0 if not."""
        if self._is_told:
            return NEVER
        return 0 if self._vehicle.ahrs.origin() is not None or self._kept() is not None else NEVER

    def update(self) -> None:
        """Look for an origin, once a pass until there is one."""
        vehicle, kept = self._vehicle, self._kept()
        if self._is_told:
            return
        if (origin := vehicle.ahrs.origin()) is not None:
            vehicle.log.place(ORGN_EKF, origin)
            vehicle.endpoint.request_message_everywhere("GPS_GLOBAL_ORIGIN")
            self.note(origin)
        elif kept is not None and vehicle.ahrs.get_velocity_NED() is not None and vehicle.set_origin(kept):
            lat, lon, alt = (float(vehicle.params.get_float(name)) for name in _NAMES)
            place = f"{fixed(lat, 7)},{fixed(lon, 7)},{fixed(alt, 1)}"
            vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"AHRS: using recorded origin:{place}")
            vehicle.endpoint.request_message_everywhere("GPS_GLOBAL_ORIGIN")

    def note(self, origin: Location) -> None:
        """Keep an origin, if that is wanted, which is logged and announced already."""
        if self._is_told:
            return
        self._is_told = True
        vehicle = self._vehicle
        if not vehicle.params.get_int("AHRS_OPTIONS") & KEEP:
            return
        values = origin.lat * 1e-7, origin.lng * 1e-7, origin.alt_cm * 1e-2
        for name, value in zip(_NAMES, values, strict=True):
            if f32(value) != vehicle.params.get_float(name):
                vehicle.endpoint.echo_parameters(vehicle.params.set_from_mavlink(name, value).echoes)

    @ieee754
    def _kept(self) -> Location | None:
        """Return the origin to use, or None: it is not wanted, none is kept, or GPS will give one."""
        vehicle = self._vehicle
        if self._is_told or not vehicle.params.get_int("AHRS_OPTIONS") & USE_KEPT_WITHOUT_GPS:
            return None
        active = vehicle.sources.active()
        lat, lon, alt = (vehicle.params.get_float(name) for name in _NAMES)
        if GPS in (active.pos_xy, active.pos_z) or not (lat or lon or alt):
            return None
        alt_cm = int_of_float(float(alt * f32(100)))
        return Location(int_of_float(float(lat) * 1e7), int_of_float(float(lon) * 1e7), alt_cm)
