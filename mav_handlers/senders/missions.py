# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the mission is, and how far it is to the target (GCS_Common.cpp, ArduCopter/GCS_MAVLink_Copter.cpp)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from ap_core.cint import u16
from ap_core.fmath import degrees
from mav_handlers.channel import Channel
from mav_handlers.senders.attitude import euler_rad
from mav_handlers.senders.builder import i16_of
from mav_handlers.wire.messages import MISSION_CURRENT, MISSION_ITEM_REACHED, NAV_CONTROLLER_OUTPUT

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

STATE_NO_MISSION: Final = 1
_AUTO: Final = 3
_MOST_U16: Final = 65535


def mission_current_at(vehicle: Vehicle, seq: int) -> MISSION_CURRENT:
    """Return MISSION_CURRENT with an item's number; home does not count (GCS_MAVLINK::send_mission_current)."""
    mission = vehicle.copter.mission
    total = mission.count()
    state = mission.state if total > 1 else STATE_NO_MISSION
    return MISSION_CURRENT(seq, max(total - 1, 0), state, int(vehicle.copter.custom_mode() == _AUTO))


def mission_current(vehicle: Vehicle, _channel: Channel, _now_us: int) -> MISSION_CURRENT:
    """The current navigation command, 0 if there is none, and the mission's state."""
    return mission_current_at(vehicle, vehicle.copter.mission.nav_seq)


def mission_item_reached(vehicle: Vehicle, _channel: Channel, _now_us: int) -> MISSION_ITEM_REACHED:
    """The command that was done last (GCS::send_mission_item_reached_message)."""
    return MISSION_ITEM_REACHED(u16(vehicle.copter.mission.reached_seq))


def nav_controller_output(vehicle: Vehicle, _channel: Channel, _now_us: int) -> NAV_CONTROLLER_OUTPUT | None:
    """The present attitude in degrees as the target, and the way to the target, once the vehicle is initialised.

    Source: GCS_MAVLINK_Copter::send_nav_controller_output.
    """
    # FIRMWARE PARITY: the firmware also has the attitude that it wants, and how far off the height is.
    copter = vehicle.copter
    if not copter.has_booted:
        return None
    roll, pitch, yaw = map(degrees, euler_rad(vehicle).to_tuple())
    north, east = (0.0, 0.0) if copter.flight is None else copter.flight.way_to_target()
    bearing = int(math.degrees(math.atan2(east, north)) % 360)
    distance = min(int(math.hypot(north, east)), _MOST_U16)
    return NAV_CONTROLLER_OUTPUT(float(roll), float(pitch), i16_of(yaw), bearing, distance, 0.0, 0.0, 0.0)
