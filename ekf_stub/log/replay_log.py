# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs all inputs of the estimator, so that its run can be repeated from the log.

As recorded logs of the reference have it:

- A frame begins with RFRH; RFRF ends it, late: before the next RFRH, or before the first call from outside in the same
  pass (ROFH, REPH, REVH, RBOH, REV2, REV3). What the pass logs until then, estimates included, stands within the frame.
  RSO2 and RSO3 do not end it.
- The inputs come in this order, each only when it has changed: RFRN, RISH, RISI, RBRH, RBRI, RGPH, then RGPI and RGPJ
  of each receiver, RMGH, RMGI, RRNH, RRNI, RVOH. The first frame of a log has all. Most frames have RISI alone, armed
  or not; RBRI and RMGI come together, ten times per second. Arming changes RFRN and nothing else.
- RFRF.FTypes is 5 up to and including the frame in which EKF3 gets a state, 13 in the next, and 9 from then on: EKF2
  (1), which is built in but not enabled, is tried every time. Writing estimates adds 32; where a call has ended the
  frame before, that gets an RFRF of its own. RFRF.Slow is always 0.
- RSO2 of an origin is repeated in the frame after that in which it was set.
- Of sensors that the vehicle lacks only GPS has records, once in a log; airspeed, range finders and beacons have none.

Source: AP_DAL/AP_DAL.cpp, AP_DAL_InertialSensor.cpp, AP_DAL_Baro.cpp, AP_DAL_Compass.cpp,
AP_DAL_GPS.cpp, AP_DAL_RangeFinder.cpp, AP_GPS/AP_GPS.cpp.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from ap_core.cint import u32
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.sinks import RecordSink
from ekf_stub.core.imus import MAX_IMUS
from ekf_stub.inputs.measurements import (
    NO_GPS,
    AllGps,
    Array,
    BaroReading,
    GpsSample,
    InertialDelta,
    RangeState,
    first_healthy,
    first_usable,
)
from ekf_stub.inputs.sensors import Sensors
from ekf_stub.log.ext_nav_log import ExtNavLog
from ekf_stub.log.replay_log_structure import (
    RBRH,
    RBRI,
    REV2,
    REV3,
    RFRF,
    RFRH,
    RFRN,
    RGPH,
    RGPI,
    RGPJ,
    RISH,
    RISI,
    RMGH,
    RMGI,
    RRNH,
    RRNI,
    RSO2,
    RSO3,
)
from ekf_stub.reports import Three

# Of REV3.Event.
RESET_HEIGHT_DATUM: Final = 1
TERRAIN_STABLE: Final = 9
TERRAIN_UNSTABLE: Final = 10
REQUEST_YAW_RESET: Final = 11
CHECK_LANE_SWITCH: Final = 12
SOURCE_SET_1: Final = 13

_EKF2_INITIALISES, _EKF3_INITIALISES, _EKF3_UPDATES, _EKF3_LOGS = 1, 4, 8, 32  # of RFRF.FTypes
_FOR_BOTH: Final = frozenset((RESET_HEIGHT_DATUM, TERRAIN_STABLE, TERRAIN_UNSTABLE))
EKF2_BEFORE_EKF3: Final = (REV2, REV3)
"""In which order an event is logged for the two filters, in releases before 2026-02-02."""
EKF3_BEFORE_EKF2: Final = (REV3, REV2)
"""The same since."""
USE_ACCEL: Final = 1 << 0  # of RISI.Flags
USE_GYRO: Final = 1 << 1
_ALL_GOOD: Final = 15  # both are used, and both gave data
INERTIAL: Final = RISI.fields[:8]
"""Labels of the inertial data in RISI: change of velocity, rotation, and the seconds of either."""

_NOTHING: Final = (0.0,) * 8

EAS2TAS_AT_SEA_LEVEL: Final = 1.0000001192092896
"""True over equivalent airspeed as the firmware computes it for height zero."""

_AVAILABLE_MEMORY: Final = 524_288  # bytes, as the simulator reports
_COPTER: Final = 2
ARMED: Final = 1 << 0  # of RFRN.Flags
HAS_FLOW: Final = 1 << 4
TAKEOFF_EXPECTED: Final = 1 << 6
TOUCHDOWN_EXPECTED: Final = 1 << 7

