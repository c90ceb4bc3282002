# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs as pymavlink's DFReader reads them, packed ones too."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pymavlink.DFReader import DFReader_binary

from mav_handlers.links.packed import open_packed

T = TypeVar("T")


def read_log(path: Path, collect: Callable[[DFReader_binary], T]) -> T:
    """Return what ``collect`` makes of a log (.BIN or .BIN.xz)."""
    with open_packed(path) as packed, tempfile.NamedTemporaryFile(suffix=".BIN") as plain:
        plain.write(packed.read())  # DFReader maps files into memory
        plain.flush()
        with DFReader_binary(plain.name) as log:
            return collect(log)
