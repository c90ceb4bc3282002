# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The AHRS of a vehicle that stands still."""

import math

import pytest

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ports import Ahrs
from ekf_stub.ahrs_bench import BenchAhrs
from ekf_stub.ext_nav_log import ExtNavLog
from ekf_stub.sources import EkfSources

HEADING_RAD = math.radians(120)
SETTLED_MS = 22_456


class NoRecords:
    """A log that takes anything."""

    def write(self, structure: LogStructure, values: object) -> None: ...


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


def make(clock: VirtualClock, *, has_compass: bool = True) -> BenchAhrs:
    log = ExtNavLog(NoRecords(), lambda: False)
    sources = EkfSources(lambda _name: 0)
    return BenchAhrs(clock, sources, log, heading_rad=HEADING_RAD, has_compass=lambda: has_compass)


def values_of(vector: Vector3f | None) -> tuple[LogValue, ...] | None:
    return None if vector is None else vector.to_tuple()


def test_it_is_what_the_port_asks_for(clock: VirtualClock) -> None:
    ahrs: Ahrs = make(clock)
    assert ahrs.get_yaw_rad() == f32(HEADING_RAD)


@pytest.mark.parametrize("time_ms", [0, 3_000, 60_000])
def test_yaw_is_the_heading_at_all_times(clock: VirtualClock, time_ms: int) -> None:
    clock.set_us(time_ms * 1000)
    assert make(clock).get_yaw_rad() == f32(HEADING_RAD)


def test_attitude_is_level_with_the_heading(clock: VirtualClock) -> None:
    clock.set_us(2_455_000)
    quat = make(clock).get_quaternion()
    assert quat == Quaternion.from_euler(f32(0), f32(0), f32(HEADING_RAD))


def test_there_is_no_attitude_before_the_start(clock: VirtualClock) -> None:
    clock.set_us(2_454_999)
    assert make(clock).get_quaternion() is None


@pytest.mark.parametrize(("time_us", "has_compass", "initialised"), [
    (2_454_999, True, False),
    (2_455_000, True, True),
    (2_455_000, False, False),
])  # fmt: skip
def test_dcm_yaw_takes_a_compass(clock: VirtualClock, time_us: int, has_compass: bool, initialised: bool) -> None:
    clock.set_us(time_us)
    assert make(clock, has_compass=has_compass).dcm_yaw_initialised() is initialised


@pytest.mark.parametrize(("time_ms", "position"), [(22_455, None), (SETTLED_MS, (0, 0, 0))])
def test_it_stands_at_the_origin_once_settled(
    clock: VirtualClock, time_ms: int, position: tuple[int, ...] | None
) -> None:
    clock.set_us(time_ms * 1000)
    assert values_of(make(clock).get_relative_position_NED_origin_float()) == position


def test_it_does_not_follow_what_it_is_given(clock: VirtualClock) -> None:
    clock.set_us(SETTLED_MS * 1000)
    ahrs = make(clock)
    ahrs.writeExtNavData(Vector3f(5, 6, 7), Quaternion(), f32(0.2), f32(0.2), 22_440, 10, 0)
    assert values_of(ahrs.get_relative_position_NED_origin_float()) == (0, 0, 0)
