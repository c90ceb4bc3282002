# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands beside the inertial data of a core until it changes: what other sensors and the vehicle say.

What cannot be reckoned with stays outside.

FIRMWARE PARITY: the firmware trusts its drivers, and a number that is not finite spoils its filter for good.
"""

import math
from typing import Final, final

from ekf_stub.core.vectors import ZERO, Vec3
from ekf_stub.inputs.measurements import GpsSample, RangeState

_MAX_BARO_M: Final = 1e5
_MAX_FIELD_MGAUSS: Final = 1e5
_MAX_DECLINATION_RAD: Final = 2 * math.pi
_MAX_LEVER_ARM_M: Final = 1e4
_MAX_RANGE_M: Final = 1e5
_MAX_GPS_SPEED_M_S: Final = 1e4
_MAX_GPS_ERROR: Final = 1e9
_MAX_GPS_YAW_DEG: Final = 1e4


@final
class CompassReading:
    """What one compass says.

    Attributes:
        time_us: of the reading, since boot.
        field: mGauss, body (FRD).
        offsets: those that have been taken from it, mGauss.
        is_healthy: whether it works.
        is_used: whether it may be used for yaw.
        has_scale: whether its strength is right.
    """

    def __init__(
        self,
        time_us: int,
        field: Vec3,
        offsets: Vec3 = ZERO,
        is_healthy: bool = True,
        is_used: bool = True,
        has_scale: bool = True,
    ) -> None:
        self.time_us = time_us
        self.field = field
        self.offsets = offsets
        self.is_healthy = is_healthy
        self.is_used = is_used
        self.has_scale = has_scale


@final
class Compasses:
    """What all compasses say, by their numbers (AP_DAL_Compass).

    Attributes:
        readings: what each says.
        first_usable: the number of the first that may be used.
        own: that of the core, if it has affinity to a compass; -1 otherwise.
        are_consistent: whether all point the same way.
        are_available: whether there are any.
        finds_declination: the earth's field may come from a table of the world (COMPASS_AUTODEC).
    """

    def __init__(
        self,
        readings: list[CompassReading],
        first_usable: int = 0,
        own: int = -1,
        are_consistent: bool = True,
        are_available: bool = True,
        finds_declination: bool = True,
    ) -> None:
        self.readings = readings
        self.first_usable = first_usable
        self.own = own
        self.are_consistent = are_consistent
        self.are_available = are_available
        self.finds_declination = finds_declination

    def of_core(self, number: int) -> "Compasses":
        """Return what they say to a core that has affinity to the one of its number."""
        consistent, available = self.are_consistent, self.are_available
        return Compasses(self.readings, self.first_usable, number, consistent, available, self.finds_declination)


@final
class CoreInputs:
    """What a core is given beside inertial data.

    Attributes:
        armed: as the vehicle says.
        takeoff_expected, touchdown_expected: as the vehicle says.
        has_compass: whether there is a compass, and in use.
        home_lat: latitude of home, 1e-7 deg.
        baro_ms, baro_height: time of the barometer's last reading in ms since boot, and height in m; -1 before any.
        compasses: what they say; the same object until that changes.
        gps: the newest solution, with its antenna's place from the IMU; None without one.
        ranges: what the range finders say, with their places from the IMU; None without any.
        declination: of the magnetic field by the compass, rad.
        lever_arm: the camera's place from the IMU, m, body (FRD).
        refused: how often something could not be used, by what it was.
    """

    def __init__(self) -> None:
        self.armed = False
        self.takeoff_expected = False
        self.touchdown_expected = False
        self.has_compass = False
        self.home_lat = 0
        self.baro_ms = -1
        self.baro_height = 0.0
        self.compasses = Compasses([])
        self.gps: GpsSample | None = None
        self.ranges: RangeState | None = None
        self.declination = 0.0
        self.lever_arm: Vec3 = ZERO
        self.refused: dict[str, int] = {}

    def _admits(self, name: str, size: float, limit: float) -> bool:
        """Return whether a size is within its limit, as NaN is not."""
        if size <= limit:
            return True
        self.refused[name] = self.refused.get(name, 0) + 1
        return False

    def set_baro(self, time_ms: int, height: float) -> None:
        """Take a height in m, read at a time in ms since boot; none for one that cannot be used."""
        is_usable = self._admits("baro", abs(height), _MAX_BARO_M)
        self.baro_ms, self.baro_height = (time_ms, height) if is_usable else (-1, 0.0)

    def set_compasses(self, compasses: Compasses) -> None:
        """Take what the compasses say; nothing if that cannot be used."""
        for reading in compasses.readings:
            size = _size(reading.field) + _size(reading.offsets)  # not the larger one, which may pass over NaN
            if not self._admits("compasses", size, _MAX_FIELD_MGAUSS):
                self.compasses = Compasses([])
                return
        self.compasses = compasses

    def set_gps(self, gps: GpsSample | None) -> None:
        """Take a solution; none if that cannot be used."""
        self.gps = gps
        if gps is None:
            return
        x, y, z = gps.vel_ned.to_tuple()
        errors = 0.0
        for error in (gps.speed_accuracy, gps.horizontal_accuracy, gps.vertical_accuracy):
            errors += 0.0 if error is None else abs(error)
        yaw = gps.yaw_deg
        is_usable = (
            self._admits("gps", _size((float(x), float(y), float(z))), _MAX_GPS_SPEED_M_S)
            and self._admits("gps", errors, _MAX_GPS_ERROR)
            and (yaw is None or self._admits("gps", abs(yaw), _MAX_GPS_YAW_DEG))
        )
        if not is_usable:
            self.gps = None

    def set_ranges(self, ranges: RangeState | None) -> None:
        """Take what the range finders say; nothing if that cannot be used."""
        self.ranges = ranges
        if ranges is None:
            return
        size = abs(ranges.ground_clearance) + abs(ranges.max_distance)
        for finder in ranges.finders:
            size += abs(finder.distance) + _size(finder.place_frd)
        if not self._admits("ranges", size, _MAX_RANGE_M):
            self.ranges = None

    def set_declination(self, declination: float) -> None:
        """Take the compass's declination, rad; 0 for one that cannot be used."""
        is_usable = self._admits("declination", abs(declination), _MAX_DECLINATION_RAD)
        self.declination = declination if is_usable else 0.0

    def set_lever_arm(self, lever_arm: Vec3) -> None:
        """Take the camera's place from the IMU, m, body (FRD); the IMU's own for one that cannot be used."""
        self.lever_arm = lever_arm if self._admits("lever_arm", _size(lever_arm), _MAX_LEVER_ARM_M) else ZERO


def _size(vector: Vec3) -> float:
    return abs(vector[0]) + abs(vector[1]) + abs(vector[2])
