# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording over which the autopilot was rebooted holds several flights, each with a time since boot of its own.

Its clock, which many of its messages carry, falls back then. Alignment, resets, parameters that need a reboot all begin
again.
"""

from dataclasses import replace
from typing import Final

from mav_handlers.handlers import VISION_NAMES
from mav_handlers.wire.messages import MESSAGES
from viso.streams.boot_time import begun_at, boot_time_us
from viso.streams.heard import MAV_COMP_ID_AUTOPILOT1, is_autopilot, params_heard
from viso.streams.stream import Stream, received_in

LEAST_STEP_BACK_MS: Final = 2_000
"""Datagrams may overtake each other, by less."""
_WRAP_MS: Final = 1 << 31
_TIMED: Final = tuple(name for name, cls in MESSAGES.items() if "time_boot_ms" in cls.__dataclass_fields__)


def _starts(stream: Stream) -> list[int]:
    """Return where sessions begin, behind the last message with a time of the one before."""
    system_id, starts, latest_ms, behind = None, [0], -1, 0
    for number, (header, message) in received_in(stream, {"HEARTBEAT", *_TIMED}):
        if system_id is None and is_autopilot(header.component_id, message):
            system_id = header.system_id
        boot_ms = getattr(message, "time_boot_ms", None)
        sender = header.system_id, header.component_id
        if sender != (system_id, MAV_COMP_ID_AUTOPILOT1) or not isinstance(boot_ms, int):
            continue
        if LEAST_STEP_BACK_MS < latest_ms - boot_ms < _WRAP_MS:
            starts.append(behind)
            latest_ms = boot_ms
        latest_ms = max(latest_ms, boot_ms) if latest_ms - boot_ms < _WRAP_MS else boot_ms
        behind = number + 1
    return starts


def _all_params(stream: Stream, end: int) -> dict[str, float]:
    """Return what the autopilot's parameters were at a message, if the whole list was heard before; else nothing."""
    heard = params_heard(stream, end)
    return {one.name: one.value for one in heard.values} if heard.has_all else {}


def _part(stream: Stream, start: int, end: int) -> Stream:
    params = stream.params or (_all_params(stream, start) if start else {})
    part = replace(stream, messages=stream.messages[start:end], params=params)
    begins_us = boot_time_us(part)
    return begun_at(part, stream.begins_us if begins_us is None else begins_us)


def sessions_of(stream: Stream) -> tuple[Stream, ...]:
    """Return a stream's parts between reboots of the autopilot in it, each as if it were a recording of its own."""
    starts = _starts(stream)
    if len(starts) == 1:
        return (stream,)
    ends = [*starts[1:], len(stream.messages)]
    return tuple(_part(stream, start, end) for start, end in zip(starts, ends, strict=True))


def vision_count(stream: Stream) -> int:
    """Return how many messages of external navigation a stream holds."""
    return sum(1 for _ in received_in(stream, VISION_NAMES))


def one_session(stream: Stream, number: int | None = None) -> Stream:
    """Return one of a stream's sessions, and tell in its notes which: None for that with most external navigation.

    Numbers are from 1. Raises ValueError if there is no session of that number.
    """
    sessions = sessions_of(stream)
    if number is not None and not 1 <= number <= len(sessions):
        raise ValueError(f"there are {len(sessions)}" if len(sessions) > 1 else "the autopilot was not rebooted")
    if len(sessions) == 1:
        return stream
    counts = [vision_count(one) for one in sessions]
    chosen = counts.index(max(counts)) if number is None else number - 1
    before = sum(len(one.messages) for one in sessions[:chosen])
    parts = ", ".join(map(str, counts))
    often = "once" if len(sessions) == 2 else f"{len(sessions) - 1} times"
    note = (
        f"{stream.name}: the autopilot was rebooted, its time falls back {often}; session "
        f"{chosen + 1} of {len(sessions)} is looked at (--session), from message {before + 1} of the file on, which "
        f"counts as 1; messages of external navigation in each: {parts}"
    )
    return replace(sessions[chosen], notes=(*stream.notes, note))