YAW_ACCURACY_DEG: Final = 10.0
_UNKNOWN_DOP: Final = 65535
_VERTICAL_VELOCITY, _HORIZONTAL, _VERTICAL, _LAG, _SPEED, _YAW = (1 << bit for bit in range(6))  # of RGPI.Flags
_NOWHERE: Final = (0.0, 0.0, 0.0)

Values = tuple[LogValue, ...]
Place = tuple[int, int, int]


class VehicleFrame(NamedTuple):
    """What the estimator knows of the vehicle in one frame.

    Attributes:
        home: None while unset.
        eas2tas: true over equivalent airspeed at the present height.
        trim_rad: AHRS_TRIM.
        ekf_type: AHRS_EKF_TYPE.
    """

    armed: bool = False
    takeoff_expected: bool = False
    touchdown_expected: bool = False
    has_flow_sensor: bool = False
    home: Location | None = None
    eas2tas: float = EAS2TAS_AT_SEA_LEVEL
    trim_rad: Three = (0.0, 0.0, 0.0)
    ekf_type: int = 3


@dataclass(frozen=True, slots=True)
class SensorSet:
    """How many sensors of a kind there are; those of a kind have the same data, except IMUs that differ.

    Attributes:
        imus: 1..3.
        compass_offsets: COMPASS_OFS, mGauss.
        loop_rate_hz: SCHED_LOOP_RATE.
    """

    imus: int = 2
    baros: int = 2
    compasses: int = 3
    compass_offsets: Three = (0.0, 0.0, 0.0)
    loop_rate_hz: int = 400


