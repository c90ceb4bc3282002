# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Answers to PARAM_REQUEST_READ: two short queues that all links share.

Source: GCS_MAVLink/GCS_Param.cpp (handle_param_request_read, param_io_timer, send_parameter_async_replies).
"""

from collections import deque
from dataclasses import dataclass
from typing import Final

from ap_core.cint import u16
from ap_core.param import Param, ParamTable
from mav_handlers.channel import Channel
from mav_handlers.wire.messages import PARAM_ERROR, PARAM_REQUEST_READ, PARAM_VALUE

NO_INDEX: Final = 65535
BY_NAME: Final = -1
READ_QUEUE_LENGTH: Final = 20
REPLY_QUEUE_LENGTH: Final = 5
MAV_PARAM_ERROR_DOES_NOT_EXIST: Final = 1


@dataclass(frozen=True, slots=True)
class _Read:
    channel: Channel
    sender: tuple[int, int]
    request: PARAM_REQUEST_READ


def find_requested(params: ParamTable, request: PARAM_REQUEST_READ) -> Param | None:
    """Return the requested parameter: by name if the index is -1, else by index."""
    if request.param_index == BY_NAME:
        return params.find(request.param_id)
    return params.by_index(u16(request.param_index))


def param_value(param: Param, name: str, count: int, index: int) -> PARAM_VALUE:
    """Return the PARAM_VALUE of a parameter under the given name."""
    return PARAM_VALUE(name, float(param.value), param.type.wire_type, count, index)


class ParamReads:
    """Requests that wait for a look-up, one every millisecond, and replies that wait for a link's parameter turn.

    Without ``tells_errors`` a request for an unknown parameter gets no answer.
    """

    def __init__(self, *, tells_errors: bool = False) -> None:
        self._tells_errors = tells_errors
        self._reads: deque[_Read] = deque()
        self._replies: deque[tuple[Channel, PARAM_VALUE | PARAM_ERROR]] = deque()

    @property
    def waiting(self) -> int:
        """The number of requests not yet looked up."""
        return len(self._reads)

    def request(
        self, channel: Channel, request: PARAM_REQUEST_READ, now_us: int, sender: tuple[int, int] = (0, 0)
    ) -> bool:
        """Queue a request of a system and component; False when 20 wait already.

        A link without room starts to reserve some for parameters.
        """
        if len(self._reads) >= READ_QUEUE_LENGTH:
            return False
        if not channel.has_space_for(PARAM_VALUE):
            channel.reserve.start(now_us)
        self._reads.append(_Read(channel, sender, request))
        return True

    def look_up(self, params: ParamTable, last_us: int, now_us: int) -> None:
        """Turn requests into replies, one for each millisecond since the last call, while fewer than 5 wait."""
        turns = now_us // 1000 - last_us // 1000
        while turns > 0 and self._reads and len(self._replies) < REPLY_QUEUE_LENGTH:
            self._look_up_one(params, self._reads.popleft())
            turns -= 1

    def _look_up_one(self, params: ParamTable, read: _Read) -> None:
        request = read.request
        found = find_requested(params, request)
        if found is not None:
            value = param_value(found, found.name, params.count, u16(request.param_index))
            self._replies.append((read.channel, value))
        elif self._tells_errors:
            # A request by index has no name.
            name = request.param_id if request.param_index == BY_NAME else ""
            error = PARAM_ERROR(*read.sender, name, request.param_index, MAV_PARAM_ERROR_DOES_NOT_EXIST)
            self._replies.append((read.channel, error))

    def send(self, now_us: int) -> bool:
        """Send all replies, at most five, each to its requester; return whether there were any.

        A full link delays the replies behind it, for other links too.
        """
        waiting = len(self._replies)
        while self._replies:
            channel, reply = self._replies[0]
            if not channel.has_space_for(type(reply)):
                channel.reserve.start(now_us)
                break
            channel.send(reply)
            self._replies.popleft()
        return len(self._replies) < waiting
