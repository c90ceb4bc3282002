# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion's telemetry: where records of frames and changes go, in flight to a ring of files."""

import contextlib
import logging
import re
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final, Protocol

from viso.companion.vio.json_log import log_event
from viso.companion.vio.telemetry_records import Record, output_of, pack_record, read_records, warm_start_of
from viso.companion.vio.types import VioOutput, WarmStartPose

SUFFIX: Final = ".vtl"
FLUSH_PERIOD_NS: Final = 1_000_000_000
_NAME: Final = re.compile(r"telemetry-(\d{8})\.vtl")


class TelemetrySink(Protocol):
    """Takes records; never raises into its caller, and never keeps it waiting."""

    def write(self, record: Record) -> None:
        """Take a record; one whose ``level`` is DEBUG is passed over."""


class NullSink:
    """Takes records and forgets them."""

    def write(self, record: Record) -> None:
        """Do nothing."""


def ring_files(folder: Path) -> list[Path]:
    """Return the files of a ring, the oldest first."""
    return sorted(path for path in folder.glob(f"*{SUFFIX}") if _NAME.fullmatch(path.name))


def ring_records(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the records of a ring that are whole, the oldest first."""
    for path in ring_files(folder):
        yield from read_records(path)


def last_output(folder: Path) -> VioOutput | None:
    """Return the newest valid output in a ring, or None."""
    for path in reversed(ring_files(folder)):
        for record in reversed(list(read_records(path))):
            if (output := output_of(record.get("output"))) is not None:
                return output
    return None


def _create(path: Path) -> BinaryIO:
    return path.open("xb")


class RingSink:
    """Writes records to files of limited size, of which a limited number is kept; earlier runs' count too.

    A file that cannot be written turns the sink off, with one ERROR, for the rest of the run.

    Args:
        folder: of the files; made when missing.
        clock_ns: the companion's monotonic clock.
        logger: for that ERROR.
        file_bytes: size at which the next file is begun.
        files: number that is kept, at least 2.
        create: opens a new file for writing.
    """

    def __init__(
        self,
        folder: Path,
        clock_ns: Callable[[], int],
        logger: logging.Logger,
        *,
        file_bytes: int = 16 << 20,
        files: int = 8,
        create: Callable[[Path], BinaryIO] = _create,
    ) -> None:
        if files < 2 or file_bytes < 1:
            raise ValueError("files: at least 2, of at least 1 byte")
        self._folder, self._clock_ns, self._logger = folder, clock_ns, logger
        self._file_bytes, self._files, self._create = file_bytes, files, create
        self._lock = threading.Lock()
        self._file: BinaryIO | None = None
        self._size = 0
        self._flush_due_ns = 0
        self._off = False
        self._last_values: object = None
        self.written = 0

    @property
    def is_off(self) -> bool:
        """Whether nothing is written any more."""
        return self._off

    def write(self, record: Record) -> None:
        """Write a record, unless its ``level`` is DEBUG; flush once a second."""
        if record.get("level") == "DEBUG":
            return
        with self._lock:
            if record.get("output") is not None:
                self._last_values = record["output"]
            if not self._off:
                self._guard(lambda: self._append(pack_record(record)))

    def last_output(self) -> VioOutput | None:
        """Return the newest valid output, of this run or else of the ones before, or None."""
        with self._lock:
            values = self._last_values
        return output_of(values) or last_output(self._folder)

    def warm_start_hint(self) -> WarmStartPose | None:
        """Return the state of the newest valid output to start from after a reboot, or None."""
        output = self.last_output()
        return None if output is None else warm_start_of(output)

    def close(self) -> None:
        """Flush and close the file; what is written later is dropped."""
        with self._lock:
            self._off = True
            self._guard(self._close_file)

    def _guard(self, action: Callable[[], None]) -> None:
        try:
            action()
        except OSError as error:
            self._off = True
            with contextlib.suppress(OSError):
                self._close_file()
            reason = error.strerror or str(error)
            log_event(
                self._logger, logging.ERROR, "telemetry_off", f"telemetry is off: {reason}", {"written": self.written}
            )

    def _append(self, data: bytes) -> None:
        if self._file is None or self._size + len(data) > self._file_bytes:
            self._next_file()
        assert self._file is not None
        self._file.write(data)
        self._size += len(data)
        self.written += 1
        if (now_ns := self._clock_ns()) >= self._flush_due_ns:
            self._flush_due_ns = now_ns + FLUSH_PERIOD_NS
            self._file.flush()

    def _next_file(self) -> None:
        self._close_file()
        self._folder.mkdir(parents=True, exist_ok=True)
        present = ring_files(self._folder)
        for old in present[: max(len(present) - self._files + 1, 0)]:
            old.unlink()
        number = int(present[-1].name[10:18]) + 1 if present else 1
        self._file = self._create(self._folder / f"telemetry-{number:08d}{SUFFIX}")
        self._size = 0

    def _close_file(self) -> None:
        if self._file is not None:
            file, self._file = self._file, None
            file.close()
