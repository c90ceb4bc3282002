# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The live inputs of ``viso landmarks``: links, standard input and growing files; and the forwarding of aircraft."""

import os
import select
import stat
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

from mav_handlers.links import open_link
from mav_handlers.links.base import Link
from mav_handlers.wire.codec import Codec
from viso.companion.odometry.inbound import stream_requests
from viso.companion.sender import COMPANION_HEARTBEAT, HEARTBEAT_PERIOD_US
from viso.documents import parsed_json
from viso.errors import InputError
from viso.landmarks.adsb_vehicle import to_message
from viso.landmarks.inputs.base import FileReader, InputFileError, LineReader
from viso.landmarks.inputs.dump1090 import Dump1090Reader
from viso.landmarks.inputs.files import InputOptions, open_file
from viso.landmarks.inputs.lines import LineSplitter, TextFile
from viso.landmarks.inputs.sbs1 import Sbs1Reader
from viso.landmarks.inputs.vehicle import MavlinkStream
from viso.landmarks.recordings import SBS_SCHEME, STANDARD_INPUT, AnyLines, is_live
from viso.landmarks.types import AircraftReport, Event

NOW_S: Final = time.time
"""The clock of arrivals is the time of day, as in ADS-B receivers and telemetry logs."""
LONGEST_WAIT_S: Final = 0.1
"""The longest single wait, so that a signal is handled soon."""
CHUNK_BYTES: Final = 1 << 16
RATES_HZ: Final = {"ATTITUDE": 20.0, "LOCAL_POSITION_NED": 20.0, "GLOBAL_POSITION_INT": 5.0}
MAV_COMP_ID_ADSB: Final = 156
_REQUEST_PERIOD_S: Final = 5.0


_Reader = TypeVar("_Reader", bound=AnyLines | LineReader | FileReader | MavlinkStream)


