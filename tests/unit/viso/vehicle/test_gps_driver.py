# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GPS_INPUT into the state of the GPS: ignore flags, conversions and corrected time."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from mav_handlers.wire.messages import GPS_INPUT
from viso.vehicle.gps_driver import UNKNOWN_DOP, GpsState, Ignore, MavlinkGpsDriver

FIRST = GPS_INPUT(
    0, 0, 0, 100_000, 2300, 3, 473977418, 85455938, 488.5, 0.5, 0.75, 1.0, 2.0, 3.0, 0.25, 0.5, 1.5, 11, 9000
)
SECOND = GPS_INPUT(0, 0, 0, 100_200, 2301, 4, 1, 2, 10.25, 1.5, 1.75, 4.0, 5.0, 6.0, 1.25, 2.5, 3.5, 12, 18000)
DAY_MS = 86_400_000
WEEK_MS = 7 * DAY_MS

message_floats = st.floats(width=32)
fields: dict[str, st.SearchStrategy[Any]] = {
    "ignore_flags": st.integers(0, 0xFFFF),
    "time_week_ms": st.integers(0, 0xFFFFFFFF),
    "time_week": st.integers(0, 0xFFFF),
    "fix_type": st.integers(0, 255),
    "lat": st.integers(-(1 << 31), (1 << 31) - 1),
    "lon": st.integers(-(1 << 31), (1 << 31) - 1),
    "yaw": st.integers(0, 0xFFFF),
    "satellites_visible": st.integers(0, 255),
    **dict.fromkeys(
        ("alt", "hdop", "vdop", "vn", "ve", "vd", "speed_accuracy", "horiz_accuracy", "vert_accuracy"), message_floats
    ),
}
packets = st.fixed_dictionaries(fields).map(lambda values: replace(FIRST, **values))


def state_after(*packets: GPS_INPUT, now_ms: int = 5000) -> GpsState:
    driver, state = MavlinkGpsDriver(), GpsState()
    for packet in packets:
        driver.handle(packet, state, now_ms)
    return state


def seen(state: GpsState) -> dict[str, Any]:
    """Return what ignore flags decide about."""
    return {
        "alt": state.location.alt_cm,
        "hdop": state.hdop,
        "vdop": state.vdop,
        "north_east": (state.velocity.x, state.velocity.y),
        "down": state.velocity.z,
        "speed_accuracy": state.speed_accuracy,
        "horizontal_accuracy": state.horizontal_accuracy,
        "vertical_accuracy": state.vertical_accuracy,
    }


def test_solution_is_taken_as_it_comes() -> None:
    state = state_after(FIRST)
    assert (state.status, state.num_sats) == (3, 11)
    assert (state.time_week, state.time_week_ms) == (2300, 100_000)
    assert state.location == Location(473977418, 85455938, 48850)
    assert (state.hdop, state.vdop) == (50, 75)
    assert state.velocity == Vector3f(1, 2, 3)
    assert [state.speed_accuracy, state.horizontal_accuracy, state.vertical_accuracy] == [0.25, 0.5, 1.5]
    assert state.yaw_deg == 90


@given(flags=st.integers(0, 0xFFFF))
def test_ignored_fields_keep_what_they_had_and_the_others_do_not(flags: int) -> None:
    before, everything = seen(state_after(FIRST)), seen(state_after(SECOND))
    after = seen(state_after(FIRST, replace(SECOND, ignore_flags=flags)))
    decided_by = {
        "hdop": Ignore.HDOP,
        "vdop": Ignore.VDOP,
        "north_east": Ignore.VEL_HORIZ,
        "speed_accuracy": Ignore.SPEED_ACCURACY,
        "horizontal_accuracy": Ignore.HORIZONTAL_ACCURACY,
        "vertical_accuracy": Ignore.VERTICAL_ACCURACY,
    }
    for name, bit in decided_by.items():
        assert after[name] == (before if flags & bit else everything)[name]
    assert after["alt"] == (0 if flags & Ignore.ALT else 1025)
    if flags & Ignore.VEL_HORIZ:
        assert after["down"] == 3
    else:
        assert after["down"] == (0 if flags & Ignore.VEL_VERT else 6)


def test_what_was_never_given_is_unknown() -> None:
    state = state_after(replace(FIRST, ignore_flags=0xFF, yaw=0))
    assert (state.hdop, state.vdop) == (UNKNOWN_DOP, UNKNOWN_DOP)
    assert (state.speed_accuracy, state.horizontal_accuracy, state.vertical_accuracy) == (None, None, None)
    assert (state.yaw_deg, state.have_vertical_velocity) == (None, False)


def test_vertical_velocity_remains_available_once_it_was() -> None:
    assert not state_after(replace(FIRST, ignore_flags=Ignore.VEL_VERT)).have_vertical_velocity
    assert not state_after(replace(FIRST, ignore_flags=Ignore.VEL_HORIZ)).have_vertical_velocity
    assert state_after(FIRST, replace(SECOND, ignore_flags=Ignore.VEL_VERT)).have_vertical_velocity


@pytest.mark.parametrize(("alt_m", "alt_cm"), [(10.239, 1023), (-10.239, -1023), (0.0, 0)])
def test_altitude_is_truncated_to_centimetres(alt_m: float, alt_cm: int) -> None:
    assert state_after(replace(FIRST, alt=alt_m)).location.alt_cm == alt_cm


@pytest.mark.parametrize("alt_m", [math.nan, math.inf, -math.inf, 3e38])
def test_impossible_altitude_is_what_x86_makes_of_it(alt_m: float) -> None:
    assert state_after(replace(FIRST, alt=alt_m)).location.alt_cm == -(1 << 31)


