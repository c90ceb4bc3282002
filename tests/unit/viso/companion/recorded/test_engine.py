# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a recorded engine reports what."""

from typing import Any

import numpy as np
import pytest

from mav_handlers.wire.messages import ODOMETRY, VISION_POSITION_DELTA
from tests.unit.viso.companion.recorded.conftest import MakeTrajectory
from viso.companion.recorded.engine import Playback, RecordedEngine
from viso.companion.recorded.messages import FORMS
from viso.companion.sender import OffsetClock


def played(engine: RecordedEngine, count: int = 99) -> list[tuple[int, Any]]:
    """Return when each of the next messages is due, and the message."""
    found: list[tuple[int, Any]] = []
    while (due_us := engine.next_due_us()) is not None and len(found) < count:
        found += [(due_us, message) for message in engine.report()]
    return found


def test_records_come_at_their_times(make_trajectory: MakeTrajectory) -> None:
    reports = played(RecordedEngine(make_trajectory(), Playback()))
    assert [due_us for due_us, _ in reports] == [0, 100_000, 200_000, 300_000, 400_000]
    assert [message.time_usec for _, message in reports] == [0, 100_000, 200_000, 300_000, 400_000]
    assert [message.x for _, message in reports] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert all(isinstance(message, ODOMETRY) for _, message in reports)


def test_after_the_last_record_there_is_nothing(make_trajectory: MakeTrajectory) -> None:
    engine = RecordedEngine(make_trajectory(2), Playback())
    played(engine)
    assert engine.next_due_us() is None
    with pytest.raises(IndexError):
        engine.report()


def test_latency_moves_the_sending_and_not_the_stamp(make_trajectory: MakeTrajectory) -> None:
    reports = played(RecordedEngine(make_trajectory(2), Playback(start_us=1_000_000, latency_us=40_000)))
    assert [(due_us, message.time_usec) for due_us, message in reports] == [
        (1_040_000, 1_000_000),
        (1_140_000, 1_100_000),
    ]


def test_stamps_are_those_of_the_senders_clock(make_trajectory: MakeTrajectory) -> None:
    reports = played(RecordedEngine(make_trajectory(2), Playback(clock=OffsetClock(7_000_000))))
    assert [(due_us, message.time_usec) for due_us, message in reports] == [(0, 7_000_000), (100_000, 7_100_000)]


def test_speed_counts_for_times_and_velocities(make_trajectory: MakeTrajectory) -> None:
    reports = played(RecordedEngine(make_trajectory(3), Playback(speed=2.0)))
    assert [due_us for due_us, _ in reports] == [0, 50_000, 100_000]
    assert [message.vx for _, message in reports] == pytest.approx([2.0, 2.0, 2.0])
    assert reports[-1][1].x == pytest.approx(0.2)


def test_loop_starts_again_a_period_after_the_last_record_as_after_a_reset(make_trajectory: MakeTrajectory) -> None:
    reports = played(RecordedEngine(make_trajectory(3), Playback(loop=True)), 6)
    assert [due_us for due_us, _ in reports] == pytest.approx([0, 100_000, 200_000, 300_000, 400_000, 500_000], abs=1)
    assert [message.reset_counter for _, message in reports] == [0, 0, 0, 1, 1, 1]
    assert reports[3][1].x == 0.0


def test_resets_of_the_recording_go_on_counting_over_laps(make_trajectory: MakeTrajectory) -> None:
    trajectory = make_trajectory(3, resets=np.array([0, 1, 1]))
    reports = played(RecordedEngine(trajectory, Playback(loop=True)), 7)
    assert [message.reset_counter for _, message in reports] == [0, 1, 1, 2, 3, 3, 4]


def test_reset_counter_wraps_at_256(make_trajectory: MakeTrajectory) -> None:
    reports = played(RecordedEngine(make_trajectory(2, resets=np.array([255, 256])), Playback()))
    assert [message.reset_counter for _, message in reports] == [255, 0]


def test_changes_start_with_the_second_record_and_not_across_a_reset(make_trajectory: MakeTrajectory) -> None:
    trajectory = make_trajectory(5, resets=np.array([0, 0, 0, 1, 1]))
    reports = played(RecordedEngine(trajectory, Playback(FORMS["delta"])))
    assert [due_us for due_us, _ in reports] == [100_000, 200_000, 400_000]
    assert all(isinstance(message, VISION_POSITION_DELTA) for _, message in reports)
    assert [message.position_delta[0] for _, message in reports] == pytest.approx([0.1] * 3)


def test_quality_is_that_of_the_playback(make_trajectory: MakeTrajectory) -> None:
    ((_, message), *_) = played(RecordedEngine(make_trajectory(), Playback(quality=55)))
    assert message.quality == 55


def test_same_playback_twice_says_the_same(make_trajectory: MakeTrajectory) -> None:
    first, second = (played(RecordedEngine(make_trajectory(), Playback())) for _ in range(2))
    assert repr(first) == repr(second)
