# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a closed loop remembers."""

import numpy as np
import pytest

from ekf_stub.reports import AidingMode, FilterFlag
from tests.unit.viso.demo.hops import ARM_S, COMPANION_S, HOP_END_S, HOP_RESTART_S, hop
from viso.companion.vio.types import VioState
from viso.demo.record import AUTOPILOT, COMPANION, Health, LoopRecord, LoopText, StateSpan

pytestmark = pytest.mark.slow

TRACKING, DEGRADED, INIT = VioState.TRACKING, VioState.DEGRADED, VioState.INIT


def test_states_are_spans_without_gaps() -> None:
    seen = [(2, INIT), (3, TRACKING), (4, TRACKING), (5, DEGRADED), (7, TRACKING)]
    record = LoopRecord(health=[Health(time_us, state) for time_us, state in seen])
    assert record.states(1, 9) == [
        StateSpan(1, 3, INIT),
        StateSpan(3, 5, TRACKING),
        StateSpan(5, 7, DEGRADED),
        StateSpan(7, 9, TRACKING),
    ]


def test_without_a_frame_the_odometry_begins_for_ever() -> None:
    assert LoopRecord().states(5, 3) == [StateSpan(5, 5, INIT)]


def test_texts_are_told_apart_by_who_said_them() -> None:
    record = LoopRecord(
        all_texts=[LoopText(1, AUTOPILOT, 6, "a"), LoopText(2, COMPANION, 4, "b"), LoopText(3, AUTOPILOT, 2, "c")]
    )
    assert (record.texts(AUTOPILOT), record.texts(COMPANION)) == (["a", "c"], ["b"])


@pytest.fixture(scope="module")
def record() -> LoopRecord:
    """What a short flight has left."""
    return hop().record


def test_both_are_heard(record: LoopRecord) -> None:
    assert "Arming motors" in record.texts(AUTOPILOT)
    assert "warm start applied" in record.texts(COMPANION)


def test_what_is_repeated_while_degraded_is_left_out(record: LoopRecord) -> None:
    assert DEGRADED in {health.state for health in record.health}
    assert not any(text.startswith("VIO degraded") for text in record.texts(COMPANION))


def test_estimates_are_looked_at_twenty_times_a_second(record: LoopRecord) -> None:
    times_us = [estimate.time_us for estimate in record.estimates]
    assert (times_us[0], times_us[-1]) == (0, round(HOP_END_S * 1e6))
    assert set(np.diff(times_us)) == {50_000}


def test_estimates_tell_what_the_autopilot_knows_when(record: LoopRecord) -> None:
    by_time = {estimate.time_us: estimate for estimate in record.estimates}
    booting, waiting, flying = by_time[1_000_000], by_time[6_400_000], by_time[10_000_000]
    assert booting.sigmas_m is None
    assert booting.flags is FilterFlag.UNINITIALISED
    assert (waiting.pos_ned, waiting.mode, waiting.is_armed) == (None, AidingMode.NONE, False)
    assert not waiting.is_camera_healthy
    assert flying.pos_ned is not None
    assert flying.sigmas_m is not None
    assert (flying.mode, flying.is_armed, flying.is_camera_healthy) == (AidingMode.ABSOLUTE, True, True)


def test_arming_is_where_it_should_be(record: LoopRecord) -> None:
    first = next(estimate.time_us for estimate in record.estimates if estimate.is_armed)
    assert first == pytest.approx(ARM_S * 1e6, abs=60_000)


def test_messages_are_told_with_their_outcome(record: LoopRecord) -> None:
    accepted = [one.message.quality for one in record.arrived if one.is_accepted]
    withheld = [one.message.quality for one in record.arrived if not one.is_accepted]
    assert min(accepted) >= 10 > max(withheld)
    assert record.arrived[0].time_us > COMPANION_S * 1e6


def test_reset_moves_the_position_once(record: LoopRecord) -> None:
    moved = [estimate.moved_ne for estimate in record.estimates if estimate.time_us > HOP_RESTART_S * 1e6]
    assert len(set(moved)) == 2


def test_outcomes_are_final(record: LoopRecord) -> None:
    accepted = sum(one.is_accepted for one in record.arrived)
    poses = [test for test in record.outcomes if test.outcome.kind == "pose"]
    assert len(poses) == pytest.approx(accepted, abs=3)  # the last ones wait for their turn
