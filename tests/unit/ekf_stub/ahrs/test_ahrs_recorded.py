# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitude and position of a log between its records."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.clock import VirtualClock
from ap_core.location import Location
from ap_core.log_structure import LogStructure
from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs, RecordedStates
from ekf_stub.core.params import EkfSources
from ekf_stub.log.ext_nav_log import ExtNavLog

Rows = list[tuple[float, ...]]
PLACE = Location(-353_632_610, 1_491_652_300, 58_400)


class NoRecords:
    """A log that takes anything."""

    def write(self, structure: LogStructure, values: object) -> None: ...


def states(attitudes: Rows, positions: Rows | None = None, start_s: float = math.nan) -> RecordedStates:
    """Make states of rows (time in s, roll, pitch, yaw in deg) and (time in s, position and velocity NED)."""
    att, pos = np.array(attitudes, dtype=float).reshape(-1, 4), np.array(positions or [], dtype=float).reshape(-1, 7)
    start_us = 1e6 * (pos[0, 0] if len(pos) and math.isnan(start_s) else start_s)
    return RecordedStates(att[:, 0] * 1e6, att[:, 1:], pos[:, 0] * 1e6, pos[:, 1:4], pos[:, 4:], start_us)


def at(time_s: float, recorded: RecordedStates) -> RecordedAhrs:
    clock = VirtualClock(round(time_s * 1e6))
    return RecordedAhrs(clock, EkfSources(lambda _name: 0), ExtNavLog(NoRecords(), lambda: False), recorded)


def yaw_deg(time_s: float, recorded: RecordedStates) -> float:
    return math.degrees(at(time_s, recorded).get_yaw_rad())


def test_yaw_is_interpolated() -> None:
    assert yaw_deg(3.25, states([(3, 0, 0, 10), (4, 0, 0, 20)])) == pytest.approx(12.5, abs=1e-4)


@pytest.mark.parametrize(("first", "second", "middle"), [(350, 20, 5), (20, 350, 5), (170, 200, -175), (359, 357, -2)])
def test_yaw_goes_the_short_way_round(first: float, second: float, middle: float) -> None:
    assert yaw_deg(3.5, states([(3, 0, 0, first), (4, 0, 0, second)])) == pytest.approx(middle, abs=1e-4)


@settings(deadline=None)
@given(st.lists(st.floats(0, 359.99), min_size=2, max_size=20))
def test_yaw_at_a_record_is_the_records(yaws: list[float]) -> None:
    recorded = states([(3 + number, 0, 0, yaw) for number, yaw in enumerate(yaws)])
    for number, yaw in enumerate(yaws):
        assert abs(math.remainder(yaw_deg(3 + number, recorded) - yaw, 360)) < 1e-3


@settings(deadline=None)
@given(st.lists(st.floats(0, 359.99), min_size=2, max_size=8), st.floats(0, 10))
def test_yaw_stays_within_half_a_turn(yaws: list[float], time_s: float) -> None:
    recorded = states([(3 + number, 0, 0, yaw) for number, yaw in enumerate(yaws)])
    assert abs(yaw_deg(time_s, recorded)) <= 180.001


@pytest.mark.parametrize(("time_s", "yaw"), [(1.0, 10), (9.0, 20)])
def test_yaw_is_kept_before_the_first_and_after_the_last_record(time_s: float, yaw: float) -> None:
    assert yaw_deg(time_s, states([(3, 0, 0, 10), (4, 0, 0, 20)])) == pytest.approx(yaw, abs=1e-4)


def test_attitude_is_interpolated() -> None:
    quat = at(3.5, states([(3, 2, -4, 350), (4, 4, -8, 10)])).get_quaternion()
    assert quat is not None
    assert [math.degrees(angle) for angle in quat.to_euler()] == pytest.approx([3, -6, 0], abs=1e-4)


def test_there_is_no_attitude_before_the_first_record() -> None:
    recorded = states([(3, 0, 0, 10)])
    assert at(2.999, recorded).get_quaternion() is None
    assert not at(2.999, recorded).dcm_yaw_initialised()
    assert at(3.0, recorded).dcm_yaw_initialised()


def test_position_is_interpolated() -> None:
    pos = at(
        5.5, states([(3, 0, 0, 0)], [(5, 1, 2, -3, 1, 2, -3), (6, 2, 4, -6, 1, 2, -3)])
    ).get_relative_position_NED_origin_float()
    assert pos is not None
    assert [float(value) for value in pos.to_tuple()] == [1.5, 3.0, -4.5]


@given(st.floats(0, 1))
def test_position_follows_an_acceleration_between_two_records(time_s: float) -> None:
    def fallen(since_s: float) -> tuple[float, ...]:
        return 3 + since_s, 0, 0, 4.9 * since_s**2, 0, 0, 9.8 * since_s

    pos = at(3 + time_s, states([(3, 0, 0, 0)], [fallen(0), fallen(1)])).get_relative_position_NED_origin_float()
    assert pos is not None
    assert float(pos.z) == pytest.approx(4.9 * time_s**2, abs=1e-4)


@pytest.mark.parametrize(("time_s", "north_m"), [(4.9, 0.0), (5.0, 1.0), (7.0, 1.0)])
def test_position_goes_on_before_the_first_record_and_stays_after_the_last(time_s: float, north_m: float) -> None:
    recorded = states([(3, 0, 0, 0)], [(5, 1, 2, -3, 10, 0, 0)], start_s=4.8)
    pos = at(time_s, recorded).get_relative_position_NED_origin_float()
    assert pos is not None
    assert float(pos.x) == pytest.approx(north_m, abs=1e-5)


def test_there_is_no_position_before_the_first() -> None:
    recorded = states([(3, 0, 0, 0)], [(5, 1, 2, -3, 10, 0, 0)])
    assert at(4.999, recorded).get_relative_position_NED_origin_float() is None


def test_there_is_no_position_in_a_log_without_any() -> None:
    assert at(9, states([(3, 0, 0, 0)])).get_relative_position_NED_origin_float() is None


def test_states_without_an_attitude_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one ATT"):
        states([])


def test_origin_is_that_of_the_logs_gps_from_its_time_on() -> None:
    recorded = replace(states([(3, 0, 0, 0)], [(3, 0, 0, -2, 0, 0, 0)]), gps_origin=(5e6, PLACE))
    assert at(4.9, recorded).origin() is None
    assert at(5, recorded).origin() == PLACE
    location = at(5, recorded).get_location()
    assert location is not None
    assert location.alt_cm == PLACE.alt_cm + 200


def test_origin_that_was_set_stays() -> None:
    ahrs = at(4.9, replace(states([(3, 0, 0, 0)]), gps_origin=(5e6, PLACE)))
    other = Location(1, 2, 3)
    assert ahrs.set_origin(other)
    assert ahrs.origin() == other
