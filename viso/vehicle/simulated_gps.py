# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The GPS of the firmware's simulator, a u-blox, and its driver (SITL/SIM_GPS.cpp, AP_GPS/AP_GPS_UBLOX.cpp)."""

import math
import random
from collections import deque
from typing import Final, NamedTuple

import numpy as np

from ap_core.cint import int_of_float, u8
from ap_core.fmath import atan2f, degrees, f32, norm3, sinf, wrap_360
from ap_core.location import Location
from ap_core.param_group import ParamGroup
from ap_core.vector3 import Vector3f
from viso.vehicle.gps_driver import MS_PER_WEEK, GpsState
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.source import VehicleSource

PROBING_US: Final = 7_320_000
"""So long the firmware tries the six speeds that it knows before the GPS's."""
HISTORY: Final = 20
UBLOX_LAG_S: Final = 0.12
"""What the driver assumes of such a receiver, whatever SIM_GPS1_LAG_MS is."""
TRANSPORT_MS: Final = 16
"""How long a solution takes over the port; the driver counts it off."""
RTK_FIXED: Final = 6
NO_FIX: Final = 1
SATELLITES_WITHOUT_FIX: Final = 3
HDOP: Final = 121
VDOP: Final = 200
GPS_EPOCH_UTC_MS: Final = 315_964_800_000 - 18_000
"""When GPS time began, in ms since 1970, with the leap seconds since."""

_TIME_STEP_MS: Final = 200


class Solution(NamedTuple):
    """A solution: ms since boot, 1e-7 degrees, m, m/s NED, and whether it has a fix."""

    time_ms: int = 0
    lat: float = 0.0
    lng: float = 0.0
    alt_m: float = 0.0
    vel_n: float = 0.0
    vel_e: float = 0.0
    vel_d: float = 0.0
    accuracy_m: float = 0.0
    speed_accuracy: float = 0.0
    satellites: int = SATELLITES_WITHOUT_FIX
    has_fix: bool = False

    def toward(self, later: "Solution", share: float) -> "Solution":
        """Return this solution moved on towards a later one by a share of the way, with all else as it is."""
        old, new = self[1:7], later[1:7]
        lat, lng, alt_m, *vel = (a + share * (b - a) for a, b in zip(old, new, strict=True))
        return self._replace(lat=lat, lng=lng, alt_m=alt_m, vel_n=vel[0], vel_e=vel[1], vel_d=vel[2])


