# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Missions, fences and rally points (GCS_Common.cpp, MissionItemProtocol.cpp, AP_Mission.cpp).

FIRMWARE PARITY: there is no storage for them. Home is the only item; uploads are refused as too large.
"""

from enum import IntEnum
from typing import Final

import numpy as np

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.verdicts import HANDLED, MISSION_TYPE
from mav_handlers.wire.messages import (
    MISSION_ACK,
    MISSION_CLEAR_ALL,
    MISSION_COUNT,
    MISSION_ITEM,
    MISSION_ITEM_INT,
    MISSION_REQUEST,
    MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST,
    MISSION_WRITE_PARTIAL_LIST,
)

MAV_CMD_NAV_WAYPOINT: Final = 16
MAV_FRAME_GLOBAL: Final = 0
MAX_ITEMS: Final = 0

_CENTI: Final = f32(0.01)
_DEGREES_PER_UNIT: Final = f32(1.0e-7)
_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_INFO: Final = 6


class MissionType(IntEnum):
    """MAV_MISSION_TYPE values that the firmware supports."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT values used here."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID_SEQUENCE = 13


class Mission:
    """Holds home, the first item of every mission, and nothing else.

    Args:
        counts_home: whether home counts as an item (``EndpointRelease.counts_home``).

    Attributes:
        item_count: 1 once home is set, if it counts; 0 before, and after the mission was cleared.
        warned_of_request: the text that recommends MISSION_REQUEST_INT was sent.
        warned_of_item: the text that recommends MISSION_ITEM_INT was sent.
    """

    def __init__(self, *, counts_home: bool = True) -> None:
        self._counts_home = counts_home
        self.item_count = 0
        self.warned_of_request = False
        self.warned_of_item = False

    def add_home(self) -> None:
        """Store home as the first item (AP_Mission::write_home_to_storage)."""
        self.item_count = int(self._counts_home)

    def clear(self) -> None:
        """Delete all items; home returns when it is next set (AP_Mission::clear)."""
        self.item_count = 0


_SUPPORTED: Final = frozenset(MissionType)


def _warn(ctx: Context, text: str) -> None:
    ctx.vehicle.texts.send_text(_MAV_SEVERITY_WARNING, text)


def _acknowledge(ctx: Context, result: MissionResult, mission_type: int) -> Verdict:
    ctx.channel.send(MISSION_ACK(ctx.header.system_id, ctx.header.component_id, result, mission_type))
    return HANDLED


def _send_count(ctx: Context, mission_type: int) -> Verdict:
    count = ctx.vehicle.copter.mission.item_count if mission_type == MissionType.MISSION else 0
    ctx.channel.send(MISSION_COUNT(ctx.header.system_id, ctx.header.component_id, count, mission_type))
    return HANDLED


def _refusal(ctx: Context, mission_type: int) -> Verdict | None:
    """Answer a request that its type or link does not support (get_prot_for_mission_type, mavlink2_requirement_met)."""
    if mission_type not in _SUPPORTED:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, mission_type)
    return _needs_mavlink2(ctx, mission_type)


def _needs_mavlink2(ctx: Context, mission_type: int) -> Verdict | None:
    if mission_type == MissionType.MISSION or ctx.channel.codec.version == 2:
        return None
    _warn(ctx, "Need mavlink2 for item transfer")
    return _acknowledge(ctx, MissionResult.UNSUPPORTED, mission_type)


def handle_mission_request_list(ctx: Context, message: MISSION_REQUEST_LIST) -> Verdict:
    """Send the number of items."""
    return _refusal(ctx, message.mission_type) or _send_count(ctx, message.mission_type)


def handle_mission_count(ctx: Context, message: MISSION_COUNT) -> Verdict:
    """Accept an empty list; there is no storage for any other."""
    refusal = _refusal(ctx, message.mission_type)
    if refusal is not None:
        return refusal
    if message.count > MAX_ITEMS:
        _acknowledge(ctx, MissionResult.NO_SPACE, message.mission_type)
        _warn(ctx, f"Only {MAX_ITEMS} items are supported")
        return HANDLED
    if message.mission_type == MissionType.MISSION:
        ctx.vehicle.copter.mission.clear()
        ctx.vehicle.texts.send_text_to(ctx.channel.index, _MAV_SEVERITY_INFO, "Flight plan received")
    return _acknowledge(ctx, MissionResult.ACCEPTED, message.mission_type)


