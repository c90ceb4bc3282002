# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter follows a scripted flight, given its inertial data and external navigation that agrees with it."""

from collections import Counter
from functools import cache

import numpy as np
import pytest

from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.core.ekf3_core import Ekf3Core, Frame
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.inputs.obs_ring import ring_sizes
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.reports.core_texts import CoreTexts
from viso.parameters.table import make_groups
from viso.sensors.options import ImuOptions
from viso.sensors.script.script import ScriptSource
from viso.sensors.script.script_file import parse_script

pytestmark = pytest.mark.slow

LOOP_US = 2500
POSE_US = 33_333
DELAY_MS = 10
LONGEST_DELAY_MS = 60
ARMED_US = 6_000_000
LANDED_US = 50_000_000
EXT_NAV = 6
NOISE = {"pos": 0.2, "angle": 0.2, "vel": 0.1}

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


class NoTexts:
    def send_text(self, severity: int, text: str) -> None:
        pass


def make_core() -> Ekf3Core:
    params = ParamTable(make_groups(1, make_params()))
    for source in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW"):
        params.set(f"EK3_SRC1_{source}", EXT_NAV)

    @cache
    def get_float(name: str) -> float:
        found = params.find(f"EK3_{name}")
        assert found is not None
        return float(found.value)

    return Ekf3Core(
        EkfSources(lambda name: params.get_int(f"EK3_{name}")),
        get_float,
        ring_sizes(LONGEST_DELAY_MS),
        CoreTexts(NoTexts(), (0,)),
        Counter(),
        lambda: False,
    )


def observe(core: Ekf3Core, source: ScriptSource, now_us: int) -> None:
    """Hand in pose and velocity of a moment ago, without any error."""
    truth = source.truth(now_us - 1000 * DELAY_MS)
    pos, quat, errors = Vector3f(*truth.pos_ned), Quaternion(*truth.quat_wxyz), (NOISE["pos"], NOISE["angle"])
    pos_error, angle_error = map(np.float32, errors)
    core.ingest.write_pose(pos, quat, (pos_error, angle_error), now_us // 1000, DELAY_MS, 0)
    core.ingest.write_velocity(Vector3f(*truth.vel_ned), np.float32(NOISE["vel"]), now_us // 1000, DELAY_MS)


def test_filter_follows_a_flight_through_eights() -> None:
    source = ScriptSource(ImuOptions(), parse_script(FLIGHT, "test", 0.5))
    core = make_core()
    worst_m, passes_aided, next_pose_us = 0.0, 0, 0
    for now_us in range(LOOP_US, LANDED_US, LOOP_US):
        armed = now_us >= ARMED_US
        source.set_armed(armed)
        sensors = source.sense(now_us)
        assert sensors is not None
        core.run(Frame(now_us, sensors.delta, armed=armed, baro=sensors.baro))
        if now_us >= next_pose_us:
            next_pose_us += POSE_US
            observe(core, source, now_us)
        if core.initialised and core.aiding.mode is AidingMode.ABSOLUTE:
            passes_aided += 1
            miss = core.position() - source.truth(now_us).pos_ned
            worst_m = max(worst_m, float(np.linalg.norm(miss)))
    assert source.truth(LANDED_US).pos_ned == (0.0, 0.0, 0.0)
    assert passes_aided * LOOP_US > LANDED_US - ARMED_US
    assert worst_m < 0.05