class Source(ABC, Generic[_Reader]):
    """A live source of events, until its end.

    Args:
        name: as given by the user.
        reader: makes events from the received data.
    """

    def __init__(self, name: str, reader: _Reader) -> None:
        self.name = name
        self.is_over = False
        self._reader = reader

    @property
    def refused(self) -> Counter[str]:
        """The number of unusable records by reason."""
        return self._reader.refused

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none; files cannot be waited on."""
        return -1

    @abstractmethod
    def poll(self, now_s: float) -> list[Event]:
        """Return the events since the last call, without waiting."""

    def finish(self, now_s: float) -> list[Event]:
        """Return the events of a last, unfinished line."""
        return []


def standard_lines(descriptor: int, stop: Callable[[], bool]) -> Iterator[str]:
    """Yield the lines of a descriptor to its end, or until stopped."""
    splitter = LineSplitter()
    while not stop():
        if not select.select([descriptor], [], [], LONGEST_WAIT_S)[0]:
            continue
        data = os.read(descriptor, CHUNK_BYTES)
        if not data:
            break
        yield from splitter.feed(data)
    yield from splitter.feed(b"\n")


class _Lines(Source[AnyLines | LineReader]):
    """A source of events in lines."""

    def __init__(self, name: str, reader: AnyLines | LineReader) -> None:
        super().__init__(name, reader)
        self._splitter = LineSplitter()

    def finish(self, now_s: float) -> list[Event]:
        return self._told(b"\n", now_s)

    def _told(self, data: bytes, now_s: float) -> list[Event]:
        return [event for line in self._splitter.feed(data) for event in self._reader.take(line, now_s)]


class LineSource(_Lines):
    """Lines of a descriptor, which stays open: a pipe, or a file that grows."""

    def __init__(self, name: str, descriptor: int, utc_offset_s: float = 0.0) -> None:
        super().__init__(name, AnyLines(utc_offset_s))
        self._descriptor = descriptor
        self._grows = name != STANDARD_INPUT

    def fileno(self) -> int:
        is_file = stat.S_ISREG(os.fstat(self._descriptor).st_mode)
        return -1 if is_file or self.is_over else self._descriptor

    def poll(self, now_s: float) -> list[Event]:
        events: list[Event] = []
        while not self.is_over and select.select([self._descriptor], [], [], 0)[0]:
            data = os.read(self._descriptor, CHUNK_BYTES)
            if not data:
                self.is_over = not self._grows
                break
            events += self._told(data, now_s)
        return events


class SbsLink(_Lines):
    """BaseStation lines on a link."""

    def __init__(self, name: str, link: Link, utc_offset_s: float = 0.0) -> None:
        super().__init__(name, Sbs1Reader(utc_offset_s))
        self._link = link

    def fileno(self) -> int:
        return self._link.fileno()

    def poll(self, now_s: float) -> list[Event]:
        return [event for data in iter(self._link.receive, b"") for event in self._told(data, now_s)]


class VehicleLink(Source[MavlinkStream]):
    """An autopilot on a link, from which messages are requested; half a frame at the end has no events."""

    def __init__(self, name: str, link: Link) -> None:
        super().__init__(name, MavlinkStream())
        self._link = link
        self._codec = Codec(system_id=255, component_id=0)
        self._beat_s = self._request_s = -float("inf")

    def fileno(self) -> int:
        return self._link.fileno()

    def poll(self, now_s: float) -> list[Event]:
        if now_s - self._beat_s >= HEARTBEAT_PERIOD_US * 1e-6:
            self._beat_s = now_s
            self._link.send(self._codec.encode(COMPANION_HEARTBEAT))
        if now_s - self._request_s >= _REQUEST_PERIOD_S:
            self._request_s = now_s
            for request in stream_requests(RATES_HZ):
                self._link.send(self._codec.encode(request))
        return [event for data in iter(self._link.receive, b"") for event in self._reader.feed(data, now_s)]


class WholeFile(Source[FileReader]):
    """A file that is read once, from its beginning to its end."""

    def poll(self, now_s: float) -> list[Event]:
        if self.is_over:
            return []
        self.is_over = True
        try:
            return list(self._reader.events())
        except InputFileError as error:
            raise InputError(str(error)) from error


class Snapshots(Source[Dump1090Reader]):
    """A snapshot of dump1090 that is rewritten periodically."""

    def __init__(self, path: Path) -> None:
        super().__init__(str(path), Dump1090Reader())
        self._path = path
        self._last: tuple[int, int, int] | None = None

    def poll(self, now_s: float) -> list[Event]:
        try:
            now = self._path.stat()
            mark = now.st_ino, now.st_mtime_ns, now.st_size
            if mark == self._last:
                return []
            text = self._path.read_text(encoding="utf-8", errors="replace")
        except OSError:  # the file may be missing between the old and the new one
            return []
        self._last = mark
        return self._reader.take(text, now_s)


class Live:
    """All live inputs.

    Args:
        names: of links, files, or ``-``.
        options: options of the files.
        standard_input: its descriptor.
        now_s: returns the time of arrival.

    Raises:
        InputError: if a file cannot be read.
        LinkError: if a link cannot be opened.
    """

    def __init__(
        self,
        names: Sequence[str],
        options: InputOptions,
        standard_input: Callable[[], int],
        now_s: Callable[[], float] = NOW_S,
    ) -> None:
        self._now_s = now_s
        self._stack = ExitStack()
        self._sources: list[Source[Any]] = []
        with ExitStack() as undo:
            undo.callback(self._stack.close)
            self._sources += [self._opened(name, options, standard_input) for name in names]
            undo.pop_all()

    def __enter__(self) -> "Live":
        return self

    def __exit__(self, *_args: object) -> None:
        self._stack.close()

    def events(self, stop: Callable[[], bool], until_s: float | None = None) -> Iterator[Event]:
        """Yield events until stopped or all inputs end; then the events that had arrived, to the last line.

        Raises InputError if a file cannot be read further.
        """
        end_s = None if until_s is None else self._now_s() + until_s
        while not stop() and (end_s is None or self._now_s() < end_s):
            events = self._polled()
            yield from events
            if all(source.is_over for source in self._sources):
                break
            if not events:
                self._wait()
        yield from self._polled()
        for source in self._sources:
            yield from source.finish(self._now_s())

    def refused(self) -> Mapping[str, Mapping[str, int]]:
        """Return the number of unusable records so far, by input and reason."""
        return {source.name: dict(source.refused) for source in self._sources if source.refused}

    def _polled(self) -> list[Event]:
        return [event for source in self._sources for event in source.poll(self._now_s())]

    def _wait(self) -> None:
        descriptors = [source.fileno() for source in self._sources]
        select.select([descriptor for descriptor in descriptors if descriptor >= 0], [], [], LONGEST_WAIT_S)

    def _opened(self, name: str, options: InputOptions, standard_input: Callable[[], int]) -> Source[Any]:
        if name == STANDARD_INPUT:
            return LineSource(name, standard_input(), options.utc_offset_s)
        if name.startswith(SBS_SCHEME):
            link = self._link(f"tcp:{name.removeprefix(SBS_SCHEME)}")
            return SbsLink(name, link, options.utc_offset_s)
        if is_live(name):
            return VehicleLink(name, self._link(name))
        return self._file(name, options)

    def _link(self, name: str) -> Link:
        link = open_link(name)
        self._stack.callback(link.close)
        return link

    def _file(self, name: str, options: InputOptions) -> Source[Any]:
        path = Path(name)
        try:
            if path.is_file() and not path.stat().st_size:
                return self._lines(path, options)
            reader = open_file(path, options)
            if not isinstance(reader, TextFile):
                return WholeFile(name, reader)
            text = path.read_text(encoding="utf-8", errors="replace")
        except InputFileError as error:
            raise InputError(str(error)) from error
        except OSError as error:
            raise InputError(f"{name}: {error.strerror or error}") from error
        record = _record(text)
        if isinstance(record, dict) and {"now", "aircraft"} <= record.keys():
            return Snapshots(path)
        has_lines = len([line for line in text.splitlines() if line.strip()]) > 1
        is_one_record = record is not None and has_lines
        return WholeFile(name, reader) if is_one_record else self._lines(path, options)

    def _lines(self, path: Path, options: InputOptions) -> Source[Any]:
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise InputError(f"{path}: {error.strerror or error}") from error
        self._stack.callback(os.close, descriptor)
        return LineSource(str(path), descriptor, options.utc_offset_s)


def _record(text: str) -> object:
    try:
        record: object = parsed_json(text)
    except ValueError:
        return None
    return record


class AircraftSender:
    """Forwards the aircraft of a receiver to an autopilot, as ADSB_VEHICLE."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._codec = Codec(1, MAV_COMP_ID_ADSB)
        self.sent = 0

    def take(self, event: Event) -> None:
        """Send an event if it is a report of an aircraft; other events, and the autopilot's answers, are ignored."""
        while self._link.receive():
            pass
        if isinstance(event, AircraftReport):
            self._link.send(self._codec.encode(to_message(event, event.t_s)))
            self.sent += 1
