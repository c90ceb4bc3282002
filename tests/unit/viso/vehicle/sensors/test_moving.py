# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What sources tell ahead is what they say pass by pass, whatever happens in between."""

from collections.abc import Callable

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import numbers_of
from viso.vehicle.sensors.airframe import Demand
from viso.vehicle.sensors.moving import FlyingSource, MovingSource
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.script.script_file import parse_script
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource

PASS_US = 2500
BEGIN_US = 7_000_000
SCRIPT = 'start = "armed"\ndelay_s = 0.02\n[[leg]]\nshape = "point"\nto_ned_m = [1, 0, -3]\nduration_s = 4\n'

Rows = list[list[float]]


def scripted() -> MovingSource:
    return ScriptSource(ImuOptions(), parse_script(SCRIPT, "test"))


def disturb(source: MovingSource, number: int, now_us: int) -> None:
    """Do to a source what may change how its vehicle moves."""
    source.set_armed(True)
    source.take_pose(Vector3f(0.01 * number, 0, 0), Quaternion(1, 0, 0, 0), now_us // 1000, is_reset=False)
    if isinstance(source, FlyingSource):
        source.airframe.demand(Demand(0.1, -0.1, 9.0 + number, 0.3))


def single(source: MovingSource, times_us: range) -> Rows:
    """Return the inertial data of passes, one by one."""
    said = [source.sense(time_us) for time_us in times_us]
    return [numbers_of(sensors.delta) for sensors in said if sensors is not None]


def blocks(source: MovingSource, times_us: range, sizes: list[int]) -> Rows:
    """Return the same in blocks, of which some sizes are used up in turn, and of which all passes are told ahead."""
    rows: Rows = []
    while len(rows) < len(times_us):
        left = times_us[len(rows) :]
        ahead = source.ahead(left)[: sizes[len(rows) % len(sizes)]]
        if not len(ahead):
            rows += single(source, left[:1])
        else:
            source.pass_over(left[: len(ahead)])
            rows += ahead.tolist()
    return rows


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from([scripted, lambda: FollowSource(ImuOptions()), lambda: FlyingSource(ImuOptions())]),
    st.lists(st.integers(1, 50), min_size=1, max_size=4),
    st.lists(st.integers(1, 30), min_size=1, max_size=5),
)
def test_told_ahead_is_what_is_said_pass_by_pass(
    make: Callable[[], MovingSource], lengths: list[int], sizes: list[int]
) -> None:
    one, other = make(), make()
    begin_us = BEGIN_US
    for source in (one, other):
        source.sense(begin_us)
    for number, length in enumerate(lengths):
        times_us = range(begin_us + PASS_US, begin_us + PASS_US * (length + 1), PASS_US)
        begin_us = times_us[-1]
        np.testing.assert_array_equal(blocks(other, times_us, sizes), single(one, times_us))
        assert one.yaw_rad() == other.yaw_rad()
        other.ahead(range(begin_us + PASS_US, begin_us + 20 * PASS_US, PASS_US))  # which does not come like that
        for source in (one, other):
            disturb(source, number, begin_us)