class ReplayLog(ExtNavLog):
    """Writes the frames of the estimator, and the calls between them.

    A pass of the main loop that has new inertial data calls ``start_frame``, ``vehicle``, ``sensors``, ``ranges``,
    ``frame`` (of the camera) and, once the filter has run, ``note_run``.

    FIRMWARE PARITY: the first frame after LOG_REPLAY is turned on has all inputs, as that of a new log; in the firmware
    what does not change from then on is missing, and the run cannot be repeated.

    Args:
        enabled: says whether replay records are wanted now: LOG_REPLAY is set, and a log is open.
        fitted: how many sensors there are; two IMUs, two barometers and three compasses by default.
        event_order: the records of an event that both filters know, in their order.
        fills_odometry: RBOH has the camera's place and delay.
    """

    def __init__(
        self,
        logger: RecordSink,
        enabled: Callable[[], bool],
        fitted: SensorSet | None = None,
        *,
        event_order: tuple[LogStructure, LogStructure] = EKF2_BEFORE_EKF3,
        ranges_in_cm: bool = False,
        fills_odometry: bool = False,
    ) -> None:
        super().__init__(logger, enabled, fills_odometry=fills_odometry)
        self._ranges_in_cm = ranges_in_cm
        self._event_order = event_order
        self._fitted = fitted or SensorSet()
        self._is_wanted = False
        self._updates = False
        self._done = 0  # what RFRF is to say
        self._vehicle: VehicleFrame | None = None
        self._baro: tuple[int, float] | None = None
        self._baros: tuple[BaroReading, ...] = ()
        self._mag: tuple[int, Array] | None = None
        self._declination = 0.0
        self._gps = NO_GPS
        self._ranges: RangeState | None = None
        self._origin: Place | None = None
        self._origin_again: Place | None = None

    def new_log(self) -> None:
        """Restart with the next frame, as another log begins."""
        super().new_log()
        self._is_wanted = False

    # A frame

    def start_frame(self, now_us: int, flying_ms: int) -> bool:
        """Begin a frame at ``now_us`` since boot, ``flying_ms`` in flight; return whether its inputs are wanted."""
        if not self._enabled():
            self._is_wanted = False
            self._done = 0
            return False
        self._begin_frame(is_first=not self._is_wanted)
        self._is_wanted = self._awaits_camera = True
        done, self._done = self._done, 0
        if done:
            self._logger.write(RFRF, (done, 0))
        self._origin, self._origin_again = None, self._origin
        self._logger.write(RFRH, (now_us, flying_ms))
        return True

    def _write_input(self, structure: LogStructure, values: Sequence[LogValue], instance: int = 0) -> None:
        """Write an input of a frame that is wanted, in the first one and when it has changed."""
        if self._has_changed(structure, values, instance):
            self._logger.write(structure, values)

    def _write_inputs(self, structure: LogStructure, values: Sequence[LogValue], count: int) -> None:
        """Write an input of several sensors with the same data; the number of the sensor comes after the values."""
        if self._has_changed(structure, (*values, 0), 0):
            for instance in range(count):
                self._logger.write(structure, (*values, instance))

    def _has_changed(self, structure: LogStructure, values: Sequence[LogValue], instance: int) -> bool:
        key, payload = (structure.name, instance), structure.pack(values)
        if not self._is_first and self._last.get(key) == payload:
            return False
        self._last[key] = payload
        return True

    def vehicle(self, vehicle: VehicleFrame) -> None:
        """Log the vehicle's state in this frame."""
        if not self._is_wanted:
            return
        before, self._vehicle = self._vehicle, vehicle
        # The trim may differ in the sign of a zero alone.
        if self._is_first or before is None or vehicle != before or vehicle.trim_rad is not before.trim_rad:
            self._write_input(RFRN, _vehicle_values(vehicle))

    def sensors(self, sensors: Sensors, gps: AllGps = NO_GPS, gps_lag_s: float = 0.0) -> None:
        """Log the sensors in this frame; ``gps_lag_s`` is the lag of a first GPS without a solution."""
        if not self._is_wanted:
            return
        self._write_inertial(sensors)
        if self._is_first or sensors.baro != self._baro or sensors.baros != self._baros:
            self._write_baro(sensors.baro, sensors.baros)
        if self._is_first or gps != self._gps:
            self._write_gps(gps, gps_lag_s)
        if self._is_first or sensors.mag is not self._mag or sensors.declination != self._declination:
            self._write_compass(sensors.mag, sensors.declination)

    def _write_inertial(self, sensors: Sensors) -> None:
        fitted, is_first = self._fitted, self._is_first
        imus = len(sensors.imus) or fitted.imus
        if is_first or sensors.imus:
            rate_hz = fitted.loop_rate_hz
            self._write_input(RISH, (rate_hz, *first_usable(sensors.imus), 1 / rate_hz, imus, imus))
        if sensors.imus:
            for imu, (delta, has_gyro, has_accel) in enumerate(sensors.imus):
                flags = _ALL_GOOD & ~(USE_GYRO * (not has_gyro) | USE_ACCEL * (not has_accel))
                self._write_input(RISI, (*_inertial_values(delta), flags, imu), imu)
        else:
            self._write_inputs(RISI, (*_inertial_values(sensors.delta), _ALL_GOOD), imus)
        if is_first:
            for imu in range(imus, MAX_IMUS):
                self._write_input(RISI, (*_NOTHING, 0, imu), imu)

    def _write_baro(self, baro: tuple[int, float] | None, baros: tuple[BaroReading, ...]) -> None:
        self._baro, self._baros = baro, baros
        count = 0 if baro is None else len(baros) or self._fitted.baros
        self._write_input(RBRH, (first_healthy(baros), count))
        for instance, one in enumerate(baros):
            self._write_input(RBRI, (u32(max(one.time_ms, 0)), one.height, int(one.is_healthy), instance), instance)
        if baro is not None and not baros:
            self._write_inputs(RBRI, (u32(baro[0]), baro[1], 1), count)

    def _write_gps(self, gps: AllGps, lag_s: float) -> None:
        self._gps = gps
        first, second = gps.of(0), gps.of(1)
        receivers = (
            _absent(0, _LAG, _UNKNOWN_DOP, lag_s) if first is None else _gps_values(first, 0),
            _absent(1, _LAG, _UNKNOWN_DOP) if second is None else _gps_values(second, 1),
            _absent(2, 0, 0),  # what the firmware would blend of the two
        )
        self._write_input(RGPH, (len(gps.solutions) if first or second else 0, gps.primary))
        for instance, (slow, fast) in enumerate(receivers):
            self._write_input(RGPI, slow, instance)
            self._write_input(RGPJ, fast, instance)

    def _write_compass(self, mag: tuple[int, Array] | None, declination: float) -> None:
        self._mag, self._declination = mag, declination
        count = 0 if mag is None else self._fitted.compasses
        self._write_input(RMGH, (declination, int(count > 0), count, 1, count, 0, 1, 0))
        if mag is not None:
            self._write_inputs(RMGI, (u32(mag[0]), *self._fitted.compass_offsets, *mag[1].tolist(), 1, 1, 1), count)

    def ranges(self, ranges: RangeState | None) -> None:
        """Log the range finders in this frame, if there are any."""
        if not self._is_wanted or ranges is None or (ranges is self._ranges and not self._is_first):
            return
        self._ranges = ranges
        self._write_input(RRNH, (*self._lengths(ranges.ground_clearance, ranges.max_distance), len(ranges.finders)))
        for number, finder in enumerate(ranges.finders):
            (distance,) = self._lengths(finder.distance)
            values = (*finder.place_frd, distance, finder.orientation, finder.status, number)
            self._write_input(RRNI, values, number)

    def _lengths(self, *metres: float) -> tuple[float | int, ...]:
        """Return lengths in m as the log has them."""
        return tuple(round(100 * length) for length in metres) if self._ranges_in_cm else metres

    def note_run(self, *, was_initialised: bool) -> None:
        """Note that the filter was run in this frame, and whether it had a state before."""
        if self._updates:
            self._done |= _EKF2_INITIALISES | _EKF3_UPDATES
        else:
            self._updates = was_initialised
            self._done |= _EKF2_INITIALISES | _EKF3_INITIALISES | was_initialised * _EKF3_UPDATES
        if self._origin_again is not None:
            self._write(RSO2, self._origin_again)
            self._origin_again = None

    def note_logged(self) -> None:
        """Note that the filter's estimates are written to the log in this pass."""
        self._done |= _EKF3_LOGS

    def _end_frame(self) -> None:
        """Log what was done in the frame before, unless that is in the log."""
        done, self._done = self._done, 0
        if done:
            self._write(RFRF, (done, 0))

    # Between frames

    def event(self, number: int) -> None:
        """Log a request to the estimator (AP_DAL::Event), for EKF2 as well if that knows it."""
        self._end_frame()
        for structure in self._event_order if number in _FOR_BOTH else (REV3,):
            self._write(structure, (number,))

    def origin(self, place: Location) -> None:
        """Log a call that sets the origin of the estimator, whether or not it takes effect."""
        self._origin = _place_values(place)
        self._write(RSO2, self._origin)
        self._write(RSO3, self._origin)


