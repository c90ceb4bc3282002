# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of the parameter protocol (GCS_MAVLink/GCS_Param.cpp)."""

from typing import TYPE_CHECKING, Final

import numpy as np

from ap_core.param import Param, ParamOutcome
from ap_core.verdict import Verdict
from mav_handlers.channel import Channel, ParamListState
from mav_handlers.context import Context
from mav_handlers.verdicts import HANDLED, PARAM_NOT_FINITE, PARAM_QUEUE_FULL, PARAM_READ_ONLY, PARAM_UNKNOWN
from mav_handlers.wire.codec import V2_HEADER_AND_CRC_BYTES, full_length
from mav_handlers.wire.messages import PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET, PARAM_VALUE

if TYPE_CHECKING:
    from mav_handlers.ports import VehiclePort

NO_INDEX: Final = 65535
READ_QUEUE_LENGTH: Final = 20
READS_PER_RUN: Final = 5
RUN_PERIOD_US: Final = 100_000
FIRST_REPLY_US: Final = 20_000

_PARAM_VALUE_BYTES: Final = full_length(PARAM_VALUE) + V2_HEADER_AND_CRC_BYTES
_BANDWIDTH_SHARE: Final = 0.3
# A full list of 1349 took 0.6 s over TCP: the firmware stops after 1 ms of processor time.
_LIST_PER_RUN_FAST: Final = 225
_LIST_PER_RUN_UART: Final = 5
_MAV_SEVERITY_WARNING: Final = 4


def param_value(param: Param, name: str, count: int, index: int) -> PARAM_VALUE:
    """Return the PARAM_VALUE of a parameter under the given name."""
    return PARAM_VALUE(name, float(param.value), param.type.wire_type, count, index)


def handle_param_request_list(ctx: Context, _message: PARAM_REQUEST_LIST) -> Verdict:
    """Introduce the vehicle and start the list at index 0 (handle_param_request_list)."""
    ctx.endpoint.send_banner()
    ctx.channel.param_list = ParamListState(0, ctx.vehicle.params.count, ctx.now_us)
    return HANDLED


def handle_param_request_read(ctx: Context, message: PARAM_REQUEST_READ) -> Verdict:
    """Queue the reply to a read; unknown parameters get none (handle_param_request_read)."""
    reads = ctx.channel.param_reads
    if len(reads) >= READ_QUEUE_LENGTH:
        return PARAM_QUEUE_FULL
    params = ctx.vehicle.params
    by_name = message.param_index < 0
    found = params.find(message.param_id) if by_name else params.by_index(message.param_index)
    if found is None:
        return PARAM_UNKNOWN
    if not reads:
        ctx.channel.param_reads_due_us = max(ctx.now_us + FIRST_REPLY_US, ctx.channel.param_reads_due_us)
    index = NO_INDEX if by_name else message.param_index
    reads.append(param_value(found, found.name, params.count, index))
    return HANDLED


def handle_param_set(ctx: Context, message: PARAM_SET) -> Verdict:
    """Change a parameter by its stored type, and echo it to every active link (handle_param_set)."""
    params = ctx.vehicle.params
    result = params.set_from_mavlink(message.param_id, np.float32(message.param_value))
    if result.outcome is ParamOutcome.UNKNOWN:
        return PARAM_UNKNOWN
    if result.outcome is ParamOutcome.NOT_FINITE:
        return PARAM_NOT_FINITE
    if result.outcome is ParamOutcome.READ_ONLY:
        text = f"Param write denied ({message.param_id})"
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_WARNING, text)
        for echo in result.echoes:
            reply = PARAM_VALUE(echo.name, float(echo.value), echo.wire_type, params.count, NO_INDEX)
            ctx.channel.send(reply)
        return PARAM_READ_ONLY
    # One record as the sender spelled it; the echoes write theirs when they leave.
    ctx.vehicle.log.parameter(message.param_id, result.value)
    ctx.endpoint.echo_parameters(result.echoes)
    return HANDLED


def pump_param_reads(channel: Channel, now_us: int) -> None:
    """Send waiting replies, at most five every 100 ms (send_parameter_async_replies)."""
    if not channel.param_reads or now_us < channel.param_reads_due_us:
        return
    for _ in range(min(READS_PER_RUN, len(channel.param_reads))):
        if not channel.send(channel.param_reads[0]):
            return
        channel.param_reads.popleft()
    channel.param_reads_due_us = now_us + RUN_PERIOD_US


def _list_quota(channel: Channel, elapsed_us: int) -> int:
    if channel.baud is None:
        return _LIST_PER_RUN_FAST
    bytes_allowed = channel.baud / 10 * _BANDWIDTH_SHARE * elapsed_us * 1e-6
    return max(1, min(_LIST_PER_RUN_UART, int(bytes_allowed // _PARAM_VALUE_BYTES)))


def pump_param_list(vehicle: "VehiclePort", channel: Channel, now_us: int) -> None:
    """Send the next part of a running list (queued_param_send)."""
    state = channel.param_list
    if state is None or now_us - state.last_run_us < RUN_PERIOD_US:
        return
    quota = _list_quota(channel, now_us - state.last_run_us)
    state.last_run_us = now_us
    for _ in range(quota):
        param = vehicle.params.by_index(state.next_index)
        if param is None or state.next_index >= state.count:
            channel.param_list = None
            return
        if not channel.has_room():
            return
        channel.send(param_value(param, param.name, state.count, state.next_index))
        state.next_index += 1
    if state.next_index >= state.count:
        channel.param_list = None
