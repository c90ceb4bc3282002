# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter logs the same bytes compiled and interpreted."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ap_core.native import PURE_VARIABLE
from ekf_stub.core import IS_COMPILED
from tests.parity.behaviours.logs import log_path

PROGRAM = "from viso.cli import main; main()"


def logged(name: str, folder: Path, *, pure: bool) -> bytes:
    """Return the log of a run over a recorded one."""
    path = folder / f"{pure}.BIN"
    command = [sys.executable, "-c", PROGRAM, "ekf", str(log_path(name)), "-o", str(path)]
    subprocess.run(command, env={**os.environ, PURE_VARIABLE: str(int(pure))}, capture_output=True, check=False)
    return path.read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(not IS_COMPILED, reason="the filter is interpreted in any case")
@pytest.mark.parametrize("name", ["2025-07/flight_voxl_reset", "2025-07/flow_take_off", "2025-07/bench_odometry"])
def test_interpreted_filter_logs_the_same_bytes(name: str, tmp_path: Path) -> None:
    compiled = logged(name, tmp_path, pure=False)
    assert len(compiled) > 100_000
    assert logged(name, tmp_path, pure=True) == compiled
