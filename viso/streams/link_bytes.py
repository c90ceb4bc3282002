# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bytes of a link without times of arrival, as MAVProxy (.tlog.raw) and Mission Planner (.rlog) keep them."""

from dataclasses import replace
from pathlib import Path
from typing import Final

from mav_handlers.links.packed import open_packed
from mav_handlers.wire.codec import Codec, Received
from viso.errors import InputError, file_errors
from viso.streams.heard import MAV_COMP_ID_AUTOPILOT1, version_heard, what_lacks
from viso.streams.stream import MAX_GAP_US, Aspect, Stream, StreamMessage

_MAX_GAP_MS: Final = MAX_GAP_US // 1000


def read_link_bytes(path: Path) -> Stream:
    """Read the frames of a link; each has the time since boot of the autopilot's message before it.

    Raises InputError if the file cannot be read, holds no frame, or no message that tells the autopilot's time.
    """
    with file_errors(path), open_packed(path) as file:
        data = file.read()
    codec, timed, damaged = Codec(0, 0), list[tuple[int | None, bytes]](), 0
    latest_us: int | None = None
    codec.feed(data)
    while (received := codec.next_received()) is not None:
        if not isinstance(received, Received):
            damaged += received.length
            continue
        header, boot_ms = received.header, getattr(received.message, "time_boot_ms", None)
        if header.component_id == MAV_COMP_ID_AUTOPILOT1 and isinstance(boot_ms, int):
            is_later = latest_us is None or 0 <= boot_ms - latest_us // 1000 <= _MAX_GAP_MS
            latest_us = boot_ms * 1000 if is_later else latest_us
        timed.append((latest_us, header.frame))
    if not timed:
        raise InputError(f"{path}: no MAVLink frame in this file")
    first_us = next((time_us for time_us, _ in timed if time_us is not None), None)
    if first_us is None:
        raise InputError(
            f"{path}: frames of a link without times, and no message of an autopilot that tells its own; the .tlog "
            "that is written beside it has them"
        )
    messages = tuple(StreamMessage(first_us if time_us is None else time_us, frame) for time_us, frame in timed)
    notes = [
        f"{path}: bytes of a link, without times of arrival: they are those of the autopilot's messages before; "
        "the .tlog that is written beside it tells more"
    ]
    if damaged:
        notes.append(f"{path}: {damaged} damaged bytes passed over")
    stream = Stream(path.stem, messages, notes=tuple(notes), lacks=frozenset({Aspect.ARRIVAL}))
    return replace(stream, flown=version_heard(stream), notes=(*notes, *what_lacks(stream)))
