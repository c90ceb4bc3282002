# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The logs on disk as the log transfer sees them; files that vanish read as empty, and nothing raises.

Source: AP_Logger/AP_Logger_File.cpp (get_log_info, get_log_data, EraseAll).
"""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from ap_core.clock import Clock
from viso.logs.files import LASTLOG_NAME, LogStore, claim
from viso.logs.logger import Logger

REOPEN_US: Final = 1_000_000
"""The firmware looks once a second whether a log is to be opened."""

_LOG_PATTERN: Final = "[0-9]" * 8 + ".BIN"
_U32_MAX: Final = 0xFFFFFFFF


class FileReader:
    """A log open for reading; None stands for a file that could not be opened."""

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor = descriptor

    def read(self, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset`` on, none after the end or an error."""
        if self._descriptor is None:
            return b""
        try:
            return os.pread(self._descriptor, count, offset)
        except OSError:
            return b""

    def close(self) -> None:
        """Close the file; further calls do nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


class StoredLogs:
    """The logs of a LogStore, ids from 1 for the oldest.

    Args:
        store: their folder.
        clock: time since boot.
        logger: which writes one of them.
        utc_us: returns the time of day, us since 1970, 0 while unknown.
    """

    def __init__(self, store: LogStore, clock: Clock, logger: Logger, utc_us: Callable[[], int]) -> None:
        self._store = store
        self._clock = clock
        self._logger = logger
        self._utc_us = utc_us
        self._numbers: list[int] = []
        self._transferring = False
        self._reopen_us = 0

    @property
    def suspends_logging(self) -> bool:
        """Whether a vehicle that is not armed is to open no log: during a transfer and for 1 s after it."""
        return self._transferring or self._clock.micros64() < self._reopen_us

    def count(self) -> int:
        """Look for logs and return how many there are; their ids stay the same until the next call."""
        self._numbers = self._store.log_numbers()
        return len(self._numbers)

    def _number_of(self, log_id: int) -> int | None:
        return self._numbers[log_id - 1] if 1 <= log_id <= len(self._numbers) else None

    def entry(self, log_id: int) -> tuple[int, int]:
        """Return size in bytes and UTC in s: the file's, or for the log being written the time now, 0 if unknown."""
        number = self._number_of(log_id)
        if number is None:
            return 0, 0
        try:
            status = self._store.path_of(number).stat()
        except OSError:
            return 0, 0
        being_written = number == self._logger.open_number
        time_utc_s = self._utc_us() // 1_000_000 if being_written else int(status.st_mtime)
        return min(status.st_size, _U32_MAX), min(max(time_utc_s, 0), _U32_MAX)

    def open(self, log_id: int) -> FileReader:
        """Open a log for reading; one that cannot be opened reads as empty."""
        number = self._number_of(log_id)
        if number is not None:
            with contextlib.suppress(OSError):
                return FileReader(os.open(self._store.path_of(number), os.O_RDONLY))
        return FileReader(None)

    def begin_transfer(self) -> None:
        """Close the log being written, and let none be opened until the transfer is over."""
        self._transferring = True
        self._logger.close()

    def end_transfer(self) -> None:
        """Let a new log be opened, in a second."""
        self._transferring = False
        self._reopen_us = self._clock.micros64() + REOPEN_US

    def erase_all(self) -> None:
        """Close the log being written, delete all logs and LASTLOG.TXT, and let a log be opened in a second."""
        self._logger.close()
        directory = self._store.directory
        # FIRMWARE PARITY: the firmware is alone with its card; here a log that another vehicle is writing stays.
        logs = [path for path in directory.glob(_LOG_PATTERN) if path.is_file() and not _is_being_written(path)]
        for path in (*logs, directory / LASTLOG_NAME):
            with contextlib.suppress(OSError):
                path.unlink()
        self._numbers = []
        self._reopen_us = self._clock.micros64() + REOPEN_US


class NoLogs:
    """The logs of a vehicle that stores none (LOG_BACKEND_TYPE 0)."""

    suspends_logging: Final = False

    def count(self) -> int:
        """Return 0."""
        return 0

    def entry(self, log_id: int) -> tuple[int, int]:
        """Return zeros."""
        return 0, 0

    def open(self, log_id: int) -> FileReader:
        """Return an empty log."""
        return FileReader(None)

    def begin_transfer(self) -> None:
        """Do nothing."""

    def end_transfer(self) -> None:
        """Do nothing."""

    def erase_all(self) -> None:
        """Do nothing."""


def _is_being_written(path: Path) -> bool:
    try:
        with path.open("rb") as log:
            return not claim(log.fileno())
    except OSError:
        return False