def handle_mission_clear_all(ctx: Context, message: MISSION_CLEAR_ALL) -> Verdict:
    """Delete all items."""
    if message.mission_type not in _SUPPORTED:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, message.mission_type)
    if message.mission_type == MissionType.MISSION:
        ctx.vehicle.copter.mission.clear()
    return _acknowledge(ctx, MissionResult.ACCEPTED, message.mission_type)


def handle_mission_write_partial_list(ctx: Context, message: MISSION_WRITE_PARTIAL_LIST) -> Verdict:
    """Refuse to replace items."""
    refusal = _refusal(ctx, message.mission_type)
    if refusal is not None:
        return refusal
    _warn(ctx, "Flight plan update rejected")
    return _acknowledge(ctx, MissionResult.ERROR, message.mission_type)


def handle_mission_item(ctx: Context, message: MISSION_ITEM | MISSION_ITEM_INT) -> Verdict:
    """Refuse an item, because none was requested."""
    if message.mission_type not in _SUPPORTED:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, message.mission_type)
    mission = ctx.vehicle.copter.mission
    if isinstance(message, MISSION_ITEM) and not mission.warned_of_item:
        mission.warned_of_item = True
        _warn(ctx, "got MISSION_ITEM; GCS should send MISSION_ITEM_INT")
    return _acknowledge(ctx, MissionResult.ERROR, message.mission_type)


def _request_refusal(ctx: Context, mission_type: int) -> Verdict | None:
    # An item of an unsupported type gets no answer at all.
    return _needs_mavlink2(ctx, mission_type) if mission_type in _SUPPORTED else MISSION_TYPE


def _has_item(message: MISSION_REQUEST | MISSION_REQUEST_INT) -> bool:
    # Home can always be read; it is zeros while unset.
    return message.mission_type == MissionType.MISSION and message.seq == 0


def _no_such_item(ctx: Context, message: MISSION_REQUEST | MISSION_REQUEST_INT, *, sends_count: bool) -> Verdict:
    # MissionItemProtocol::handle_mission_request_int, handle_mission_request and get_item
    result = MissionResult.INVALID_SEQUENCE
    if ctx.vehicle.release.tells_bad_items_by_type:
        sends_count = message.mission_type == MissionType.MISSION
        if sends_count or (message.mission_type == MissionType.FENCE and message.seq == 0):
            result = MissionResult.ERROR
    if sends_count:
        _send_count(ctx, message.mission_type)
    return _acknowledge(ctx, result, message.mission_type)


def _home(ctx: Context) -> tuple[Location, np.float32]:
    home = ctx.vehicle.copter.home.place or Location(0, 0, 0)
    return home, f32(f32(home.alt_cm) * _CENTI)


def handle_mission_request_int(ctx: Context, message: MISSION_REQUEST_INT) -> Verdict:
    """Send home; a request for any other item gets the count and an error."""
    refusal = _request_refusal(ctx, message.mission_type)
    if refusal is not None:
        return refusal
    if not _has_item(message):
        return _no_such_item(ctx, message, sends_count=True)
    home, alt_m = _home(ctx)
    sender = ctx.header.system_id, ctx.header.component_id
    command = MAV_FRAME_GLOBAL, MAV_CMD_NAV_WAYPOINT
    ctx.channel.send(MISSION_ITEM_INT(*sender, 0, *command, 0, 1, 0.0, 0.0, 0.0, 0.0, home.lat, home.lng, float(alt_m)))
    return HANDLED


def handle_mission_request(ctx: Context, message: MISSION_REQUEST) -> Verdict:
    """Send home in float32, where degrees are accurate to metres only, and recommend MISSION_REQUEST_INT once."""
    refusal = _request_refusal(ctx, message.mission_type)
    if refusal is not None:
        return refusal
    if not _has_item(message):
        return _no_such_item(ctx, message, sends_count=False)
    mission = ctx.vehicle.copter.mission
    if not mission.warned_of_request:
        mission.warned_of_request = True
        _warn(ctx, "got MISSION_REQUEST; use MISSION_REQUEST_INT!")
    home, alt_m = _home(ctx)
    sender = ctx.header.system_id, ctx.header.component_id
    command = MAV_FRAME_GLOBAL, MAV_CMD_NAV_WAYPOINT
    lat_deg, lng_deg = float(f32(home.lat) * _DEGREES_PER_UNIT), float(f32(home.lng) * _DEGREES_PER_UNIT)
    ctx.channel.send(MISSION_ITEM(*sender, 0, *command, 0, 1, 0.0, 0.0, 0.0, 0.0, lat_deg, lng_deg, float(alt_m)))
    return HANDLED
