# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of range finders and optical flow (GCS_MAVLink/GCS_Common.cpp)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ap_core.fmath import f32
from mav_handlers.channel import Channel
from mav_handlers.senders.builder import boot_ms, i16_of
from mav_handlers.wire.messages import DISTANCE_SENSOR, OPTICAL_FLOW, RANGEFINDER

if TYPE_CHECKING:
    from viso.vehicle.ranges import RangeReport
    from viso.vehicle.vehicle import Vehicle

_MOST_CM: Final = f32(65535)
_HUNDRED: Final = f32(100)
_UNKNOWN_QUALITY: Final = -1


def rangefinder(vehicle: Vehicle, _channel: Channel, _now_us: int) -> RANGEFINDER | None:
    """Range in m and voltage of the downward range finder, if there is one (GCS_MAVLINK::send_rangefinder)."""
    seen = vehicle.ranges.downward()
    return None if seen is None else RANGEFINDER(*seen)


def distance_sensor(vehicle: Vehicle, channel: Channel, now_us: int) -> DISTANCE_SENSOR | None:
    """One message for each range finder (GCS_MAVLINK::send_distance_sensor)."""
    *others, last = [None, *(_distance_of(report, now_us) for report in vehicle.ranges.reports())]
    for message in others:
        if message is not None:
            channel.send(message)
    return last


def _distance_of(report: RangeReport, now_us: int) -> DISTANCE_SENSOR:
    least, most, distance = map(_cm, (report.least, report.most, report.distance))
    quality = 0 if report.quality == _UNKNOWN_QUALITY else report.quality if 1 < report.quality <= 100 else 1
    return DISTANCE_SENSOR(
        boot_ms(now_us),
        least,
        most,
        distance,
        report.kind,
        report.number,
        report.orientation,
        0,
        signal_quality=quality,
    )


def _cm(metres: float) -> int:
    return int(min(max(f32(metres) * _HUNDRED, f32(0)), _MOST_CM))


def optical_flow(vehicle: Vehicle, _channel: Channel, now_us: int) -> OPTICAL_FLOW | None:
    """Flow in rad/s, with and without the vehicle's rotation, while the sensor works.

    The integer fields lose nearly all of its precision. The time is in ms, despite the field's name.

    Source: GCS_MAVLINK::send_opticalflow.
    """
    if not vehicle.flow.healthy():
        return None
    newest, height_m = vehicle.flow.newest, vehicle.ahrs.height_above_ground()
    x, y = map(f32, newest.flow)
    turn_x, turn_y = map(f32, newest.gyro)
    return OPTICAL_FLOW(
        time_usec=boot_ms(now_us),
        sensor_id=0,
        flow_x=i16_of(x),
        flow_y=i16_of(y),
        flow_comp_m_x=float(x - turn_x),
        flow_comp_m_y=float(y - turn_y),
        quality=newest.quality,
        ground_distance=height_m or 0.0,
        flow_rate_x=float(x),
        flow_rate_y=float(y),
    )
