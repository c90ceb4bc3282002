# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual clock: it moves when told to, and wraps as the firmware's counters do."""

import pytest

from ap_core.clock import Clock, VirtualClock

WRAP_MS = 1 << 32


def test_clock_starts_at_boot() -> None:
    clock = VirtualClock()
    assert (clock.micros64(), clock.millis()) == (0, 0)


def test_clock_starts_at_a_given_time() -> None:
    assert VirtualClock(1_234_567).micros64() == 1_234_567


def test_clock_stands_still_between_readings() -> None:
    clock = VirtualClock(5)
    assert clock.micros64() == clock.micros64()


def test_virtual_clock_is_a_clock() -> None:
    clock: Clock = VirtualClock(7_000)
    assert clock.millis() == 7


@pytest.mark.parametrize(("time_us", "time_ms"), [(999, 0), (1000, 1), (1999, 1)])
def test_milliseconds_are_truncated(time_us: int, time_ms: int) -> None:
    assert VirtualClock(time_us).millis() == time_ms


def test_clock_can_be_set_back() -> None:
    clock = VirtualClock(10)
    clock.set_us(3)
    assert clock.micros64() == 3


def test_milliseconds_wrap_at_32_bits() -> None:
    clock = VirtualClock((WRAP_MS - 1) * 1000)
    assert clock.millis() == WRAP_MS - 1
    clock.set_us(WRAP_MS * 1000)
    assert clock.millis() == 0


def test_microseconds_go_on_where_milliseconds_wrap() -> None:
    assert VirtualClock(WRAP_MS * 1000).micros64() == WRAP_MS * 1000


@pytest.mark.parametrize("time_us", [(1 << 64) + 2, 2 - (1 << 64)])
def test_microseconds_wrap_at_64_bits_when_set(time_us: int) -> None:
    clock = VirtualClock(time_us)
    assert clock.micros64() == 2
    clock.set_us(time_us)
    assert clock.micros64() == 2