class SimulatedGps:
    """A receiver on a vehicle that flies; its noise is of the seed.

    Args:
        airframe: what flies.
        source: its sensors, which know where on earth it started.
        params: the GPS's parameters, SIM_GPS1_ (4.6: SIM_GPS_) or SIM_GPS2_.
        boot_utc_us: the time of day at boot, us since 1970; 0 if unknown, and no solution has a time then.
        seed: of the random errors.
        falls_silent: whether it sends nothing while it is not enabled, as the second one; the first one has no fix.
    """

    def __init__(
        self,
        airframe: Airframe,
        source: VehicleSource,
        params: ParamGroup,
        boot_utc_us: int = 0,
        seed: int = 0,
        *,
        falls_silent: bool = False,
    ) -> None:
        self._airframe = airframe
        self._source = source
        self._params = params
        names = {row.name for row in params.var_info}
        self._can_be_disabled = "DISABLE" in names
        longer, shorter = ("GLITCH", "LOCKTIME", "DRIFTALT"), ("GLTCH", "LCKTIME", "DRFTALT")
        self._glitch_name, self._lock_name, self._drift_name = longer if names >= {*longer} else shorter
        self._falls_silent = falls_silent
        self._boot_utc_us = boot_utc_us
        self._draw = random.Random(seed)
        self._history = deque([Solution()] * HISTORY, HISTORY)
        self._waiting: tuple[Solution, int] | None = None
        self._published_ms = 0
        self._probed_since_us: int | None = None

    def is_found(self, now_us: int) -> bool:
        """Return whether the firmware that has looked for it since the first call has tried its speed by now.

        FIRMWARE PARITY: of one that was silent it begins when that is enabled, not where it is among its speeds then.
        """
        if self._is_silent():
            self._probed_since_us = None
            return False
        if self._probed_since_us is None:
            self._probed_since_us = now_us
        return now_us - self._probed_since_us >= PROBING_US

    def update(self, now_ms: int) -> None:
        """Make a solution, if it is time to, which ``take`` returns at a later time."""
        hertz = self._params.get_int("HZ")
        if hertz <= 0 or self._is_silent() or now_ms - self._published_ms < 1000 // hertz:
            return
        self._published_ms = now_ms
        self._history.appendleft(self._measure(now_ms))
        self._waiting = self._late(now_ms), now_ms

    def take(self, now_ms: int) -> tuple[Solution, int] | None:
        """Return a solution that has come since the last call, and when it was sent in ms since boot; None if none."""
        if self._waiting is None or now_ms <= self._waiting[1]:
            return None
        waiting, self._waiting = self._waiting, None
        return waiting

    def gps_time(self, now_ms: int) -> tuple[int, int]:
        """Return the week of GPS time and the ms in it, in steps of 200 ms; 0 for both where it is unknown."""
        if not self._boot_utc_us:
            return 0, 0
        gps_ms = self._boot_utc_us // 1000 + now_ms - GPS_EPOCH_UTC_MS
        return gps_ms // MS_PER_WEEK, gps_ms % MS_PER_WEEK // _TIME_STEP_MS * _TIME_STEP_MS

    def _is_on(self) -> bool:
        return self._params.get_int("DISABLE") == 0 if self._can_be_disabled else self._params.get_int("ENABLE") != 0

    def _is_silent(self) -> bool:
        return self._falls_silent and not self._is_on()

    def _vector(self, name: str) -> tuple[float, float, float]:
        x, y, z = (float(self._params.get_float(f"{name}_{axis}")) for axis in "XYZ")
        return x, y, z

    def _measure(self, now_ms: int) -> Solution:
        """Return what it measures now, with errors of height and velocity."""
        params, truth = self._params, self._airframe.truth()
        place = self._source.home.offset(Vector3f(*truth.pos_ned))
        errors = self._vector("VERR")
        pairs = zip(truth.vel_ned, errors, strict=True)
        vel_n, vel_e, vel_d = (speed + most * self._draw.uniform(-1.0, 1.0) for speed, most in pairs)
        alt_m = 0.01 * place.alt_cm + params.get_int("ALT_OFS")
        alt_m += float(params.get_float("NOISE")) * float(sinf(f32(now_ms * 0.0005)))
        alt_m += max(float(params.get_float(self._drift_name)), 0.0) * float(sinf(f32(now_ms * 0.001 * 0.02)))
        has_fix = self._is_on() and now_ms >= 1000 * params.get_int(self._lock_name)
        accuracy_m = float(params.get_float("ACC"))
        satellites = u8(params.get_int("NUMSATS")) if has_fix else SATELLITES_WITHOUT_FIX
        speed_accuracy = math.hypot(*errors[:2])
        position = now_ms, place.lat, place.lng, alt_m
        return Solution(*position, vel_n, vel_e, vel_d, accuracy_m, speed_accuracy, satellites, has_fix)

    def _late(self, now_ms: int) -> Solution:
        """Return what it measured some time ago, with the glitch of now."""
        delay_ms, history = self._params.get_int("LAG_MS"), self._history
        late = history[-1]
        for newer, older in zip(history, list(history)[1:], strict=False):
            newer_ms, older_ms = now_ms - newer.time_ms, now_ms - older.time_ms
            if newer_ms <= delay_ms <= older_ms:
                late = older.toward(newer, (older_ms - delay_ms) / max(1, older_ms - newer_ms))
                break
        lat_deg, lng_deg, alt_m = self._vector(self._glitch_name)
        return late._replace(lat=late.lat + 1e7 * lat_deg, lng=late.lng + 1e7 * lng_deg, alt_m=late.alt_m + alt_m)


class UbloxDriver:
    """The driver: takes the receiver's solutions into the state of the GPS."""

    has_news = True
    lag_s = UBLOX_LAG_S
    introduction = "probing for u-blox at 230400 baud"
    detected = "detected u-blox"

    def __init__(self, receiver: SimulatedGps, state: GpsState) -> None:
        self._receiver = receiver
        self._state = state

    def read(self, now_ms: int) -> bool:
        """Take a solution into the state if one has come; return whether one has (AP_GPS_UBLOX::_parse_gps)."""
        taken = self._receiver.take(now_ms)
        self._receiver.update(now_ms)
        if taken is None:
            return False
        solution, sent_ms = taken
        state = self._state
        state.status = RTK_FIXED if solution.has_fix else NO_FIX
        state.num_sats = solution.satellites
        state.hdop, state.vdop = HDOP, VDOP
        alt_mm = int_of_float(solution.alt_m * 1000.0)
        state.location = Location(int_of_float(solution.lat), int_of_float(solution.lng), int(alt_mm / 10))
        state.velocity = Vector3f(*(_whole_mm(speed) for speed in (solution.vel_n, solution.vel_e, solution.vel_d)))
        state.have_vertical_velocity = True
        north, east, _ = state.velocity.to_tuple()
        state.ground_speed = norm3(f32(0), north, east)
        state.ground_course = wrap_360(degrees(atan2f(east, north)))
        state.horizontal_accuracy = state.vertical_accuracy = _whole_mm(solution.accuracy_m)
        # FIRMWARE PARITY: the receiver sends cm/s where the driver expects mm/s.
        state.speed_accuracy = f32(0.001 * int_of_float(100.0 * solution.speed_accuracy))
        state.time_week, state.time_week_ms = self._receiver.gps_time(sent_ms)
        state.corrected_ms, state.corrected_ms_updated = sent_ms - TRANSPORT_MS, True
        return True


def _whole_mm(metres: float) -> np.float32:
    return f32(0.001 * int_of_float(1000.0 * metres))
