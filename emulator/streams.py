# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded MAVLink streams: captures (.jsonl, .jsonl.gz) and telemetry logs (.tlog)."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from emulator.errors import InputError
from emulator.text_files import read_lines
from mav_handlers.links.tlog import TlogError, read_tlog

# The recording simulator applied this rate to its TCP port.
CAPTURE_BAUD: Final = 115200
MAX_PARAMETER: Final = 3.4e38  # of binary32
# A vehicle runs through the silence between two messages; a damaged stamp would have it run for years.
MAX_GAP_US: Final = 86_400_000_000


@dataclass(frozen=True, slots=True)
class StreamMessage:
    """A frame, and when the autopilot handled it in us since boot; None when that is not known."""

    arrival_us: int | None
    frame: bytes


@dataclass(frozen=True, slots=True)
class Stream:
    """A recorded stream.

    ``shared_arrival`` tells that messages with the same arrival time were waiting together, and that one which made no
    record carries its predecessor's time.
    """

    name: str
    messages: tuple[StreamMessage, ...]
    params: Mapping[str, float] = field(default_factory=dict)
    baud: int | None = None
    shared_arrival: bool = False
    notes: tuple[str, ...] = ()


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MAX_PARAMETER:
        raise ValueError(f"not a finite number: {value!r}")
    return float(value)


def _header(line: object) -> tuple[str, dict[str, float]]:
    if not isinstance(line, dict) or not isinstance(line.get("params"), dict):
        raise ValueError("the first line of a capture is an object with 'name' and 'params'")
    params = {str(name): _number(value) for name, value in line["params"].items()}
    return str(line.get("name", "")), params


def _message(line: object) -> StreamMessage:
    if not isinstance(line, dict) or "msg" not in line:
        raise ValueError("a message is an object with 'arrival_us' and 'msg'")
    arrival_us = line.get("arrival_us")
    if arrival_us is not None and (isinstance(arrival_us, bool) or not isinstance(arrival_us, int) or arrival_us < 0):
        raise ValueError(f"'arrival_us' is not a time: {arrival_us!r}")
    if not isinstance(line["msg"], str):
        raise ValueError("'msg' is not text in hex")
    return StreamMessage(arrival_us, bytes.fromhex(line["msg"]))


def read_capture(path: Path) -> Stream:
    """Read a capture: a line that describes it, then a line a message.

    Raises:
        InputError: naming the file, the line and what is wrong with it.
    """
    header: tuple[str, dict[str, float]] | None = None
    messages: list[StreamMessage] = []
    latest_us = 0
    for number, text in read_lines(path):
        try:
            line = json.loads(text)
            if header is None:
                header = _header(line)
                continue
            message = _message(line)
            if message.arrival_us is not None:
                if message.arrival_us < latest_us:
                    raise ValueError(f"'arrival_us' runs backwards: {message.arrival_us} after {latest_us}")
                if message.arrival_us - latest_us > MAX_GAP_US:
                    raise ValueError(f"'arrival_us' leaps over more than a day: {message.arrival_us} after {latest_us}")
                latest_us = message.arrival_us
            messages.append(message)
        except json.JSONDecodeError as error:
            raise InputError(f"{path}:{number}: not JSON: {error.msg} in column {error.colno}") from error
        except RecursionError as error:
            raise InputError(f"{path}:{number}: nested too deeply") from error
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}") from error
    if header is None:
        raise InputError(f"{path}: an empty capture")
    return Stream(header[0], tuple(messages), header[1], CAPTURE_BAUD, shared_arrival=True)


def read_telemetry_log(path: Path, lead_us: int) -> Stream:
    """Read a .tlog; its first message comes ``lead_us`` after the vehicle's boot.

    Messages whose stamp runs backwards are handled at the time of their predecessor.

    Raises:
        InputError: if the file cannot be read as a .tlog, or a stamp is more than a day after its predecessor.
    """
    try:
        reader = read_tlog(path)
        entries = list(reader)
    except TlogError as error:
        raise InputError(str(error)) from error
    messages, latest_us = [], lead_us
    for number, entry in enumerate(entries, 1):
        time_us = lead_us + entry.time_us - entries[0].time_us
        if time_us - latest_us > MAX_GAP_US:
            raise InputError(f"{path}: entry {number}: more than a day after the one before")
        latest_us = max(latest_us, time_us)
        messages.append(StreamMessage(latest_us, entry.data))
    notes = []
    if reader.skipped_bytes:
        notes.append(f"{path}: {reader.skipped_bytes} damaged bytes passed over")
    if reader.truncated:
        notes.append(f"{path}: the last entry is cut short")
    return Stream(path.stem, tuple(messages), notes=tuple(notes))


def read_stream(path: Path, lead_us: int) -> Stream:
    """Read a recorded stream of a known kind, by the ending of its name.

    Raises:
        InputError: if the kind is unknown or the file cannot be read.
    """
    name = path.name.lower()
    if name.endswith((".tlog", ".tlog.gz")):
        return read_telemetry_log(path, lead_us)
    if name.endswith((".jsonl", ".jsonl.gz")):
        return read_capture(path)
    raise InputError(f"{path}: neither a capture (.jsonl, .jsonl.gz) nor a telemetry log (.tlog)")
