# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Telemetry logs: what went over a link, stamped by who wrote it down."""

from dataclasses import replace
from pathlib import Path

from mav_handlers.links.tlog import TlogError, read_tlog
from viso.errors import InputError, as_input_errors
from viso.streams.boot_time import begun_at, boot_time_us
from viso.streams.heard import version_heard, what_lacks
from viso.streams.stream import MAX_GAP_US, Stream, StreamMessage


def read_telemetry_log(path: Path, lead_us: int) -> Stream:
    """Read a .tlog, packed or not.

    Times are since boot, as the autopilot's messages show it; if none does, the first message comes ``lead_us`` after
    boot. Messages whose stamp runs backwards are handled at the time of their predecessor. Raises InputError if the
    file cannot be read as a .tlog, or a stamp is more than a day after its predecessor.
    """
    with as_input_errors(TlogError):
        reader = read_tlog(path)
    messages, first_us, latest_us = [], None, 0
    for number, entry in enumerate(reader, 1):
        first_us = entry.time_us if first_us is None else first_us
        time_us = entry.time_us - first_us
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
    begins_us = boot_time_us(stream)
    if begins_us is None and lead_us:
        lead_s = lead_us * 1e-6
        notes.append(f"{path}: no message has the autopilot's clock: it begins {lead_s:g} s after boot here (--lead)")
    stream = begun_at(stream, lead_us if begins_us is None else begins_us)
    return replace(stream, flown=version_heard(stream), notes=(*notes, *what_lacks(stream)))
