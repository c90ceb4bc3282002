# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a recording of a link begins by the autopilot's own clock."""

from dataclasses import replace
from typing import Final

from viso.streams.heard import MAV_COMP_ID_AUTOPILOT1, is_autopilot
from viso.streams.stream import Stream, StreamMessage, received_in

_TIMED: Final = ("SYSTEM_TIME", "ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
_COMPARED_US: Final = 10_000_000  # the quickest message of so long counts: the others waited


def boot_time_us(stream: Stream) -> int | None:
    """Return the time since boot at which a stream's first message came, as the autopilot's messages show it.

    Negative if that was before the boot; None if no message carries the autopilot's clock.
    """
    system_id, first_us, found_us = None, None, None
    for number, (header, message) in received_in(stream, {"HEARTBEAT", *_TIMED}):
        arrival_us = stream.messages[number].arrival_us or 0
        if first_us is not None and arrival_us - first_us > _COMPARED_US:
            break
        if system_id is None and is_autopilot(header.component_id, message):
            system_id = header.system_id
        boot_ms = getattr(message, "time_boot_ms", 0)
        if boot_ms and header.component_id == MAV_COMP_ID_AUTOPILOT1 and system_id in (None, header.system_id):
            first_us = arrival_us if first_us is None else first_us
            begins_us = 1000 * boot_ms - (arrival_us - stream.begins_us)
            found_us = begins_us if found_us is None else max(found_us, begins_us)
    return found_us


def begun_at(stream: Stream, begins_us: int) -> Stream:
    """Return a stream whose first message comes at a time in us since boot; none comes before boot."""
    by_us = begins_us - stream.begins_us
    messages = tuple(
        StreamMessage(None if one.arrival_us is None else max(one.arrival_us + by_us, 0), one.frame)
        for one in stream.messages
    )
    return replace(stream, messages=messages)
