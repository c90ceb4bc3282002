# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of an autopilot of any kind: the release that they name, and their agreement with a profile."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from mav_handlers.links.packed import name_unpacked
from viso.compare.captures import compare_capture, log_beside
from viso.compare.comparison import Comparison
from viso.compare.conversations import compare_conversation, read_conversation, specified_in
from viso.compare.logs import compare_log
from viso.compare.tolerances import CAPTURE, CONVERSATION, LOG, VECTORS
from viso.compare.vectors import compare_vectors
from viso.documents import parsed_json
from viso.errors import InputError
from viso.files.first_bytes import Content, content_of
from viso.files.text_files import read_lines
from viso.firmware.flown import JudgedBy, profile_for, version_in
from viso.firmware.releases import DEFAULT, JULY_2025, PROFILES, Firmware
from viso.logs.recorded import read_columns
from viso.replay.ekf.run import NothingToCompare, recorded_firmware

Progress = Callable[[int, int], None]
"""Takes the amount done and the total."""


class RecordingKind(NamedTuple):
    """A kind of recording.

    Attributes:
        content: description of its content.
        endings: the endings of file names, in small letters, without those of packed files.
        is_begun_by: returns whether the first line of a JSON file is of this kind; None for kinds with their own
            endings.
        judged_by: returns the release that a recording names, or None.
        compare: compares a recording with a profile.
    """

    content: str
    endings: tuple[str, ...]
    is_begun_by: Callable[[Any], bool] | None
    judged_by: Callable[[Path], JudgedBy | None]
    compare: Callable[[Path, Firmware, Progress], Comparison]


_LINES: Final = (".jsonl",)


def _first_line(path: Path) -> Any:
    for number, text in read_lines(path):
        try:
            return parsed_json(text)
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}") from error
    raise InputError(f"{path}: empty")


def _of_header(path: Path) -> JudgedBy | None:
    flown = version_in(str(_first_line(path).get("firmware", "")), "the recording")
    return None if flown is None else profile_for(flown, ())


def _of_capture(path: Path) -> JudgedBy | None:
    log = log_beside(path)
    return _of_header(path) or (None if log is None else _of_log(log))


def _of_conversation(path: Path) -> JudgedBy | None:
    found = _of_header(path)
    if found is None and specified_in(read_conversation(path)[1]):
        return JudgedBy(JULY_2025, "the recording says what other releases answer otherwise")
    return found


def _of_log(path: Path) -> JudgedBy | None:
    found = recorded_firmware(read_columns(path))
    return None if found.stands_for is None else found


def _has(*fields: str) -> Callable[[Any], bool]:
    return lambda line: isinstance(line, dict) and any(field in line for field in fields)


RECORDING_KINDS: Final[Mapping[str, RecordingKind]] = MappingProxyType(
    {
        VECTORS: RecordingKind(
            "calls of the library, of its maths and of the time correction, with what came of them",
            _LINES,
            lambda line: isinstance(line, list) or _has("steps", "samples")(line),
            lambda _path: None,
            compare_vectors,
        ),
        CONVERSATION: RecordingKind(
            "messages of a client, with the answers",
            _LINES,
            _has("begins_s"),
            _of_conversation,
            compare_conversation,
        ),
        CAPTURE: RecordingKind(
            "messages of a camera, with the records, texts and acknowledgements that came of them",
            _LINES,
            _has("params"),
            _of_capture,
            compare_capture,
        ),
        LOG: RecordingKind(
            "a log with replay records (LOG_REPLAY), with what the filter made of them",
            (".bin",),
            None,
            _of_log,
            compare_log,
        ),
    }
)


def kind_of(path: Path) -> RecordingKind:
    """Return the kind of a recording, by its first bytes, or else its ending and first line.

    Raises NothingToCompare if it is of no such kind, InputError if it cannot be read.
    """
    name = name_unpacked(path).lower()
    fitting = [kind for kind in RECORDING_KINDS.values() if name.endswith(kind.endings)]
    if content_of(path) is Content.DATAFLASH_LOG:
        fitting = [RECORDING_KINDS[LOG]]
    if not fitting:
        endings = ", ".join(dict.fromkeys(ending for kind in RECORDING_KINDS.values() for ending in kind.endings))
        raise NothingToCompare(f"{path}: by its ending no recording that can be compared; there are {endings}")
    if len(fitting) == 1:
        return fitting[0]
    line = _first_line(path)
    for kind in fitting:
        if kind.is_begun_by is not None and kind.is_begun_by(line):
            return kind
    raise NothingToCompare(f"{path}:1: neither a capture ('params'), a conversation ('begins_s') nor vectors")


def recordings_in(paths: Iterable[Path]) -> Iterator[tuple[Path, bool]]:
    """Yield recordings, in folders by ending, and whether from a folder; InputError if a folder has none."""
    endings = tuple(ending for kind in RECORDING_KINDS.values() for ending in kind.endings)
    for path in paths:
        if not path.is_dir():
            yield path, False
            continue
        found = sorted(
            file for file in path.rglob("*") if name_unpacked(file).lower().endswith(endings) and file.is_file()
        )
        if not found:
            raise InputError(f"{path}: a folder without recordings ({', '.join(dict.fromkeys(endings))})")
        yield from ((recording, True) for recording in found)


def compare_recording(
    path: Path, firmware: Firmware | None = None, on_progress: Progress = lambda _done, _all: None
) -> Comparison:
    """Compare a recording with a profile: None for the one that it names, or the most similar one.

    Raises InputError if the recording cannot be used.
    """
    kind = kind_of(path)
    named = kind.judged_by(path)
    if firmware is None and named is None:
        found = compare_with_all(path, on_progress)
        names = most_like([found])
        reason = f"the recording names no release, and is most like {' and '.join(names)}"
        return replace(found[names[0]], firmware_reason=reason)
    chosen = named if firmware is None else JudgedBy(firmware, "it was asked for")
    assert chosen is not None
    comparison = kind.compare(path, chosen.firmware, on_progress)
    return replace(comparison, named=_name(named), firmware_reason=chosen.reason)


def _name(named: JudgedBy | None) -> str:
    return "" if named is None else named.firmware.name


def compare_with_all(path: Path, on_progress: Progress) -> dict[str, Comparison]:
    """Compare a recording with each profile, by name. Raises InputError if it cannot be used."""
    kind = kind_of(path)
    named = _name(kind.judged_by(path))
    found = ((name, kind.compare(path, profile, on_progress)) for name, profile in PROFILES.items())
    return {name: replace(one, named=named, firmware_reason="all are tried") for name, one in found}


def most_like(found: Iterable[Mapping[str, Comparison]]) -> list[str]:
    """Return the profiles under which the fewest fields of all recordings differ, the default first among equals."""
    totals = dict.fromkeys([DEFAULT.name, *PROFILES], 0)
    for comparisons in found:
        for name, comparison in comparisons.items():
            totals[name] += len(comparison.differences)
    return [name for name, total in totals.items() if total == min(totals.values())]
