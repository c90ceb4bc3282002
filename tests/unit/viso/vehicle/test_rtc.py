# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may set the clock, and that it never runs backwards."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.clock import VirtualClock
from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from viso.parameters.table import make_groups
from viso.vehicle.rtc import OLDEST_VALID_UTC_US, Rtc, RtcSource

NOON_US = 1_780_000_000_000_000
ALL_TYPES = 7
SOURCES = (RtcSource.GPS, RtcSource.SYSTEM_TIME, RtcSource.HARDWARE)


class Rig:
    """A clock that admits all sources unless told otherwise."""

    def __init__(self, types: int = ALL_TYPES, boot_utc_us: int = 0) -> None:
        self.clock = VirtualClock()
        self.armed = False
        params = ParamTable(make_groups(1, make_params()))
        params.set("BRD_RTC_TYPES", types)
        self.rtc = Rtc(self.clock, params, lambda: self.armed, boot_utc_us)


def test_time_is_unknown_at_first() -> None:
    assert Rig().rtc.utc_us() == 0


def test_time_runs_on_from_where_it_was_set() -> None:
    rig = Rig()
    rig.clock.set_us(1_000_000)
    rig.rtc.set_utc_us(NOON_US, RtcSource.GPS)
    rig.clock.set_us(3_000_000)
    assert rig.rtc.utc_us() == NOON_US + 2_000_000


@pytest.mark.parametrize("source", SOURCES)
def test_source_needs_its_bit(source: RtcSource) -> None:
    for types in range(8):
        rig = Rig(types)
        rig.rtc.set_utc_us(NOON_US, source)
        assert (rig.rtc.utc_us() != 0) is bool(types & 1 << source)


@pytest.mark.parametrize(("utc_us", "taken"), [(OLDEST_VALID_UTC_US - 1, False), (OLDEST_VALID_UTC_US, True)])
def test_time_before_2022_is_refused(utc_us: int, taken: bool) -> None:
    rig = Rig()
    rig.rtc.set_utc_us(utc_us, RtcSource.GPS)
    assert rig.rtc.utc_us() == (utc_us if taken else 0)


@pytest.mark.parametrize("armed", [False, True])
@pytest.mark.parametrize("second", SOURCES)
@pytest.mark.parametrize("first", SOURCES)
def test_worse_source_cannot_set_it_again_nor_when_armed_an_equal_one(
    first: RtcSource, second: RtcSource, armed: bool
) -> None:
    rig = Rig()
    rig.rtc.set_utc_us(NOON_US, first)
    rig.armed = armed
    rig.rtc.set_utc_us(NOON_US + 1, second)
    taken = second < first or (second == first and not armed)
    assert rig.rtc.utc_us() == NOON_US + taken


def test_time_that_does_not_move_the_clock_makes_its_source_the_one_that_counts() -> None:
    rig = Rig()
    rig.rtc.set_utc_us(NOON_US, RtcSource.HARDWARE)
    rig.rtc.set_utc_us(NOON_US, RtcSource.GPS)
    rig.rtc.set_utc_us(NOON_US + 5, RtcSource.SYSTEM_TIME)
    assert rig.rtc.utc_us() == NOON_US


def test_time_known_at_boot_is_that_of_a_clock_in_hardware() -> None:
    rig = Rig(boot_utc_us=NOON_US)
    assert rig.rtc.utc_us() == NOON_US
    rig.armed = True
    rig.rtc.set_utc_us(NOON_US + 1, RtcSource.HARDWARE)
    assert rig.rtc.utc_us() == NOON_US
    rig.rtc.set_utc_us(NOON_US + 1, RtcSource.SYSTEM_TIME)
    assert rig.rtc.utc_us() == NOON_US + 1


@pytest.mark.slow
@given(times=st.lists(st.tuples(st.integers(0, (1 << 64) - 1), st.sampled_from(SOURCES), st.integers(0, 10**7))))
def test_clock_never_runs_backwards(times: list[tuple[int, RtcSource, int]]) -> None:
    rig = Rig()
    before = 0
    for utc_us, source, step_us in times:
        rig.clock.set_us(rig.clock.micros64() + step_us)
        rig.rtc.set_utc_us(utc_us, source)
        assert rig.rtc.utc_us() >= before
        before = rig.rtc.utc_us()
