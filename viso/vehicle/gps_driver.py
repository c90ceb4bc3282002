# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a GPS_INPUT message does to the state of the GPS (AP_GPS/AP_GPS_MAV.cpp)."""

from dataclasses import dataclass, field
from enum import IntFlag
from typing import Final

import numpy as np

from ap_core.cint import int_of_float, u16, u32
from ap_core.fmath import atan2f, degrees, f32, norm3, wrap_360
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import FIX_3D, USUAL_LAG_S
from mav_handlers.jitter_correction import JitterCorrection
from mav_handlers.wire.messages import GPS_INPUT

UNKNOWN_DOP: Final = 65535
MAX_LAG_MS: Final = 2000
MS_PER_WEEK: Final = 604_800_000

_CENTI: Final = f32(0.01)
_HUNDRED: Final = f32(100)


class Ignore(IntFlag):
    """Fields of GPS_INPUT that are not to be used (MAVLink, GPS_INPUT_IGNORE_FLAGS)."""

    ALT = 1
    HDOP = 2
    VDOP = 4
    VEL_HORIZ = 8
    VEL_VERT = 16
    SPEED_ACCURACY = 32
    HORIZONTAL_ACCURACY = 64
    VERTICAL_ACCURACY = 128


@dataclass(slots=True)
class GpsState:
    """What is known of the GPS; what a message leaves out keeps its value (AP_GPS.h, GPS_State).

    Speeds in m/s, course and yaw in degrees from north, accuracies in m and m/s, dilutions x 100. ``corrected_ms`` is
    the time since boot at which the newest solution was made.
    """

    status: int = 0
    time_week: int = 0
    time_week_ms: int = 0
    location: Location = field(default_factory=lambda: Location(0, 0, 0))
    velocity: Vector3f = field(default_factory=Vector3f)
    ground_speed: np.float32 = field(default_factory=lambda: f32(0))
    ground_course: np.float32 = field(default_factory=lambda: f32(0))
    hdop: int = UNKNOWN_DOP
    vdop: int = UNKNOWN_DOP
    num_sats: int = 0
    have_vertical_velocity: bool = False
    speed_accuracy: np.float32 | None = None
    horizontal_accuracy: np.float32 | None = None
    vertical_accuracy: np.float32 | None = None
    yaw_deg: np.float32 | None = None
    corrected_ms: int = 0
    corrected_ms_updated: bool = False
    announced: bool = False


class MavlinkGpsDriver:
    """The driver of GPSn_TYPE 14: takes messages, and reports once that there are new ones.

    ``has_news`` says whether there are some of which ``read`` has not told.
    """

    lag_s = USUAL_LAG_S
    introduction = "specified as MAV"
    detected = "detected MAV"

    def __init__(self) -> None:
        self.has_news = False
        self._first_week = 0
        self._jitter = JitterCorrection(MAX_LAG_MS)

    def read(self, now_ms: int) -> bool:
        """Tell, once, that there is new data (AP_GPS_MAV::read)."""
        new_data, self.has_news = self.has_news, False
        return new_data

    def handle(self, packet: GPS_INPUT, state: GpsState, now_ms: int) -> None:
        """Take a message into the state, at ``now_ms`` since boot (AP_GPS_MAV::handle_msg)."""
        ignored = Ignore(packet.ignore_flags)
        state.time_week = packet.time_week
        state.time_week_ms = packet.time_week_ms
        state.status = packet.fix_type
        with np.errstate(all="ignore"):
            alt_cm = 0 if Ignore.ALT in ignored else int_of_float(float(f32(packet.alt) * _HUNDRED))
            state.location = Location(packet.lat, packet.lon, alt_cm)
            _take_dilutions(packet, ignored, state)
            if Ignore.VEL_HORIZ not in ignored:
                _take_velocity(packet, ignored, state)
        _take_accuracies(packet, ignored, state)
        if packet.yaw != 0:
            state.yaw_deg = wrap_360(f32(f32(packet.yaw) * _CENTI))
        if packet.fix_type >= FIX_3D and packet.time_week > 0:
            self._correct_time(packet, state, now_ms)
        state.num_sats = packet.satellites_visible
        self.has_news = True

    def _correct_time(self, packet: GPS_INPUT, state: GpsState, now_ms: int) -> None:
        if self._first_week == 0:
            self._first_week = packet.time_week
        timestamp_ms = u32((packet.time_week - self._first_week) * MS_PER_WEEK + packet.time_week_ms)
        corrected_us = self._jitter.correct_offboard_timestamp_usec(timestamp_ms * 1000, now_ms * 1000)
        state.corrected_ms = u32(corrected_us // 1000)
        state.corrected_ms_updated = True


def _take_dilutions(packet: GPS_INPUT, ignored: Ignore, state: GpsState) -> None:
    if Ignore.HDOP not in ignored:
        state.hdop = _dilution(packet.hdop)
    if Ignore.VDOP not in ignored:
        state.vdop = _dilution(packet.vdop)


def _dilution(value: float) -> int:
    return u16(int_of_float(float(f32(value) * _HUNDRED)))


def _take_velocity(packet: GPS_INPUT, ignored: Ignore, state: GpsState) -> None:
    has_vertical = Ignore.VEL_VERT not in ignored
    state.velocity = Vector3f(packet.vn, packet.ve, packet.vd if has_vertical else 0.0)
    state.have_vertical_velocity |= has_vertical
    north, east, _ = state.velocity.to_tuple()
    state.ground_course = wrap_360(degrees(atan2f(east, north)))
    state.ground_speed = norm3(f32(0), north, east)


def _take_accuracies(packet: GPS_INPUT, ignored: Ignore, state: GpsState) -> None:
    if Ignore.SPEED_ACCURACY not in ignored:
        state.speed_accuracy = f32(packet.speed_accuracy)
    if Ignore.HORIZONTAL_ACCURACY not in ignored:
        state.horizontal_accuracy = f32(packet.horiz_accuracy)
    if Ignore.VERTICAL_ACCURACY not in ignored:
        state.vertical_accuracy = f32(packet.vert_accuracy)
