# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers out of records: what counts as one, and how a record that lacks one is named."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from viso.logs.recorded import RecordError, finite, instance, numbers, whole


def record(**fields: object) -> Any:
    return SimpleNamespace(get_type=lambda: "RTST", **fields)


def test_fields_come_in_the_order_asked_for() -> None:
    assert numbers(record(A=1, B=2.5), "B", "A") == [2.5, 1.0]


def test_number_may_be_infinite_or_none_at_all() -> None:
    low, nothing = numbers(record(A=-math.inf, B=math.nan), "A", "B")
    assert low == -math.inf
    assert math.isnan(nothing)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_finite_number_is_finite(value: float) -> None:
    with pytest.raises(RecordError, match=rf"\ARTST\.B is {value}\Z"):
        finite(record(A=1.0, B=value), "A", "B")


@pytest.mark.parametrize("fields", [{"A": 1}, {"A": 1, "B": "text"}, {"A": 1, "B": b"\1\2"}, {"A": 1, "B": None}])
@pytest.mark.parametrize("read", [numbers, finite, whole])
def test_missing_number_is_named(fields: dict[str, object], read: Any) -> None:
    with pytest.raises(RecordError, match=r"\ARTST lacks a number in A or B\Z"):
        read(record(**fields), "A", "B")


def test_integers_are_integers() -> None:
    found = whole(record(A=3, B=4_294_967_295), "A", "B")
    assert found == [3, 4_294_967_295]
    assert all(type(value) is int for value in found)


def test_instance_is_the_field_i() -> None:
    assert instance(record(I=2)) == 2
