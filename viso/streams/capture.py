# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures: conversations with the firmware, a line that describes them and a line a message."""

from pathlib import Path
from typing import Final

from viso.documents import parsed_json
from viso.errors import InputError
from viso.files.text_files import read_lines
from viso.firmware.flown import FlownVersion, version_in
from viso.streams.stream import MAX_GAP_US, Stream, StreamMessage

# The recording simulator applied this rate to its TCP port; a capture that knows its own says so.
CAPTURE_BAUD: Final = 115200
MAX_PARAMETER: Final = 3.4e38  # of binary32


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MAX_PARAMETER:
        raise ValueError(f"not a finite number: {value!r}")
    return float(value)


def _header(line: object) -> tuple[str, dict[str, float], int | None, FlownVersion | None]:
    if not isinstance(line, dict) or not isinstance(line.get("params"), dict):
        raise ValueError("the first line of a capture is an object with 'name' and 'params'")
    params = {str(name): _number(value) for name, value in line["params"].items()}
    baud = line.get("baud", CAPTURE_BAUD)
    if baud is not None and (type(baud) is not int or baud <= 0):
        raise ValueError(f"'baud' is not a rate: {baud!r}")
    return str(line.get("name", "")), params, baud, version_in(str(line.get("firmware", "")), "the recording")


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
    """Read a capture: a line that describes it, then a line a message. Raises InputError that names file and line."""
    header: tuple[str, dict[str, float], int | None, FlownVersion | None] | None = None
    messages: list[StreamMessage] = []
    latest_us = 0
    for number, text in read_lines(path):
        try:
            line = parsed_json(text)
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
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}") from error
    if header is None:
        raise InputError(f"{path}: an empty capture")
    name, params, baud, flown = header
    return Stream(name, tuple(messages), params, baud, shared_arrival=True, flown=flown)
