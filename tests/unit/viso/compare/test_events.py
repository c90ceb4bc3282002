# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Events beside those of a log: when they are the same, and how it is told that they are not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.compare.events import EventComparison, Timed, changes, compare_changes, compare_moves
from viso.compare.events import compare_texts as compare_named_texts
from viso.compare.tolerances import BENCH, tolerances_of

TEXTS = [(1.0, "initialised"), (2.0, "initial pos NED = 0.0,-2.0,0.2 (m)"), (3.0, "stopped aiding")]

TOLERANCES = tolerances_of(BENCH)


def compare_texts(recorded: Timed[str], ours: Timed[str]) -> EventComparison:
    return compare_named_texts("MSG", recorded, ours, TOLERANCES)


def lines(found: EventComparison) -> list[str]:
    return list(map(str, found.differences))


seconds = st.floats(0, 100).map(lambda value: round(value, 3))
words = st.sampled_from(["initialised", "yaw aligned", "stopped aiding", "initial pos NED = 1.0,-0.0,0.2 (m)"])
timed_texts = st.lists(st.tuples(seconds, words), max_size=12).map(sorted)


def test_same_texts_do_not_differ() -> None:
    assert compare_texts(TEXTS, TEXTS) == EventComparison((), 3, 0.0)


@pytest.mark.slow
@given(timed_texts)
def test_any_texts_are_the_same_as_themselves(texts: list[tuple[float, str]]) -> None:
    assert compare_texts(texts, texts) == EventComparison((), len(texts), 0.0)


@given(timed_texts, timed_texts)
def test_texts_that_do_not_differ_are_as_many_and_the_same_words(
    ours: list[tuple[float, str]], recorded: list[tuple[float, str]]
) -> None:
    if not compare_texts(recorded, ours).differences:
        assert [text for _, text in ours] == [text for _, text in recorded]


@pytest.mark.parametrize(("apart_s", "differ"), [(0.25, False), (-0.25, False), (0.251, True), (-0.251, True)])
def test_text_may_come_a_quarter_of_a_second_early_or_late(apart_s: float, differ: bool) -> None:
    ours = [(time_s + apart_s, text) for time_s, text in TEXTS]
    found = compare_texts(TEXTS, ours)
    assert bool(found.differences) is differ
    assert found.worst_s == pytest.approx(abs(apart_s))


@pytest.mark.parametrize("number", ["-1.9", "2.0", "-2.00"])
def test_number_in_a_text_is_the_same(number: str) -> None:
    ours = [(time_s, text.replace("-2.0", number)) for time_s, text in TEXTS]
    assert compare_texts(TEXTS, ours).differences


def test_missing_text_is_told() -> None:
    assert lines(compare_texts(TEXTS, TEXTS[:2])) == ["3.000 s: MSG: only recorded: 'stopped aiding'"]


def test_text_too_many_is_told() -> None:
    assert lines(compare_texts(TEXTS[1:], TEXTS)) == ["1.000 s: MSG: only ours: 'initialised'"]


def test_text_at_another_time_is_told_once() -> None:
    ours = [*TEXTS[:2], (3.5, "stopped aiding")]
    (line,) = lines(compare_texts(TEXTS, ours))
    assert line == "3.000 s: MSG: 'stopped aiding' at 3.000 s recorded, 'stopped aiding' at 3.500 s of ours"


def test_order_of_texts_counts() -> None:
    ours, recorded = [(1.0, "a"), (1.0, "b")], [(1.0, "b"), (1.0, "a")]
    assert len(compare_texts(recorded, ours).differences) == 2


# Changes


def test_change_is_where_a_value_differs_from_the_one_before() -> None:
    times = np.array([0.1, 0.2, 0.3, 0.4])
    assert changes(times, [5, 5, 7, 5]) == [(0.3, 7), (0.4, 5)]
    assert changes(times, [5, 5, 7, 5], with_first=True) == [(0.1, 5), (0.3, 7), (0.4, 5)]


def test_nothing_changes_in_nothing() -> None:
    assert changes(np.array([]), [], with_first=True) == []


def test_change_to_another_value_is_told_in_hex() -> None:
    found = compare_changes("XKF4.SS", [(1.0, 0x100A7)], [(1.0, 0xA7)], TOLERANCES)
    assert lines(found) == ["1.000 s: XKF4.SS: only ours: 0xa7", "1.000 s: XKF4.SS: only recorded: 0x100a7"]


def test_same_changes_do_not_differ() -> None:
    found = compare_changes("XKF4.TS", [(1.0, 50.0), (2.0, 48.0)], [(1.0, 50.0), (2.1, 48.0)], TOLERANCES)
    assert found.differences == ()


def test_reset_by_as_much_does_not_differ() -> None:
    ours, recorded = [(1.0, (4.0005, 0.0)), (2.0, (-30.0, 1.0))], [(1.1, (4.0, 0.0)), (2.0, (-29.9995, 1.0))]
    found = compare_moves(recorded, ours, TOLERANCES)
    assert (found.differences, found.matched) == ((), 2)
    assert found.worst_s == pytest.approx(0.1)


def test_reset_by_something_else_is_told() -> None:
    found = compare_moves([(1.0, (4.0, 0.0))], [(1.0, (4.2, 0.0))], TOLERANCES)
    assert lines(found) == [
        "1.000 s: reset: moved by 4.00, 0.00 m at 1.000 s recorded, moved by 4.20, 0.00 m at 1.000 s of ours"
    ]


def test_missing_reset_is_told() -> None:
    assert lines(compare_moves([(1.0, (4.0, 0.0))], [], TOLERANCES)) == [
        "1.000 s: reset: only recorded: moved by 4.00, 0.00 m"
    ]