def _inertial_values(delta: InertialDelta) -> tuple[float, ...]:
    return (*delta.del_vel.tolist(), *delta.del_ang.tolist(), delta.del_vel_dt, delta.del_ang_dt)


def _absent(instance: int, flags: int, hdop: int, lag_s: float = 0.0) -> tuple[Values, Values]:
    slow = (*_NOWHERE, lag_s, flags, 0, 0, instance)
    return slow, (0, *_NOWHERE, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0.0, 0.0, hdop, instance)


def _gps_values(gps: GpsSample, instance: int) -> tuple[Values, Values]:
    """Return RGPI and RGPJ of a receiver."""
    known = (
        (_VERTICAL_VELOCITY, gps.has_vertical_velocity),
        (_HORIZONTAL, gps.horizontal_accuracy is not None),
        (_VERTICAL, gps.vertical_accuracy is not None),
        (_LAG, True),
        (_SPEED, gps.speed_accuracy is not None),
        (_YAW, gps.yaw_deg is not None),
    )
    flags = sum(bit for bit, is_known in known if is_known)
    yaw = (0.0, 0.0, 0) if gps.yaw_deg is None else (gps.yaw_deg, YAW_ACCURACY_DEG, gps.time_ms)
    place = gps.location.lat, gps.location.lng, gps.location.alt_cm
    accuracies = gps.horizontal_accuracy or 0.0, gps.vertical_accuracy or 0.0
    motion = *gps.vel_ned.to_tuple(), gps.speed_accuracy or 0.0
    slow = (*_NOWHERE, gps.lag_s, flags, gps.fix_type, gps.num_sats, instance)
    return slow, (gps.time_ms, *motion, *yaw, *place, *accuracies, gps.hdop, instance)


def _place_values(place: Location | None) -> Place:
    """Return latitude, longitude and height as the records hold them, zeros for no place."""
    return (0, 0, 0) if place is None else (u32(place.lat), u32(place.lng), u32(place.alt_cm))


def _vehicle_values(vehicle: VehicleFrame) -> tuple[LogValue, ...]:
    """Return the fields of RFRN."""
    flags = (
        vehicle.armed * ARMED
        | vehicle.has_flow_sensor * HAS_FLOW
        | vehicle.takeoff_expected * TAKEOFF_EXPECTED
        | vehicle.touchdown_expected * TOUCHDOWN_EXPECTED
    )
    state = vehicle.eas2tas, _AVAILABLE_MEMORY, *vehicle.trim_rad
    return *_place_values(vehicle.home), *state, _COPTER, vehicle.ekf_type, flags
