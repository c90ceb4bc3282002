# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Telemetry logs: what went over a link, stamped by who wrote it down."""

from dataclasses import replace
from pathlib import Path

from mav_handlers.links.tlog import TlogError, read_tlog
from viso.errors import InputError, as_input_errors
from viso.streams.heard import version_heard, what_lacks
from viso.streams.stream import MAX_GAP_US, Stream, StreamMessage


def read_telemetry_log(path: Path, lead_us: int) -> Stream:
    """Read a .tlog, packed or not; its first message comes ``lead_us`` after the vehicle's boot.

    Messages whose stamp runs backwards are handled at the time of their predecessor. Raises InputError if the file
    cannot be read as a .tlog, or a stamp is more than a day after its predecessor.
    """
    with as_input_errors(TlogError):
        reader = read_tlog(path)
    messages, first_us, latest_us = [], None, lead_us
    for number, entry in enumerate(reader, 1):
        first_us = entry.time_us if first_us is None else first_us
        time_us = lead_us + entry.time_us - first_us
        if time_us - latest_us > MAX_GAP_US:
            raise InputError(f"{path}: entry {number}: more than a day after the one before")
        latest_us = max(latest_us, time_us)
        messages.append(StreamMessage(latest_us, entry.data))
    notes = []
    if reader.skipped_bytes:
        notes.append(f"{path}: {reader.skipped_bytes} damaged bytes passed over")
    if reader.truncated:
        notes.append(f"{path}: the last entry is cut short")
    stream = Stream(path.stem, tuple(messages), notes=tuple(notes))
    return replace(stream, flown=version_heard(stream), notes=(*notes, *what_lacks(stream)))
