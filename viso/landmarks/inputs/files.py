# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Choice of the reader of a file, by its name's ending or its first bytes."""

from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Final

from viso.documents import parsed_json
from viso.landmarks.inputs.bags import BagFile
from viso.landmarks.inputs.base import FileReader, InputFileError, LineReader
from viso.landmarks.inputs.dataflash import DataFlashFile
from viso.landmarks.inputs.dump1090 import Dump1090Folder, Dump1090Reader
from viso.landmarks.inputs.json_lines import JsonReader
from viso.landmarks.inputs.lines import TextFile, file_lines
from viso.landmarks.inputs.mode_s import ModeSReader, is_frame
from viso.landmarks.inputs.sbs1 import OTHER_TYPES, Sbs1Reader
from viso.landmarks.inputs.vehicle import TlogFile

KNOWN: Final = (
    "JSON lines, aircraft.json or a folder of them, BaseStation lines, Mode-S frames, .BIN, .tlog, "
    "or a bag (.bag, .db3, .mcap, folder)"
)
TRIED_LINES: Final = 20
"""The lines tried for detection: a file cut out of a stream may begin within a record."""
_BAGS: Final = (".bag", ".db3", ".mcap")
_SBS1_TYPES: Final = frozenset({"MSG", *OTHER_TYPES})


@dataclass(frozen=True, slots=True)
class InputOptions:
    """Settings that a file does not contain.

    Attributes:
        odometry_is_ned: whether a bag's odometry is in NED.
        utc_offset_s: how far the times of BaseStation lines are ahead of UTC.
    """

    odometry_is_ned: bool = False
    utc_offset_s: float = 0.0


def open_file(path: Path, options: InputOptions) -> FileReader:
    """Return the reader of a file, or of a folder.

    Raises InputFileError if it cannot be read, is of no known kind, or an extra is missing.
    """
    name = path.name.lower()
    if name.endswith((".tlog", ".tlog.gz")):
        return TlogFile(path)
    if name.endswith((".bin", ".bin.xz")):
        return DataFlashFile(path)
    if name.endswith(_BAGS) or (path.is_dir() and any(path.glob("metadata.yaml"))):
        return BagFile(path, odometry_is_ned=options.odometry_is_ned)
    if path.is_dir():
        return Dump1090Folder(path)
    return _text(path, options)


def line_reader(line: str, utc_offset_s: float = 0.0) -> LineReader | None:
    """Return the reader of a format by one of its lines; None if it is none known.

    Raises InputFileError if an extra is missing.
    """
    line = line.strip()
    if line.startswith("{"):
        return JsonReader()
    if line.partition(",")[0] in _SBS1_TYPES:
        return Sbs1Reader(utc_offset_s)
    return ModeSReader() if is_frame(line) else None


def _text(path: Path, options: InputOptions) -> FileReader:
    first = list(islice(filter(str.strip, file_lines(path)), TRIED_LINES))
    if first and first[0].lstrip()[0] in "[{":
        return _json(path)
    readers = (line_reader(line, options.utc_offset_s) for line in first)
    reader = next((reader for reader in readers if reader is not None), None)
    if reader is None:
        raise InputFileError(f"{path}: none of {KNOWN}" if first else f"{path}: empty")
    return TextFile(path, reader)


def _json(path: Path) -> FileReader:
    """Return the reader of a file with one record, or one a line."""
    try:
        record: Any = parsed_json("".join(file_lines(path)))
    except ValueError:
        return TextFile(path, JsonReader())
    is_snapshot = isinstance(record, list) or ("aircraft" in record and "now" in record)
    return TextFile(path, Dump1090Reader() if is_snapshot else JsonReader(), whole=True)
