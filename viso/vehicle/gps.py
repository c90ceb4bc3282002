# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A GPS of the vehicle, which GPS_INPUT messages feed, or the simulator's receiver (AP_GPS/AP_GPS.cpp)."""

from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import int_of_float, u8, u16, u32
from ap_core.clock import NEVER, Clock
from ap_core.fmath import f32
from ap_core.param import FromParams, ParamTable
from ap_core.sinks import RecordSink, TextSink
from ekf_stub.inputs.measurements import FIX_3D, USUAL_LAG_S, GpsSample
from mav_handlers.wire.messages import GPS_INPUT
from viso.firmware.log_releases import GPA, GPS
from viso.vehicle.gps_driver import MS_PER_WEEK, UNKNOWN_DOP, GpsState, MavlinkGpsDriver
from viso.vehicle.simulated_gps import SimulatedGps, UbloxDriver

GPS_TYPE_NONE: Final = 0
GPS_TYPE_AUTO: Final = 1
GPS_TYPE_MAV: Final = 14
NO_GPS: Final = 0
NO_FIX: Final = 1
FIX_2D: Final = 2
GPS_PERIOD_US: Final = 20_000
GPS_TIMEOUT_MS: Final = 4000
MASK_LOG_GPS: Final = 1 << 2

_MAV_SEVERITY_INFO: Final = 6
_LAG_S_WITHOUT_DRIVER: Final = {GPS_TYPE_NONE: 0.0, GPS_TYPE_AUTO: 0.1}
_MAX_DELTA_MS: Final = 245
_MAX_AVERAGE_DELTA_MS: Final = f32(215)
_MAX_DELAYED: Final = 2
_ACCURACY_LIMIT: Final = 65535
_DEFAULT_YAW_ACCURACY_DEG: Final = 10
_NO_ELLIPSOID_HEIGHT: Final = -(1 << 31)
_UNIX_TIME_OF_GPS_WEEK_0_MS: Final = 315_964_800_000 - 18_000  # with the leap seconds since


