# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The closed loop on the ground, without a compass: the vehicle takes its yaw from external navigation."""

from functools import cache

import pytest

from tests.unit.viso.demo.hops import make_setup, play
from viso.demo.record import AUTOPILOT
from viso.logs.logger import MemoryLog

pytestmark = pytest.mark.slow

NO_COMPASS = {"EK3_SRC1_YAW": 6, "COMPASS_USE": 0, "LOG_DISARMED": 1, "LOG_REPLAY": 1}


@cache
def without_compass(_run: int) -> tuple[list[str], bytes]:
    """Return what the vehicle says, and its log."""
    log = MemoryLog()
    loop = play(make_setup(9.0, params=NO_COMPASS), 9.0, open_log=lambda: log)
    return loop.record.texts(AUTOPILOT), bytes(log.data)


def test_yaw_is_aligned_to_external_navigation() -> None:
    wanted = ["EKF3 IMU0 yaw aligned", "EKF3 IMU0 is using external nav data", "Arming motors"]
    assert [text for text in without_compass(0)[0] if text in wanted] == wanted


def test_same_set_up_gives_the_same_log() -> None:
    first, second = without_compass(0)[1], without_compass(1)[1]
    assert len(first) > 100_000
    assert first == second
