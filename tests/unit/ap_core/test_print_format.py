# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers in texts, as the firmware prints them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.print_format import fixed

RECORDED = [
    (0.9891284704208374, "0.9"),
    (-2.004218816757202, "-2.0"),
    (0.2283860296010971, "0.2"),
    (-0.9838047623634338, "-0.9"),
    (0.05344307795166969, "0.1"),
    (-0.04957517810073128, "-0.1"),
    (-0.003797857556492090, "-0.0"),
    (0.044076231984176505, "0.0"),
]
"""Starts of aiding in logs of 4.6.3 and of July 2025: what their replay records say, and their texts."""


@pytest.mark.parametrize(("value", "text"), RECORDED)
def test_text_of_a_flight(value: float, text: str) -> None:
    assert fixed(value, 1, 3) == text


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (0.0, 1, "0.0"),
        (-0.0, 1, "-0.0"),
        (584.0, 0, "584"),
        (99.96, 1, "100.0"),
        (9.96, 1, "10.0"),
        (0.6, 0, "1"),
        (0.4, 0, "0"),
        (-35.3632621, 7, "-35.36326"),
        (149.1652374, 7, "149.1652"),
        (1e8, 1, "1.0e+08"),
        (math.nan, 1, "nan"),
        (-math.inf, 1, "-inf"),
    ],
)
def test_number(value: float, decimals: int, text: str) -> None:
    assert fixed(value, decimals) == text


def test_width() -> None:
    assert fixed(1.25, 1, 6) == "   1.3"


@given(st.floats(1.0, 9e6, width=32), st.integers(0, 3))
def test_number_above_one_is_rounded(value: float, decimals: int) -> None:
    """Up to seven digits."""
    shown = fixed(value, decimals)
    whole = len(str(int(value)))
    nearest = 0.5 * 10.0 ** -min(decimals, 7 - whole)
    assert abs(float(shown) - value) <= nearest * 1.001 + 1e-6 * value


@given(st.floats(allow_subnormal=True, width=32), st.integers(0, 7))
def test_anything_can_be_printed(value: float, decimals: int) -> None:
    assert fixed(value, decimals).strip("-0123456789.e+") in ("", "nan", "inf")
