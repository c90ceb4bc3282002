# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparer: which values are equal, and what is reported of those that are not."""

import math
from typing import Any

import numpy as np
import pytest

from viso.compare.differences import (
    ABSENT,
    Difference,
    Error,
    Row,
    column_differences,
    error_of,
    is_equal,
    row_differences,
    sequence_differences,
)
from viso.compare.tolerances import CAPTURE, LOG, TOLERANCES, UNITS, Tolerance, tolerances_of

SHARE = Tolerance("", (), "of the value", "", within=1e-6, is_share=True)
CENTIMETRE = Tolerance("", (), "m", "", within=0.01)
TIMES_S = np.array([1.0, 2.0, 3.0])
ZEROS = np.zeros(3)


@pytest.mark.parametrize(
    ("recorded", "ours", "tolerance", "equal"),
    [
        (np.float32(0.0), np.float32(-0.0), None, False),
        (np.float32(math.nan), np.float32(math.nan), None, True),
        (np.float32(1.0), np.nextafter(np.float32(1.0), np.float32(2.0)), None, False),
        (np.float32(1.0), np.float32(1.01), CENTIMETRE, True),
        (np.float32(1.0), np.float32(1.02), CENTIMETRE, False),
        (np.float32(math.nan), np.float32(1.0), CENTIMETRE, False),
        (7, 7, None, True),
        (7, 8, None, False),
        (7.0, 7, None, True),
        (1.0, 1.0000009, SHARE, True),
        (1.0, 1.0000011, SHARE, False),
        (0.0, 1e-13, SHARE, True),
        (math.nan, math.nan, SHARE, True),
        (math.inf, math.inf, SHARE, True),
        (math.inf, 1.0, SHARE, False),
        ("a", 1.0, SHARE, False),
        ([1.0, 2.0], (1.0, 2.0), SHARE, True),
        ([1.0, 2.0], (1.0, 2.1), SHARE, False),
        ([1.0, 2.0], (1.0,), SHARE, False),
        ("a", "a", None, True),
        (ABSENT, 1, None, False),
    ],
)
def test_values_are_equal_bit_by_bit_or_within_their_tolerance(
    recorded: Any, ours: Any, tolerance: Tolerance | None, equal: bool
) -> None:
    assert is_equal("A.b", recorded, ours, tolerance) is equal
    assert is_equal("A.b", ours, recorded, tolerance) is equal


def differences(recorded: list[Row], ours: list[Row], backend: int = 1) -> list[Difference]:
    return list(row_differences("line 7", recorded, ours, tolerances_of(CAPTURE, backend), units=UNITS))


def test_difference_has_its_place_its_field_both_values_and_the_unit() -> None:
    first, second = ([Row("", {"type": "A"}), Row("VISP", {"PX": np.float32(x), "Q": 1})] for x in (1.5, 1.25))
    [found] = differences(first, second)
    assert found == Difference("line 7", "VISP.PX", "1.5", "1.25", "m")
    assert str(found) == "line 7: VISP.PX: 1.5 m recorded, 1.25 m of ours"
    assert differences(first, first) == []


def test_tolerance_is_that_of_the_backend() -> None:
    first, second = ([Row("VISP", {"PX": np.float32(x)})] for x in (1.5, 1.501))
    assert [len(differences(first, second, backend)) for backend in (1, 2, 3)] == [1, 0, 0]


def test_other_records_are_one_difference_of_names() -> None:
    ours = [Row("VISP", {"PX": 1}), Row("VISP", {"PX": 1}), Row("VISV", {})]
    assert differences([], ours) == [Difference("line 7", "records", "none", "2 VISP, VISV")]


def test_value_that_one_side_lacks_is_a_difference() -> None:
    first, second = [Row("", {"pose": "a"})], [Row("", {"yaw": "b"})]
    assert list(map(str, differences(first, second))) == [
        "line 7: pose: only recorded: a",
        "line 7: yaw: only ours: b",
    ]


def test_column_differs_where_it_is_too_far_apart() -> None:
    ours = np.array([0.0, 0.012, math.nan])
    found = list(column_differences("XKF1.PN", 1, TIMES_S, ZEROS, ours, tolerances_of(LOG)))
    assert found == [
        Difference("2.000 s", "XKF1[1].PN", "0", "0.012", "m"),
        Difference("3.000 s", "XKF1[1].PN", "0", "nan", "m"),
    ]


def test_column_with_too_large_an_rms_differs_where_it_is_worst() -> None:
    ours = np.array([0.01, 0.04, 0.01])
    [found] = column_differences("XKF3.IPN", 0, TIMES_S, ZEROS, ours, tolerances_of(LOG))
    assert (found.place, found.ours) == ("2.000 s", "0.04")
    assert list(column_differences("XKF3.IPN", 0, TIMES_S, ZEROS, ours / 2, tolerances_of(LOG))) == []


def test_column_without_a_tolerance_is_equal_or_differs() -> None:
    ours = np.array([0.0, 1.0, 0.0])
    assert len(list(column_differences("XKF4.SS", 0, TIMES_S, ZEROS, ours, tolerances_of(LOG)))) == 1
    assert list(column_differences("XKF4.SS", 0, TIMES_S[:0], ZEROS[:0], ZEROS[:0], {})) == []


def test_full_turn_is_no_difference() -> None:
    yaws = np.array([0.01, 359.99, 180.0]), np.array([359.995, 0.005, -180.0])
    assert list(column_differences("XKF1.Yaw", 0, TIMES_S, *yaws, tolerances_of(LOG))) == []


def test_error_is_the_rms_and_the_most() -> None:
    assert error_of(np.array([3.0, -4.0])) == Error(math.sqrt(12.5), 4.0)
    assert error_of(np.zeros(0)) == Error(0.0, 0.0)


def test_sequences_differ_in_what_stands_for_what_and_what_is_left_over() -> None:
    found = list(sequence_differences("texts", "text", ["a", "b", "c"], ["a", "x", "y", "c", "d"]))
    assert [(one.recorded, one.ours) for one in found] == [("b", "x"), (ABSENT, "y"), (ABSENT, "d")]


# The table


@pytest.mark.parametrize("tolerance", TOLERANCES, ids=lambda one: f"{one.kind} {one.fields[0]}")
def test_every_tolerance_has_a_limit_and_a_reason(tolerance: Tolerance) -> None:
    assert tolerance.limits()
    assert tolerance.reason
    assert all(UNITS[field] == tolerance.unit for field in tolerance.fields if field in UNITS and "TimeUS" not in field)


def test_no_field_has_two_tolerances_in_one_comparison() -> None:
    for kind in {one.kind for one in TOLERANCES}:
        fields = [field for one in TOLERANCES if one.kind == kind for field in one.fields]
        assert len(set(fields)) == len(fields)
