# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter follows a scripted flight, given its inertial data and external navigation that agrees with it."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.unit.viso.vehicle.sensors.conftest import LOOP_US
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.script.script_file import parse_script
from viso.vehicle.sensors.source import ImuOptions

if TYPE_CHECKING:
    from tests.unit.viso.vehicle.sensors.conftest import FilterLoop, MakeLoop

pytestmark = pytest.mark.slow

POSE_US = 33_333
DELAY_MS = 10
ARMED_US = 6_000_000
LANDED_US = 50_000_000

FLIGHT = """
start = "armed"
delay_s = 3
[[leg]]
shape = "point"
to_ned_m = [0, 0, -3]
duration_s = 5
[[leg]]
shape = "figure_eight"
length_m = 8
width_m = 4
period_s = 12
laps = 2
nose = "path"
[[leg]]
shape = "point"
to_ned_m = [0, 0, 0]
duration_s = 6
"""


def observe(loop: "FilterLoop", source: ScriptSource) -> None:
    """Hand in pose and velocity of a moment ago, without any error."""
    truth = source.truth(loop.now_us - 1000 * DELAY_MS)
    loop.tell_pose(truth.pos_ned, truth.quat_wxyz, delay_ms=DELAY_MS)
    loop.tell_velocity(truth.vel_ned, delay_ms=DELAY_MS)


def test_filter_follows_a_flight_through_eights(make_loop: "MakeLoop") -> None:
    source = ScriptSource(ImuOptions(), parse_script(FLIGHT, "test", 0.5))
    loop = make_loop(source)
    worst_m, passes_aided, next_pose_us = 0.0, 0, 0
    for now_us in range(LOOP_US, LANDED_US, LOOP_US):
        loop.armed = now_us >= ARMED_US
        source.set_armed(loop.armed)
        assert loop.run_pass()
        if now_us >= next_pose_us:
            next_pose_us += POSE_US
            observe(loop, source)
        if loop.core.initialised and loop.is_aided():
            passes_aided += 1
            miss = np.subtract(loop.core.position(), source.truth(now_us).pos_ned)
            worst_m = max(worst_m, float(np.linalg.norm(miss)))
    assert loop.now_us == LANDED_US - LOOP_US
    assert source.truth(LANDED_US).pos_ned == (0.0, 0.0, 0.0)
    assert passes_aided * LOOP_US > LANDED_US - ARMED_US
    assert worst_m < 0.05
