# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A log written to a file of a given name."""

import os
from pathlib import Path

from emulator.errors import InputError
from emulator.log_files import LogFile


class SingleLog:
    """Opens one log file by name, replacing what is there.

    Raises:
        InputError: if the file cannot be made.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o644)
        except OSError as error:
            raise InputError(f"{path}: {error.strerror or error}") from error
        self._path = path

    def open(self) -> LogFile:
        """Return the open log; a log that is opened again is continued."""
        return LogFile(self._path, 1, os.dup(self._descriptor))
