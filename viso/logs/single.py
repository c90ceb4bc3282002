# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A log with a name of the user's, outside the numbered ones."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from viso.errors import InputError
from viso.files.outputs import output_file
from viso.logs.files import LogFile


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