class Gps:
    """A GPS: finds its driver, checks how regular its solutions are, logs them and sets the time of day.

    GPSn_TYPE 14 takes messages, 1 a vehicle's own receiver if it has one; whatever else that asks for has no receiver
    attached. ``set_utc_us`` takes the time of day, since 1970. ``number`` is the n.
    ``is_used`` is for the log: whether the vehicle uses it.
    """

    def __init__(
        self,
        clock: Clock,
        params: ParamTable,
        texts: TextSink,
        logger: RecordSink,
        set_utc_us: Callable[[int], None],
        receiver: SimulatedGps | None = None,
        *,
        number: int = 1,
    ) -> None:
        self._clock = clock
        self._params = params
        self._number = number
        self._type = FromParams(params, lambda: params.get_int(f"GPS{number}_TYPE"))
        self._texts = texts
        self._logger = logger
        self._set_utc_us = set_utc_us
        self._receiver = receiver
        self._driver: MavlinkGpsDriver | UbloxDriver | None = None
        self._state = GpsState()
        self._last_fix_ms = 0
        self._last_message_ms = 0
        self._delta_ms = 0
        self._delayed_count = 0
        self._average_delta_ms = f32(0)
        self._sample: GpsSample | None = None  # as long as nothing has changed
        self.is_used = number == 1

    @property
    def introduction(self) -> str | None:
        """Return the text with which a log begins; None without a driver."""
        if self._driver is None or self._type() == GPS_TYPE_NONE:
            return None
        return f"GPS {self._number}: {self._driver.introduction}"

    @property
    def status(self) -> int:
        """The kind of fix: 0 without a driver, 1 without a fix."""
        return self._state.status

    @property
    def num_sats(self) -> int:
        """How many satellites it uses."""
        return self._state.num_sats

    def take(self, packet: GPS_INPUT) -> bool:
        """Give a message to the driver; return whether there is one (AP_GPS::handle_msg)."""
        if not isinstance(self._driver, MavlinkGpsDriver) or self._type() == GPS_TYPE_NONE:
            return False
        self._driver.handle(packet, self._state, self._clock.millis())
        self._sample = None
        return True

    def sample(self) -> GpsSample | None:
        """Return the newest solution, or None without a driver."""
        if self._driver is None or self._type() == GPS_TYPE_NONE:
            return None
        if self._sample is None:
            self._sample = self._make_sample()
        return self._sample

    def lag_s(self) -> float:
        """Return how late solutions are taken to be (AP_GPS::get_lag).

        FIRMWARE PARITY: of a receiver that has to be configured first, and is not, the firmware does not know this, and
        its estimator waits; here such a receiver counts as configured.
        """
        without = _LAG_S_WITHOUT_DRIVER.get(self._type(), USUAL_LAG_S)
        return without if self._driver is None else self._driver.lag_s

    def _make_sample(self) -> GpsSample:
        state = self._state
        return GpsSample(
            time_ms=self._last_message_ms,
            fix_type=state.status,
            location=state.location,
            vel_ned=state.velocity,
            num_sats=state.num_sats,
            hdop=state.hdop,
            vdop=state.vdop,
            has_vertical_velocity=state.have_vertical_velocity,
            speed_accuracy=_wide(state.speed_accuracy),
            horizontal_accuracy=_wide(state.horizontal_accuracy),
            vertical_accuracy=_wide(state.vertical_accuracy),
            yaw_deg=_wide(state.yaw_deg),
            last_fix_ms=self._last_fix_ms,
            is_healthy=self._healthy(),
            lag_s=self.lag_s(),
        )

    def _healthy(self) -> bool:
        """Return whether messages come regularly, at about 5 Hz or more (AP_GPS::is_healthy)."""
        return self._delayed_count < _MAX_DELAYED and bool(self._average_delta_ms < _MAX_AVERAGE_DELTA_MS)

    def update(self) -> None:
        """Look for the driver, then for what it has got, 50 times per second (AP_GPS::update_instance)."""
        if self._type() == GPS_TYPE_NONE:
            self._sample = None
            self._state.status = NO_GPS
            self._state.hdop = self._state.vdop = UNKNOWN_DOP
        elif self._driver is None:
            self._detect()
        else:
            self._update_instance(self._driver)

    def idle_until_us(self) -> int:
        """Return until when ``update`` has nothing to do, us since boot; 0 if it may have at once."""
        if self._type() == GPS_TYPE_NONE:
            return NEVER if self._state.status == NO_GPS else 0
        if self._driver is None:
            return 0 if self._type() == GPS_TYPE_MAV or self._has_receiver() else NEVER
        if self._driver.has_news or self._state.status >= FIX_3D:  # which tells the time
            return 0
        now_us = self._clock.micros64()
        silent_ms = u32(now_us // 1000 - self._last_message_ms)
        return (now_us // 1000 + max(0, GPS_TIMEOUT_MS + 1 - silent_ms)) * 1000

    def _detect(self) -> None:
        if self._receiver is not None and self._has_receiver() and self._receiver.is_found(self._clock.micros64()):
            self._driver = UbloxDriver(self._receiver, self._state)
        elif self._type() == GPS_TYPE_MAV:
            self._driver = MavlinkGpsDriver()
        else:
            return
        self._sample = None
        self._state.status = NO_FIX
        self._last_message_ms = self._clock.millis()
        self._delta_ms = GPS_TIMEOUT_MS
        self._texts.send_text(_MAV_SEVERITY_INFO, f"GPS {self._number}: {self._driver.introduction}")

    def _has_receiver(self) -> bool:
        return self._receiver is not None and self._type() == GPS_TYPE_AUTO

    def _update_instance(self, driver: MavlinkGpsDriver | UbloxDriver) -> None:
        now_ms = self._clock.millis()
        if driver.read(now_ms):
            self._take_news(driver, now_ms)
        elif u32(now_ms - self._last_message_ms) > GPS_TIMEOUT_MS:
            self._time_out(now_ms)
        else:
            self._set_time_of_day()
            return
        self._sample = None
        self._watch_rate()
        if self._params.get_int("LOG_BITMASK") & MASK_LOG_GPS:
            self._log()
        self._set_time_of_day()

    def _take_news(self, driver: MavlinkGpsDriver | UbloxDriver, now_ms: int) -> None:
        state = self._state
        if state.corrected_ms_updated:
            state.corrected_ms_updated = False
            now_ms = state.corrected_ms
        if not state.announced:
            state.announced = True
            self._texts.send_text(_MAV_SEVERITY_INFO, f"GPS {self._number}: {driver.detected}")
        self._delta_ms = u16(now_ms - self._last_message_ms)
        self._last_message_ms = now_ms
        if state.status >= FIX_2D:
            self._last_fix_ms = now_ms

    def _time_out(self, now_ms: int) -> None:
        # A silent MAVLink GPS remains, without a fix; any other is looked for again.
        self._state = GpsState()
        self._last_message_ms = now_ms
        self._delta_ms = GPS_TIMEOUT_MS
        if self._type() == GPS_TYPE_MAV:
            self._state.status = NO_FIX
        else:
            self._driver = None

    def _watch_rate(self) -> None:
        self._delayed_count = u8(self._delayed_count + 1) if self._delta_ms > _MAX_DELTA_MS else 0
        if self._delta_ms < 2000:
            delta_ms = f32(self._delta_ms)
            average_ms = f32(f32(0.98) * self._average_delta_ms + f32(0.02) * delta_ms)
            self._average_delta_ms = average_ms if self._average_delta_ms > 0 else delta_ms

    def _set_time_of_day(self) -> None:
        state = self._state
        if state.status >= FIX_3D and state.time_week:
            fix_ms = _UNIX_TIME_OF_GPS_WEEK_0_MS + state.time_week * MS_PER_WEEK + state.time_week_ms
            self._set_utc_us(fix_ms * 1000 + self._clock.micros64() - state.corrected_ms * 1000)

    def _log(self) -> None:
        """Write GPS and GPA (AP_GPS::Write_GPS)."""
        state, time_us, number, is_used = self._state, self._clock.micros64(), self._number - 1, int(self.is_used)
        yaw_deg, yaw_accuracy_deg = (f32(0), 0) if state.yaw_deg is None else (state.yaw_deg, _DEFAULT_YAW_ACCURACY_DEG)
        solution = (state.status, state.time_week_ms, state.time_week, state.num_sats, state.hdop)
        place = (state.location.lat, state.location.lng, state.location.alt_cm)
        motion = (state.ground_speed, state.ground_course, state.velocity.z)
        self._logger.write(GPS, (time_us, number, *solution, *place, *motion, yaw_deg, is_used))
        accuracies = map(_centi, (state.horizontal_accuracy, state.vertical_accuracy, state.speed_accuracy))
        times = (self._last_message_ms, self._delta_ms)
        flags = (yaw_accuracy_deg, int(state.have_vertical_velocity))
        self._logger.write(GPA, (time_us, number, state.vdop, *accuracies, *flags, *times, _NO_ELLIPSOID_HEIGHT, 0, 0))


def _wide(value: np.float32 | None) -> float | None:
    return None if value is None else float(value)


def _centi(value: np.float32 | None) -> int:
    with np.errstate(over="ignore"):
        scaled = float(f32(0) if value is None else value * f32(100))
    return u16(int_of_float(scaled)) if scaled < _ACCURACY_LIMIT else _ACCURACY_LIMIT
