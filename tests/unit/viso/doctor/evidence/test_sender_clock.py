# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A clock that departs is told from messages that wait, and how it departs."""

import numpy as np
import pytest

from viso.doctor.evidence.sender_clock import Departure, sender_clock
from viso.doctor.evidence.tracks import Floats, Sender, track_of

SENT_S = np.arange(0, 60, 0.04)
HALF = SENT_S > 30


def departure(stamp_s: Floats, arrival_s: Floats) -> tuple[Departure, float] | None:
    """Return how a clock departs, and its factor."""
    arrival_us = np.maximum.accumulate(np.round(1e6 * (10 + arrival_s)).astype(np.int64)).tolist()
    stamps = np.round(1e6 * (500 + stamp_s)).astype(np.int64).tolist()
    numbers = range(len(stamps))
    found = sender_clock(track_of(Sender(1, 197, "ODOMETRY"), numbers, arrival_us, stamps, [n % 256 for n in numbers]))
    return None if found is None else (found.departure, found.factor)


@pytest.mark.parametrize("factor", [1.05, 1.1, 2.0, 30.0, 0.9, 0.1, -1.0])
@pytest.mark.parametrize("jitter_s", [0.004, 0.15])
def test_factor_is_told(factor: float, jitter_s: float) -> None:
    late_s = np.random.default_rng(1).uniform(0, jitter_s, len(SENT_S))
    found = departure(factor * SENT_S, SENT_S + late_s)
    assert found is not None
    assert found[0] is Departure.RATE
    assert found[1] == pytest.approx(factor, rel=0.01, abs=0.01)


@pytest.mark.parametrize(
    ("stamp_s", "expected"),
    [
        (np.interp(SENT_S, (0, 20, 40, 60), (0, 20, 70, 95)), Departure.CHANGING),
        (np.interp(SENT_S, (0, 30, 60), (0, 15, 60)), Departure.CHANGING),
        (SENT_S + 0.8 * np.floor(SENT_S / 7), Departure.STEPS),
        (SENT_S + 30 * (np.arange(len(SENT_S)) % 3 == 0), Departure.ALTERNATING),
    ],
)
def test_way_of_departing_is_told(stamp_s: Floats, expected: Departure) -> None:
    found = departure(stamp_s, SENT_S)
    assert found is not None
    assert found[0] is expected


@pytest.mark.parametrize(
    "arrival_s",
    [
        SENT_S,
        np.ceil(SENT_S / 0.25) * 0.25,
        np.where(np.abs(SENT_S - 30) < 2, 32.0, SENT_S),
        SENT_S + np.interp(SENT_S, (0, 20, 30, 40, 60), (0, 0, 1, 0, 0)),
        SENT_S + np.interp(SENT_S, (0, 20, 60), (0, 1, 1)),
        SENT_S + 0.5 * HALF,
    ],
    ids=["steady", "in bunches", "held back", "in a queue", "in a queue that stays", "later from then on"],
)
def test_messages_that_wait_are_no_clock(arrival_s: Floats) -> None:
    assert departure(SENT_S, arrival_s) is None


@pytest.mark.parametrize(
    "stamp_s", [1.006 * SENT_S, SENT_S - 0.4 * HALF, SENT_S + 300 * HALF, np.floor(SENT_S)],
    ids=["a little fast", "set back once", "set ahead once", "whole seconds"],
)  # fmt: skip
def test_little_or_once_is_no_departure(stamp_s: Floats) -> None:
    assert departure(stamp_s, SENT_S) is None
