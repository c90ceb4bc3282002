# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that ask for messages, once or at a rate."""

from typing import Final

from ap_core.cint import int_of_float
from ap_core.fmath import f32, is_zero
from mav_handlers.channel import MAX_INTERVAL_MS, Context
from mav_handlers.handlers.commands.results import MavResult, u32_of_float
from mav_handlers.senders.intervals import MIN_INTERVAL_MS, can_send, default_interval_ms, set_interval
from mav_handlers.senders.status import MONITOR_INTERVAL_MS, request_modes
from mav_handlers.wire.codec import message_name
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_INT, MESSAGE_INTERVAL

MESSAGE_INTERVAL_ID: Final = 244

_MAV_SEVERITY_INFO: Final = 6


def set_message_interval(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Set a message's interval in us; -1 stops it, 0 restores the default (set_message_interval)."""
    if not is_zero(f32(command.param3)):
        return MavResult.DENIED
    msg_id, interval_us = u32_of_float(command.param1), int_of_float(command.param2)
    name = message_name(msg_id)
    if not can_send(name, ctx.vehicle.release):
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"No ap_message for mavlink id ({msg_id})")
        return MavResult.DENIED
    if interval_us < -1:
        return MavResult.DENIED
    interval_ms: int | None = min(max(interval_us // 1000, 1), MAX_INTERVAL_MS)
    if interval_us == 0:
        interval_ms = default_interval_ms(ctx.vehicle, ctx.channel, name)
    elif interval_us == -1:
        interval_ms = None
    if interval_ms is not None and interval_ms < MIN_INTERVAL_MS:
        text = f"Requested rate for message ID {msg_id} too fast. Increase SCHED_LOOP_RATE"
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, text)
        return MavResult.DENIED
    set_interval(ctx.channel, name, interval_ms, ctx.now_us)
    return MavResult.ACCEPTED


def _tell_message_interval(ctx: Context, wanted: float) -> MavResult:
    channel = ctx.channel
    if not channel.has_space_for(MESSAGE_INTERVAL, ctx.now_us) or not channel.has_space_for(COMMAND_ACK, ctx.now_us):
        return MavResult.TEMPORARILY_REJECTED
    msg_id = u32_of_float(wanted)
    name = message_name(msg_id)
    if msg_id >= 65536 or not can_send(name, ctx.vehicle.release):
        ctx.channel.send(MESSAGE_INTERVAL(msg_id & 0xFFFF, 0))
        return MavResult.FAILED
    interval_ms = ctx.channel.intervals_ms.get(name)
    ctx.channel.send(MESSAGE_INTERVAL(msg_id, -1 if interval_ms is None else interval_ms * 1000))
    return MavResult.ACCEPTED


def get_message_interval(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Send a message's interval before the acknowledgement."""
    return _tell_message_interval(ctx, command.param1)


def request_message(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Queue a message to be sent once, after the acknowledgement; it is left out if it has no content."""
    msg_id = u32_of_float(command.param1)
    if msg_id == MESSAGE_INTERVAL_ID and ctx.vehicle.release.tells_interval_on_request:
        return _tell_message_interval(ctx, command.param2)
    name = message_name(msg_id)
    if not can_send(name, ctx.vehicle.release):
        return MavResult.FAILED
    if name == "AVAILABLE_MODES":
        request_modes(ctx.channel, command.param2)
        set_interval(ctx.channel, "AVAILABLE_MODES_MONITOR", MONITOR_INTERVAL_MS, ctx.now_us)
    ctx.channel.request(name)
    return MavResult.ACCEPTED
