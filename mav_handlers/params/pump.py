# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameter turn of a link: replies to reads, then the next part of a list (GCS_Param.cpp, queued_param_send)."""

from typing import Final

from ap_core.param import ParamTable
from mav_handlers.channel import Channel, ParamListState
from mav_handlers.params.reads import ParamReads, param_value
from mav_handlers.radio import RadioLink
from mav_handlers.wire.codec import full_length
from mav_handlers.wire.messages import PARAM_VALUE

# The bandwidth that AP_Networking and the simulator's sockets report.
NETWORK_BYTES_PER_SECOND: Final = 1_000_000
PER_RUN_WITHOUT_FLOW_CONTROL: Final = 5
TXBUF_LIMIT: Final = 33
# A share of 30 % in a second of 1000 ms.
_BANDWIDTH_DIVISOR: Final = 3333


def start_param_list(params: ParamTable, channel: Channel, now_us: int) -> None:
    """Begin a list at index 0, also when one is running (GCS_MAVLINK::handle_param_request_list)."""
    channel.param_list = ParamListState(0, params.count)
    channel.params_sent_us = now_us


def _list_quota(channel: Channel, now_us: int) -> int:
    size = full_length(PARAM_VALUE) + channel.overhead_bytes(now_us)
    bandwidth = NETWORK_BYTES_PER_SECOND if channel.baud is None else channel.baud // 10
    elapsed_ms = now_us // 1000 - channel.params_sent_us // 1000
    allowed = max(bandwidth * elapsed_ms // _BANDWIDTH_DIVISOR, size)
    count = min(allowed, channel.txspace()) // size
    return count if channel.baud is None else min(count, PER_RUN_WITHOUT_FLOW_CONTROL)


def pump_params(params: ParamTable, channel: Channel, reads: ParamReads, radio: RadioLink, now_us: int) -> None:
    """Send replies that wait or, when there are none, the next part of a running list."""
    if reads.send(now_us):
        # The bandwidth share counts from the last reply, so none of this turn is left for the list.
        channel.params_sent_us = now_us
        return
    if channel.param_list is None:
        return
    for _ in range(_list_quota(channel, now_us)):
        if channel.param_list is None or not radio.txbuf_is_greater(TXBUF_LIMIT, now_us):
            break
        _send_next(params, channel, channel.param_list)
    channel.params_sent_us = now_us


def _send_next(params: ParamTable, channel: Channel, state: ParamListState) -> None:
    # A list ends with the parameter that is last now, whatever count was sent at its start.
    param = params.by_index(state.next_index)
    if param is not None:
        channel.send(param_value(param, param.name, state.count, state.next_index))
        state.next_index += 1
    if state.next_index >= params.count:
        channel.param_list = None
