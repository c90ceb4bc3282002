# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The finite inputs of ``viso landmarks``: files and standard input, merged by time."""

import heapq
import stat
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from viso.errors import InputError
from viso.landmarks.inputs.base import FileReader, InputFileError, LineReader
from viso.landmarks.inputs.dataflash import DataFlashFile
from viso.landmarks.inputs.files import InputOptions, line_reader, open_file
from viso.landmarks.types import Detections, Event

STANDARD_INPUT: Final = "-"
SBS_SCHEME: Final = "sbs:"
UNKNOWN_LINE: Final = "a line of no known format"
YEAR_2000_S: Final = 946_684_800.0
_Any = TypeVar("_Any", bound=Any)


def is_live(name: str) -> bool:
    """Return whether an input is a connection without an end: a device, or a name with a scheme that is no path."""
    path = Path(name)
    if name == STANDARD_INPUT:
        return False
    if path.exists():
        return stat.S_ISCHR(path.stat().st_mode)
    return ":" in name


@dataclass(slots=True)
class AnyLines:
    """Reads lines whose format is detected from the first known one.

    Attributes:
        utc_offset_s: how far the times of BaseStation lines are ahead of UTC.
    """

    utc_offset_s: float = 0.0
    _reader: LineReader | None = None
    _unknown: Counter[str] = field(default_factory=Counter)

    @property
    def refused(self) -> Counter[str]:
        """The number of unusable records by reason."""
        return self._unknown + (Counter() if self._reader is None else self._reader.refused)

    def take(self, line: str, arrival_s: float | None = None) -> list[Event]:
        """Return the events of a line. Raises InputError if the extra for its format is missing."""
        if not line.strip():
            return []
        if self._reader is None:
            try:
                self._reader = line_reader(line, self.utc_offset_s)
            except InputFileError as error:
                raise InputError(str(error)) from error
        if self._reader is None:
            self._unknown[UNKNOWN_LINE] += 1
            return []
        return self._reader.take(line, arrival_s)


@dataclass(slots=True)
class Merged:
    """Files and standard input, merged by time.

    Times since an autopilot's boot become UTC if another input has UTC and the log has it from its GPS.

    Attributes:
        names: of the files, or ``-``.
        standard_input: its lines.
    """

    names: Sequence[str]
    options: InputOptions
    standard_input: Iterable[str] = ()
    _readers: list[tuple[str, FileReader | AnyLines]] = field(default_factory=list)

    def events(self) -> Iterator[Event]:
        """Yield the events of all inputs. Raises InputError if one cannot be read."""
        begun = []
        for name in self.names:
            try:
                events = self._begin(name)
                begun.append((self._readers[-1][1], next(events, None), events))
            except InputFileError as error:
                raise InputError(str(error)) from error
        has_utc = any(first is not None and first.t_s >= YEAR_2000_S for _, first, _ in begun)
        streams = []
        for reader, first, events in begun:
            if first is not None:
                offset_s = _offset_s(reader) if has_utc else 0.0
                streams.append(_in_order(first, events, offset_s))
        try:
            yield from (event for _, event in heapq.merge(*streams, key=_order))
        except InputFileError as error:
            raise InputError(str(error)) from error

    def refused(self) -> Mapping[str, Mapping[str, int]]:
        """Return the number of unusable records so far, by input and reason."""
        return {name: dict(reader.refused) for name, reader in self._readers if reader.refused}

    def _begin(self, name: str) -> Iterator[Event]:
        if name == STANDARD_INPUT:
            lines = AnyLines(self.options.utc_offset_s)
            self._readers.append((name, lines))
            return (event for line in self.standard_input for event in lines.take(line))
        reader = open_file(Path(name), self.options)
        self._readers.append((name, reader))
        return reader.events()


def _offset_s(reader: object) -> float:
    """Return the offset from a reader's times to UTC; 0 if not needed or unknown."""
    return (reader.utc_minus_boot_s or 0.0) if isinstance(reader, DataFlashFile) else 0.0


def _order(arrived: tuple[float, Event]) -> tuple[float, bool]:
    """Return the sort key of events of several inputs: a picture comes after other events of the same time."""
    arrival_s, event = arrived
    return arrival_s, isinstance(event, Detections)


def _in_order(first: Event, rest: Iterator[Event], offset_s: float) -> Iterator[tuple[float, Event]]:
    """Yield events with sort times that never go back within an input."""
    arrival_s = first.t_s + offset_s
    yield arrival_s, shifted(first, offset_s)
    for event in rest:
        arrival_s = max(arrival_s, event.t_s + offset_s)
        yield arrival_s, shifted(event, offset_s)


def shifted(event: _Any, offset_s: float) -> _Any:
    """Return an event at a later time."""
    return replace(event, t_s=event.t_s + offset_s) if offset_s else event
