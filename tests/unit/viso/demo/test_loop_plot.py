# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A closed loop's picture can be drawn, however little has happened."""

from pathlib import Path

import pytest

from tests.unit.viso.demo.hops import make_setup
from viso.demo.loop import CompanionLoop
from viso.demo.loop_plot import save_plot
from viso.logs.logger import MemoryLog

pytestmark = pytest.mark.slow


def test_loop_that_has_not_begun_can_be_drawn(tmp_path: Path) -> None:
    loop = CompanionLoop(make_setup(7.0), MemoryLog)
    loop.run_until(100_000)
    save_plot(loop, tmp_path / "loop.png")
    assert (tmp_path / "loop.png").read_bytes().startswith(b"\x89PNG")


def test_loop_that_was_stopped_halfway_can_be_drawn(tmp_path: Path) -> None:
    loop = CompanionLoop(make_setup(12.0, covered_s=[(7.8, 11.0)]), MemoryLog)
    loop.run_until(8_000_000)
    save_plot(loop, tmp_path / "loop.png")
    assert (tmp_path / "loop.png").read_bytes().startswith(b"\x89PNG")
