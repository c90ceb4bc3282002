# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The example of an engine in C++, compiled once, and what is left of processes."""

import functools
import os
import select
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from viso.companion.engine import INCLUDE_DIR

SOURCE = Path(__file__).parents[5] / "docs/examples/inertial_engine.cpp"
PATIENCE_S = 20.0
_FOLDER = tempfile.TemporaryDirectory(prefix="viso-engine-")


@functools.cache
def inertial_engine() -> str:
    """Return the command of the example; skips where there is no compiler."""
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no compiler for C++")
    program = Path(_FOLDER.name) / "inertial_engine"
    flags = ("-std=c++17", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{INCLUDE_DIR}")
    subprocess.run([compiler, *flags, SOURCE, "-o", program], check=True)
    return str(program)


def descriptors() -> int:
    """Return how many descriptors this process has."""
    return len(os.listdir("/proc/self/fd"))


def has_ended(pid: int) -> bool:
    """Return whether a process has ended, which may take a moment after it was killed."""
    try:
        process = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([process], [], [], PATIENCE_S)[0])
    finally:
        os.close(process)
