# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ring of inertial samples between two threads."""

import threading
from collections.abc import Callable

import numpy as np
import pytest

from viso.companion.vio.imu import CAPACITY, ImuBuffer
from viso.companion.vio.types import ImuSample, ImuWindow


class Waits:
    """Stands for the wait: remembers what was asked for, and may let something happen meanwhile."""

    def __init__(self, meanwhile: Callable[[], object] = lambda: None) -> None:
        self.meanwhile = meanwhile
        self.waited_s: list[float] = []

    def __call__(self, _: threading.Condition, ready: Callable[[], bool], timeout_s: float) -> None:
        if not ready():
            self.waited_s.append(timeout_s)
            self.meanwhile()


def sample(t_ns: int) -> ImuSample:
    return ImuSample(t_ns, np.zeros(3), np.zeros(3))


def filled(*times: int, capacity: int = CAPACITY, waits: Waits | None = None) -> ImuBuffer:
    buffer = ImuBuffer(capacity, wait=waits or Waits())
    for t_ns in times:
        buffer.add(sample(t_ns))
    return buffer


def times_of(window: ImuWindow) -> list[int]:
    return [one.t_ns for one in window.samples]


def test_ring_holds_ten_seconds_at_200_hz() -> None:
    buffer = filled(*range(2001))
    assert times_of(buffer.window(0, 2000)) == list(range(1, 2001))


@pytest.mark.parametrize("capacity", [1, 0, -1])
def test_ring_too_small_for_a_window_is_refused(capacity: int) -> None:
    with pytest.raises(ValueError, match=r"^capacity: "):
        ImuBuffer(capacity)


def test_oldest_samples_give_way() -> None:
    assert times_of(filled(10, 20, 30, 40, capacity=3).window(0, 40)) == [20, 30, 40]


def test_sample_is_taken() -> None:
    buffer = ImuBuffer()
    assert buffer.add(sample(10))


@pytest.mark.parametrize("t_ns", [10, 9])
def test_sample_not_later_than_the_last_is_refused(t_ns: int) -> None:
    buffer = filled(10)
    assert not buffer.add(sample(t_ns))
    assert times_of(buffer.window(0, 10)) == [10]


def test_window_goes_from_the_last_sample_before_to_the_first_after() -> None:
    window = filled(0, 10, 20, 30, 40, 50, 60).window(15, 42)
    assert (window.start_t_ns, window.end_t_ns) == (15, 42)
    assert times_of(window) == [10, 20, 30, 40, 50]


def test_samples_on_the_stamps_bracket_them() -> None:
    assert times_of(filled(0, 10, 20, 30, 40).window(10, 30)) == [10, 20, 30]


def test_window_before_all_samples_ends_with_the_first() -> None:
    assert times_of(filled(50, 60).window(10, 30)) == [50]


def test_window_after_all_samples_starts_with_the_last() -> None:
    assert times_of(filled(10, 20).window(30, 40)) == [20]


def test_window_of_an_empty_buffer_is_empty() -> None:
    assert times_of(filled().window(10, 20)) == []


def test_window_does_not_wait_for_what_is_there() -> None:
    waits = Waits()
    filled(10, 20, waits=waits).window(10, 20)
    assert waits.waited_s == []


def test_window_waits_for_the_sample_past_its_end() -> None:
    waits = Waits(lambda: buffer.add(sample(25)))
    buffer = filled(10, waits=waits)
    assert times_of(buffer.window(10, 20)) == [10, 25]
    assert waits.waited_s == [0.05]


def test_window_is_what_there_is_when_the_wait_is_over() -> None:
    waits = Waits(lambda: buffer.add(sample(15)))
    buffer = filled(10, waits=waits)
    assert times_of(buffer.window(10, 20, wait_s=0.02)) == [10, 15]
    assert waits.waited_s == [0.02]


def test_window_that_ends_before_it_starts_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^t1_ns: "):
        filled(10, 20).window(20, 10)


def test_real_wait_ends_as_soon_as_another_thread_adds_the_sample() -> None:
    buffer = ImuBuffer()
    writer = threading.Thread(target=lambda: [buffer.add(sample(t_ns)) for t_ns in (10, 20, 30)])
    writer.start()
    window = buffer.window(10, 30, wait_s=60)
    writer.join()
    assert times_of(window) == [10, 20, 30]


def test_real_wait_gives_up() -> None:
    buffer = ImuBuffer()
    buffer.add(sample(10))
    assert times_of(buffer.window(10, 20, wait_s=0)) == [10]


def test_windows_are_whole_while_another_thread_writes() -> None:
    buffer = ImuBuffer(capacity=50)
    writer = threading.Thread(target=lambda: [buffer.add(sample(t_ns)) for t_ns in range(2000)])
    writer.start()
    windows = [times_of(buffer.window(end - 5, end, wait_s=60)) for end in range(5, 2000, 5)]
    writer.join()
    assert all(times == list(range(times[0], times[-1] + 1)) for times in windows)
