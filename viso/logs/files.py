# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Log files on disk: their numbering, and appending records so that a killed process leaves a readable log.

Source: AP_Logger/AP_Logger_File.cpp (find_last_log, start_new_log, write_lastlog_file, io_timer).
"""

import contextlib
import fcntl
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Self

from viso.errors import InputError
from viso.files.outputs import output_file, replace_file

LASTLOG_NAME: Final = "LASTLOG.TXT"
MAX_FILES: Final = 500
CHUNK_BYTES: Final = 4096
FLUSH_INTERVAL_US: Final = 2_000_000

_LASTLOG: Final = re.compile(rb"\s*(\d{1,9})")
_LOG_NAME: Final = re.compile(r"(\d{8})\.BIN")


class LogStoreError(Exception):
    """A log cannot be opened; the message is one line that names the path."""


class LogFile:
    """One open log: takes whole records and writes them in chunks.

    Writing never raises because of the file. After an error, or once somebody has deleted it, the file takes nothing
    more: ``reason`` says why and ``dropped`` counts the lost calls of :meth:`write`, those still waiting in memory
    included.

    Attributes:
        number: the number in the file's name.
        path: the file.
        size: bytes handed in so far, written or waiting.
        dropped: calls of :meth:`write` whose records are lost.
        reason: one line naming the file, once writing has failed.
        flush_due_us: when ``flush_if_due`` writes next, in us since boot.
        is_told_at_end: whether whoever opened it reports a failure himself, at the end.
    """

    def __init__(self, path: Path, number: int, descriptor: int) -> None:
        self.number = number
        self.path = path
        self.size = 0
        self.dropped = 0
        self.reason: str | None = None
        self._descriptor: int | None = descriptor
        self._waiting = bytearray()
        self._waiting_calls = 0
        self._flushed_us = 0
        self.flush_due_us = FLUSH_INTERVAL_US
        self.is_told_at_end = False

    @property
    def closed(self) -> bool:
        """Whether :meth:`close` was called or writing has failed."""
        return self._descriptor is None

    def write(self, data: bytes) -> bool:
        """Append whole records; return False if they are lost. Raises ValueError if the file was closed."""
        if self._descriptor is None:
            if self.reason is None:
                raise ValueError(f"{self.path}: write to a closed log")
            self.dropped += 1
            return False
        waiting = self._waiting
        waiting += data
        self._waiting_calls += 1
        self.size += len(data)
        return len(waiting) < CHUNK_BYTES or self.flush()

    def flush_if_due(self, now_us: int) -> bool:
        """Write what is waiting once 2 s have passed since the last time; return False after an error.

        The time is in us since boot; a clock that was set back makes the flush due.
        """
        if 0 <= now_us - self._flushed_us < FLUSH_INTERVAL_US:
            return self.reason is None
        self._flushed_us = now_us
        self.flush_due_us = now_us + FLUSH_INTERVAL_US
        return self.flush()

    def flush(self) -> bool:
        """Hand what is waiting to the operating system; return False after an error, or if the file is deleted."""
        if self._descriptor is None:
            return self.reason is None
        waiting = memoryview(bytes(self._waiting))
        try:
            while waiting:
                waiting = waiting[os.write(self._descriptor, waiting) :]
            # Looked at after writing: all that was written since the last look is then known to be lost, or not.
            is_deleted = os.fstat(self._descriptor).st_nlink == 0
        except OSError as error:
            self._fail(_one_line(self.path, error))
            return False
        if is_deleted:
            self._fail(f"{self.path}: deleted while it was written")
            return False
        self._waiting.clear()
        self._waiting_calls = 0
        return True

    def _fail(self, reason: str) -> None:
        self.reason = reason
        self.dropped += self._waiting_calls
        self._waiting.clear()
        self._waiting_calls = 0
        self._close_descriptor()

    def _close_descriptor(self) -> None:
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
            self._descriptor = None

    def close(self) -> None:
        """Write what is waiting and close the file; further calls do nothing."""
        self.flush()
        self._close_descriptor()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class LogStore:
    """A directory of logs ``00000001.BIN`` and so on, and ``LASTLOG.TXT`` with the last number.

    Args:
        directory: made when the first log is opened.
        max_files: after this number comes 1 again.

    Raises:
        ValueError: if ``max_files`` is less than 2, the least that LOG_MAX_FILES may be.
    """

    def __init__(self, directory: Path, *, max_files: int = MAX_FILES) -> None:
        if max_files < 2:
            raise ValueError(f"max_files is {max_files}, at least 2 are needed")
        self.directory = directory
        self._max_files = max_files

    def path_of(self, number: int) -> Path:
        """Return the path of log ``number``, whether it exists or not."""
        return self.directory / f"{number:08d}.BIN"

    def last_number(self) -> int:
        """Return the number of the last log, 0 if there is none.

        ``LASTLOG.TXT`` tells; where it is missing or makes no sense, the highest number among the files.
        """
        try:
            match = _LASTLOG.match((self.directory / LASTLOG_NAME).read_bytes())
        except OSError:
            match = None
        return int(match[1]) if match else max(self._numbers(), default=0)

    def log_numbers(self) -> list[int]:
        """Return the numbers of the logs that hold data, oldest first."""
        last = self.last_number()
        numbers = (number for number in self._numbers() if self._holds_data(self.path_of(number)))
        return sorted(numbers, key=lambda number: (number <= last, number))

    def open_next(self) -> LogFile:
        """Open the log after the last one, or the last one again if it is empty or missing.

        Numbers of logs that hold data, or that another process is writing, are passed over. Raises LogStoreError if the
        directory or a file cannot be made, or every number is taken.
        """
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise LogStoreError(_one_line(self.directory, error)) from error
        # FIRMWARE PARITY: the firmware truncates the log that has the next number; here no log is ever lost.
        for number in self._candidates():
            log = self._try_open(number)
            if log is not None:
                self._write_lastlog(log)
                return log
        raise LogStoreError(f"{self.directory}: all {self._max_files} log numbers are taken")

    def _candidates(self) -> list[int]:
        last = self.last_number()
        first = last if last and not self._holds_data(self.path_of(last)) else last + 1
        if first > self._max_files:
            first = 1
        return [*range(first, self._max_files + 1), *range(1, first)]

    def _numbers(self) -> list[int]:
        try:
            names = [entry.name for entry in self.directory.iterdir()]
        except OSError:
            return []
        matches = (_LOG_NAME.fullmatch(name) for name in names)
        return sorted(int(match[1]) for match in matches if match and 1 <= int(match[1]) <= self._max_files)

    @staticmethod
    def _holds_data(path: Path) -> bool:
        try:
            return path.is_file() and path.stat().st_size > 0
        except OSError:
            return False

    def _try_open(self, number: int) -> LogFile | None:
        path = self.path_of(number)
        try:
            if path.exists() and (not path.is_file() or path.stat().st_size > 0):
                return None
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise LogStoreError(_one_line(path, error)) from error
        if claim(descriptor) and os.fstat(descriptor).st_size == 0:
            return LogFile(path, number, descriptor)
        os.close(descriptor)
        return None

    def _write_lastlog(self, log: LogFile) -> None:
        path = self.directory / LASTLOG_NAME
        try:
            replace_file(path, b"%d\r\n" % log.number, synced=False)
        except OSError as error:
            log.close()
            raise LogStoreError(_one_line(path, error)) from error


def claim(descriptor: int) -> bool:
    """Lock an open log for this process, if no other has; where the file system has no locks, every claim succeeds."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def _one_line(path: Path, error: OSError) -> str:
    return f"{path}: {error.strerror or error}"


@contextmanager
def single_log(path: Path) -> Iterator[Callable[[], LogFile]]:
    """Yield what opens a log by name, which takes its place at the end; one that is opened again is continued.

    Raises InputError if the file cannot be made, and at the end if not all of it could be written.
    """
    opened: list[LogFile] = []
    with output_file(path) as file:

        def open_log() -> LogFile:
            opened.append(LogFile(path, 1, os.dup(file.fileno())))
            opened[-1].is_told_at_end = True
            return opened[-1]

        yield open_log
        for log in opened:
            log.close()
            if log.reason is not None:
                raise InputError(log.reason)
