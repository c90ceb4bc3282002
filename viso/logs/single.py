# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A log with a name of the user's, outside the numbered ones."""

import os
from pathlib import Path

from viso.errors import file_errors
from viso.logs.files import LogFile, LogStoreError

_APPEND = os.O_WRONLY | os.O_CREAT | os.O_APPEND


class SingleLog:
    """Opens one log file by name, replacing what is there. Raises InputError if the file cannot be made."""

    def __init__(self, path: Path) -> None:
        with file_errors(path):
            os.close(os.open(path, _APPEND | os.O_TRUNC, 0o644))
        self._path = path
        self._opened: list[LogFile] = []

    @property
    def failure(self) -> str | None:
        """Why something could not be written, in one line naming the file; None while all is well."""
        return next((file.reason for file in self._opened if file.reason), None)

    def open(self) -> LogFile:
        """Return the open log; one that is opened again is continued. Raises LogStoreError if it cannot be opened."""
        try:
            descriptor = os.open(self._path, _APPEND, 0o644)
        except OSError as error:
            raise LogStoreError(f"{self._path}: {error.strerror or error}") from error
        self._opened.append(LogFile(self._path, 1, descriptor))
        return self._opened[-1]
