# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of messages about missions, fences and rally points (GCS_Common.cpp)."""

from collections.abc import Callable

from ap_core.location import Location
from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.flight import GUIDED, GuidedTarget
from mav_handlers.handlers.commands.home import above_the_sea
from mav_handlers.handlers.item_transfer import ItemTransfer
from mav_handlers.senders.missions import mission_current_at
from mav_handlers.transfers.mission_items import (
    Cmd,
    MissionItem,
    MissionResult,
    MissionType,
    in_units,
    kept_of_mission,
)
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
    MISSION_SET_CURRENT,
    MISSION_WRITE_PARTIAL_LIST,
)

FOR_GUIDED = 2
FOR_ALTITUDE = 3
"""Values of ``current`` of an item that is no part of a mission."""


def _transfer(ctx: Context, mission_type: int) -> ItemTransfer | None:
    transfers = ctx.vehicle.endpoint.item_transfers
    return next((transfer for kind, transfer in transfers.items() if kind == mission_type), None)


def _acknowledge(ctx: Context, result: MissionResult, mission_type: int) -> Verdict:
    ctx.channel.send(MISSION_ACK(ctx.header.system_id, ctx.header.component_id, result, mission_type))
    return HANDLED


def handle_mission_request_list(ctx: Context, message: MISSION_REQUEST_LIST) -> Verdict:
    """Send the number of items."""
    transfer = _transfer(ctx, message.mission_type)
    if transfer is None:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, message.mission_type)
    if not transfer.needs_mavlink2(ctx):
        transfer.send_count(ctx)
    return HANDLED


def handle_mission_count(ctx: Context, message: MISSION_COUNT) -> Verdict:
    """Begin to request items."""
    transfer = _transfer(ctx, message.mission_type)
    if transfer is None:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, message.mission_type)
    if not transfer.needs_mavlink2(ctx):
        transfer.receive(ctx, message.count)
    return HANDLED


def handle_mission_clear_all(ctx: Context, message: MISSION_CLEAR_ALL) -> Verdict:
    """Delete all items."""
    transfer = _transfer(ctx, message.mission_type)
    if transfer is None:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, message.mission_type)
    transfer.clear(ctx)
    return HANDLED


def handle_mission_write_partial_list(ctx: Context, message: MISSION_WRITE_PARTIAL_LIST) -> Verdict:
    """Begin to request items that replace some."""
    transfer = _transfer(ctx, message.mission_type)
    if transfer is None:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, message.mission_type)
    if not transfer.needs_mavlink2(ctx):
        transfer.receive_part(ctx, message)
    return HANDLED


def handle_mission_item(ctx: Context, message: MISSION_ITEM | MISSION_ITEM_INT) -> Verdict:
    """Keep an item that was requested, or fly to one that is for GUIDED."""
    item = in_units(message) if isinstance(message, MISSION_ITEM) else message
    kind = message.mission_type
    if isinstance(item, MissionResult):
        return _acknowledge(ctx, item, kind)
    if kind == MissionType.MISSION and item.current in (FOR_GUIDED, FOR_ALTITUDE):
        return _acknowledge(ctx, _guide(ctx, item), kind)
    transfer = _transfer(ctx, kind)
    if transfer is None:
        return _acknowledge(ctx, MissionResult.UNSUPPORTED, kind)
    if isinstance(message, MISSION_ITEM):
        transfer.advise_against_degrees()
    transfer.take(ctx, item)
    return HANDLED


def _guide(ctx: Context, message: MISSION_ITEM_INT) -> MissionResult:
    """Fly to an item's place in GUIDED; one that is for the altitude alone does nothing (ModeAuto::do_guided)."""
    item = kept_of_mission(message, checks_delay=ctx.vehicle.release.checks_waypoint_delay)
    if isinstance(item, MissionResult):
        return item
    if message.current == FOR_ALTITUDE:
        return MissionResult.ACCEPTED
    return MissionResult.ACCEPTED if _goes_to(ctx, item) else MissionResult.ERROR


def _goes_to(ctx: Context, item: MissionItem) -> bool:
    copter = ctx.vehicle.copter
    if copter.flight is None or copter.custom_mode() != GUIDED or item.command != Cmd.NAV_WAYPOINT:
        return False
    place = above_the_sea(ctx, Location(item.x, item.y, item.alt_cm), item.frame)
    pos_ned = None if place is None else copter.flight.place_ned(place)
    if pos_ned is None:
        return False
    copter.flight.guide(GuidedTarget(pos_ned_m=pos_ned))
    return True


def handle_mission_request_int(ctx: Context, message: MISSION_REQUEST_INT) -> Verdict:
    """Send an item; a request for one of another kind gets no answer at all."""
    return _send_item(ctx, message, ItemTransfer.send_item_in_units)


def handle_mission_request(ctx: Context, message: MISSION_REQUEST) -> Verdict:
    """Send an item in float32."""
    return _send_item(ctx, message, ItemTransfer.send_item_in_degrees)


def _send_item(
    ctx: Context,
    message: MISSION_REQUEST | MISSION_REQUEST_INT,
    send: Callable[[ItemTransfer, Context, int], object],
) -> Verdict:
    transfer = _transfer(ctx, message.mission_type)
    if transfer is None:
        return MISSION_TYPE
    if not transfer.needs_mavlink2(ctx):
        send(transfer, ctx, message.seq)
    return HANDLED


def handle_mission_set_current(ctx: Context, message: MISSION_SET_CURRENT) -> Verdict:
    """Go on with an item; MISSION_CURRENT with the number asked for confirms it (handle_mission_set_current)."""
    if ctx.vehicle.copter.mission.set_current(message.seq):
        ctx.channel.send(mission_current_at(ctx.vehicle, message.seq))
    return HANDLED
