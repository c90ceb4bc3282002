# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing text files, compressed or not, with errors in one line."""

import gzip
import io
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TextIO

from mav_handlers.links.packed import PackedError, open_packed
from viso.errors import InputError, file_errors
from viso.files.outputs import growing_file, output_file


def read_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the numbers, from 1, and the texts of a file's lines; blank lines are passed over.

    Raises InputError if the file cannot be read or is not text.
    """
    number = 0
    try:
        with io.TextIOWrapper(open_packed(path), encoding="utf-8") as lines:
            for number, line in enumerate(lines, 1):
                if line.strip():
                    yield number, line
    except UnicodeDecodeError as error:
        raise InputError(f"{path}:{number + 1}: not UTF-8 text") from error
    except PackedError as error:
        raise InputError(f"{path}:{number + 1}: {error}") from error
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error


def read_text(path: Path) -> str:
    """Return the text of a file, packed or not. Raises InputError if the file cannot be read or is not text."""
    try:
        with file_errors(path), open_packed(path) as file:
            return file.read().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text") from error


@contextmanager
def write_text(path: Path, *, growing: bool = False) -> Iterator[TextIO]:
    """Open a file for writing, through gzip when its name ends in .gz: an output file, or one that grows in its place.

    Raises InputError if the file cannot be written.
    """
    with ExitStack() as stack:
        data: Any = stack.enter_context(growing_file(path) if growing else output_file(path))
        is_packed = path.suffix == ".gz"
        if is_packed:
            data = stack.enter_context(gzip.GzipFile("", "wb", fileobj=data, mtime=0))
        yield stack.enter_context(io.TextIOWrapper(data, encoding="utf-8", line_buffering=growing and not is_packed))
