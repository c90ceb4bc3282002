# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Home: when it is set, and by whom (ArduCopter/commands.cpp, AP_AHRS.cpp, AP_Baro.cpp)."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from ap_core.cint import u32
from ap_core.clock import NEVER
from ap_core.fmath import f32, is_zero
from ap_core.location import Location
from ap_core.print_format import fixed
from viso.logs.vehicle_log import ORGN_EKF, ORGN_HOME
from viso.vehicle.copter.mission import Mission

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

EV_SET_HOME: Final = 25
FIELD_ELEVATION_PERIOD_MS: Final = 1000

_CENTI: Final = f32(0.01)
_MAV_SEVERITY_INFO: Final = 6


class Home:
    """Home, which is the first item of the mission, and the field's elevation.

    Attributes:
        place: home, or None while unset.
        locked: a command has set it, so that arming leaves it alone.
        has_return_path: it was set to where the vehicle was, from where SMART_RTL notes its path.
    """

    def __init__(self, vehicle: "Vehicle", is_armed: Callable[[], bool], mission: Mission) -> None:
        self._ahrs = vehicle.ahrs
        self._log = vehicle.log
        self._texts = vehicle.texts
        self._clock = vehicle.clock
        self._is_armed = is_armed
        self._mission = mission
        self._changed = False
        self._has_field_elevation = False
        self._field_elevation_ms = 0
        self.place: Location | None = None
        self.locked = False
        self.has_return_path = False

    def update(self) -> None:
        """Set home once there is a location, and the field's elevation once there is an origin; every main loop."""
        if self.place is not None and self._has_field_elevation:  # as in nearly every pass
            return
        origin = self._ahrs.origin()
        if origin is None:  # without which neither is set
            return
        if self.place is None:
            self._set_from_ekf(origin)
        if not self._has_field_elevation and not self._is_armed():
            self._update_field_elevation(origin)

    def idle_until_us(self) -> int:
        """Return until when ``update`` has nothing to do and home is not to be sent, us since boot; 0 if not."""
        if self._changed:
            return 0
        if self._ahrs.origin() is None or (self.place is not None and (self._has_field_elevation or self._is_armed())):
            return NEVER
        if self.place is None:
            return 0
        since_ms = u32(self._clock.millis() - self._field_elevation_ms)
        return (self._clock.micros64() // 1000 - since_ms + FIELD_ELEVATION_PERIOD_MS) * 1000

    def _set_from_ekf(self, origin: Location) -> None:
        # Copter::update_home_from_EKF: in flight, home is level with the origin.
        if not self._is_armed():
            self.set_here(lock=False)
        elif (place := self._ahrs.get_location()) is not None:
            self.has_return_path |= self.set(Location(place.lat, place.lng, origin.alt_cm), lock=False)

    def set_here(self, lock: bool) -> bool:
        """Set home to where the vehicle is; return whether that is known (Copter::set_home_to_current_location)."""
        place = self._ahrs.get_location()
        if place is None or not self.set(place, lock):
            return False
        self.has_return_path = True
        return True

    def set(self, place: Location, lock: bool) -> bool:
        """Set home; return whether it was set: there must be an origin (Copter::set_home, AP_AHRS::set_home)."""
        origin = self._ahrs.origin()
        if origin is None or place == Location(0, 0, 0) or not place.is_valid():
            return False
        if self.place is None:
            self._log.event(EV_SET_HOME)
        self.place = place
        self._changed = True
        self._log.place(ORGN_EKF, origin)
        self._log.place(ORGN_HOME, place)
        self._mission.add_home()
        self.locked |= lock
        return True

    def take_changed(self) -> bool:
        """Tell, once, that home has changed."""
        changed, self._changed = self._changed, False
        return changed

    def _update_field_elevation(self, origin: Location) -> None:
        # AP_Baro::update_field_elevation: the elevation of an origin at 0 m looks unset, and is told every second.
        now_ms = self._clock.millis()
        if u32(now_ms - self._field_elevation_ms) < FIELD_ELEVATION_PERIOD_MS:
            return
        elevation_m = f32(f32(origin.alt_cm) * _CENTI)
        self._has_field_elevation = not is_zero(elevation_m)
        self._field_elevation_ms = now_ms
        self._ahrs.reset_height_datum()
        self._texts.send_text(_MAV_SEVERITY_INFO, f"Field Elevation Set: {fixed(float(elevation_m), 0)}m")
