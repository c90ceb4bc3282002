# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of verdicts: the same again is counted, something else is news."""

from hypothesis import given
from hypothesis import strategies as st

from viso.web.runs import GAP_US, RunKey, Runs

GOOD = RunKey("link", "ODOMETRY", "1:197", "accepted", "consumed")
BAD = RunKey("link", "ODOMETRY", "1:197", "dropped", "odometry_frames")


def counts(runs: Runs) -> list[tuple[str, int]]:
    """Return the rule and count of each row, oldest first."""
    return [(row["rule"], row["count"]) for row in runs.all()]


def test_the_same_again_grows_its_row() -> None:
    runs = Runs()
    for time_us in (0, 5000, 10_000):
        runs.take(GOOD, {"reason": "why"}, time_us)
    (row,) = runs.all()
    assert (row["count"], row["first_s"], row["last_s"], row["reason"]) == (3, 0.0, 0.01, "why")


def test_another_verdict_is_a_row_of_its_own() -> None:
    runs = Runs()
    for key in (GOOD, BAD, GOOD, BAD):
        runs.take(key, {}, 1000)
    assert counts(runs) == [("consumed", 2), ("odometry_frames", 2)]


def test_what_comes_back_after_a_pause_is_news() -> None:
    runs = Runs()
    for time_us in (0, GAP_US - 1, 2 * GAP_US - 1):
        runs.take(GOOD, {}, time_us)
    assert counts(runs) == [("consumed", 2), ("consumed", 1)]


def test_time_that_goes_back_begins_a_row() -> None:
    runs = Runs()
    runs.take(GOOD, {}, 1000)
    runs.take(GOOD, {}, 0)
    assert counts(runs) == [("consumed", 1), ("consumed", 1)]


def test_changes_are_told_once() -> None:
    runs = Runs()
    runs.take(GOOD, {}, 0)
    runs.take(BAD, {}, 0)
    assert [row["rule"] for row in runs.take_changed()] == ["consumed", "odometry_frames"]
    runs.take(BAD, {}, 1)
    assert [(row["rule"], row["count"]) for row in runs.take_changed()] == [("odometry_frames", 2)]
    assert runs.take_changed() == []


@given(st.lists(st.integers(0, 30), max_size=100))
def test_no_sender_can_make_it_hold_more_than_the_limit(senders: list[int]) -> None:
    runs = Runs(limit=5)
    for sender in senders:
        runs.take(GOOD._replace(sender=f"{sender}:1"), {}, 0)
    assert len(runs.all()) <= 5
    assert len(runs.take_changed()) <= 5
    assert len(runs._open) <= 5