@pytest.mark.parametrize(("yaw_cdeg", "yaw_deg"), [(1, 0.01), (9000, 90), (36000, 0), (36001, 0.01), (65535, 295.35)])
def test_yaw_is_in_degrees_and_36000_is_north(yaw_cdeg: int, yaw_deg: float) -> None:
    taken = state_after(replace(FIRST, yaw=yaw_cdeg)).yaw_deg
    assert taken is not None
    assert float(taken) == pytest.approx(yaw_deg, abs=3.1e-5)


def test_yaw_of_0_is_none_and_keeps_the_last() -> None:
    assert state_after(FIRST, replace(SECOND, yaw=0)).yaw_deg == 90


@pytest.mark.parametrize(
    ("north", "east", "speed", "course"), [(3, 4, 5, 53.130102), (1, -1, math.sqrt(2), 315), (-2, 0, 2, 180)]
)
def test_speed_and_course_over_ground(north: float, east: float, speed: float, course: float) -> None:
    state = state_after(replace(FIRST, vn=north, ve=east))
    assert state.ground_speed == pytest.approx(speed, rel=1e-6)
    assert state.ground_course == pytest.approx(course, rel=1e-6)


def test_news_are_told_once() -> None:
    driver = MavlinkGpsDriver()
    assert not driver.read(0)
    driver.handle(FIRST, GpsState(), 5000)
    assert driver.read(0)
    assert not driver.read(0)


# Time


def corrected(driver: MavlinkGpsDriver, week: int, week_ms: int, now_ms: int, fix_type: int = 3) -> int | None:
    state = GpsState()
    driver.handle(replace(FIRST, time_week=week, time_week_ms=week_ms, fix_type=fix_type), state, now_ms)
    return state.corrected_ms if state.corrected_ms_updated else None


def test_first_solution_was_made_when_it_arrived() -> None:
    assert corrected(MavlinkGpsDriver(), 2300, 1000, 5000) == 5000


def test_late_solution_was_made_when_its_time_says() -> None:
    driver = MavlinkGpsDriver()
    assert corrected(driver, 2300, 1000, 5000) == 5000
    assert corrected(driver, 2300, 1200, 5290) == 5200


def test_solution_that_took_less_time_corrects_the_clocks() -> None:
    driver = MavlinkGpsDriver()
    corrected(driver, 2300, 1000, 5080)
    assert corrected(driver, 2300, 1200, 5200) == 5200
    assert corrected(driver, 2300, 1400, 5480) == 5400


@pytest.mark.parametrize(("late_ms", "corrected_ms"), [(2000, 5200), (2001, 5201), (9000, 12_200)])
def test_solution_is_late_by_2_seconds_at_most(late_ms: int, corrected_ms: int) -> None:
    driver = MavlinkGpsDriver()
    corrected(driver, 2300, 1000, 5000)
    assert corrected(driver, 2300, 1200, 5200 + late_ms) == corrected_ms


def test_time_goes_on_over_the_end_of_a_week() -> None:
    driver = MavlinkGpsDriver()
    corrected(driver, 2300, WEEK_MS - 100, 5000)
    assert corrected(driver, 2301, 100, 5290) == 5200


def test_time_that_overflows_its_32_bits_looks_2_seconds_late() -> None:
    driver = MavlinkGpsDriver()
    corrected(driver, 2300, (1 << 32) - 100, 5000)
    assert corrected(driver, 2300, 100, 5290) == 3290


@pytest.mark.parametrize(("week", "fix_type"), [(0, 3), (2300, 2), (2300, 0), (0, 6)])
def test_time_without_a_week_or_a_3d_fix_is_not_used(week: int, fix_type: int) -> None:
    driver = MavlinkGpsDriver()
    assert corrected(driver, week, 1000, 5000, fix_type) is None
    # And does not teach the corrector anything.
    assert corrected(driver, 2300, 500, 6000) == 6000


@given(offset_ms=st.integers(0, WEEK_MS - 60_000), lags_ms=st.lists(st.integers(0, 300), min_size=2, max_size=30))
def test_corrected_times_are_as_regular_as_the_gps_from_its_least_lag_on(offset_ms: int, lags_ms: list[int]) -> None:
    driver = MavlinkGpsDriver()
    times = [corrected(driver, 2300, offset_ms + 200 * n, 5000 + 200 * n + lag) for n, lag in enumerate(lags_ms)]
    least = lags_ms.index(min(lags_ms))
    assert [time - 5000 - 200 * n for n, time in enumerate(times) if n >= least and time is not None] == [
        lags_ms[least]
    ] * (len(lags_ms) - least)


@pytest.mark.slow
@given(packets=st.lists(packets, min_size=1, max_size=5), now_ms=st.integers(3000, 0xFFFFFFFF))
def test_whatever_comes_the_state_fits_its_integers(packets: list[GPS_INPUT], now_ms: int) -> None:
    state = state_after(*packets, now_ms=now_ms)
    assert 0 <= state.hdop <= UNKNOWN_DOP
    assert 0 <= state.vdop <= UNKNOWN_DOP
    assert -(1 << 31) <= state.location.alt_cm < 1 << 31
    assert 0 <= state.corrected_ms <= 0xFFFFFFFF
    assert state.yaw_deg is None or 0 <= state.yaw_deg <= 360
    assert isinstance(state.ground_speed, np.float32)
    assert isinstance(f32(state.ground_course), np.float32)
