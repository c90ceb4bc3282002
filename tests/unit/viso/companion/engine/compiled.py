# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The example of an engine in C++, compiled once for each of its versions, and what is left of processes."""

import functools
import hashlib
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
CACHE = Path(__file__).parents[5] / ".pytest_cache" / "engines"


@functools.cache
def inertial_engine() -> str:
    """Return the command of the example; skips where there is no compiler."""
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no compiler for C++")
    flags = ("-std=c++17", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{INCLUDE_DIR}")
    digest = hashlib.sha256(repr((compiler, os.stat(compiler).st_mtime_ns, flags)).encode())
    for file in (SOURCE, INCLUDE_DIR / "viso_engine.hpp"):
        digest.update(file.read_bytes())
    program = CACHE / f"inertial_engine_{digest.hexdigest()}"
    if not program.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=CACHE) as folder:  # another process may be at it as well
            made = Path(folder) / "inertial_engine"
            subprocess.run([compiler, *flags, SOURCE, "-o", made], check=True)
            made.replace(program)
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
