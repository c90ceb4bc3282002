# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of message intervals, ``message-intervals-chan0.txt`` and so on: lines of a message id and milliseconds.

Source: GCS_MAVLink/GCS_Common.cpp (initialise_message_intervals_from_config_files, get_intervals_from_filepath).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from viso.errors import InputError
from viso.files.text_files import read_lines

_MAX_INTERVAL_MS: Final = 65535
_MAX_MESSAGE_ID: Final = (1 << 24) - 1
_MAX_DIGITS: Final = 9


def load_message_intervals(folder: Path, links: int) -> dict[int, Mapping[int, int]]:
    """Return the intervals in ms by message id, for each of the first ``links`` links that has a file in a folder.

    Raises InputError: a file cannot be read, or a line is not an id and an interval.
    """
    paths = {index: folder / f"message-intervals-chan{index}.txt" for index in range(links)}
    return {index: _load(path) for index, path in paths.items() if path.exists()}


def _load(path: Path) -> dict[int, int]:
    intervals_ms = {}
    for number, line in read_lines(path):
        numbers = [int(word) for word in line.split() if _is_number(word)]
        # FIRMWARE PARITY: the firmware skips such a line, or reads it as far as it goes.
        if len(numbers) != len(line.split()) or len(numbers) != 2:
            raise InputError(f"{path}:{number}: not a message id and milliseconds: {line.strip()!r}")
        message_id, interval_ms = numbers
        if message_id > _MAX_MESSAGE_ID or interval_ms > _MAX_INTERVAL_MS:
            raise InputError(f"{path}:{number}: no such message id or interval: {line.strip()!r}")
        intervals_ms[message_id] = interval_ms
    return intervals_ms


def _is_number(word: str) -> bool:
    return word.isascii() and word.isdecimal() and len(word) <= _MAX_DIGITS
