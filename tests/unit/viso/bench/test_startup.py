# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured of starting ends with a message that was accepted, or says that there was none."""

import time
from pathlib import Path

import pytest

from viso.bench import startup
from viso.errors import InputError


def test_time_counts_until_a_message_is_accepted(tmp_path: Path) -> None:
    part = startup.serve_until_accepted(tmp_path, time.perf_counter)
    assert part.elapsed_s > 0
    assert part.amount == 1
    assert (tmp_path / "storage.parm").exists()


def test_autopilot_that_does_not_start_is_told() -> None:
    with pytest.raises(InputError, match="viso serve has ended before it connected"):
        startup.serve_until_accepted(Path("/dev/null/logs"), time.perf_counter)
