# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""C integers: reduction to a width, and conversions from and to floats."""

import ctypes
import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ap_core import cint

INT_MIN = -(1 << 31)

WIDTHS = [
    (cint.u8, ctypes.c_uint8),
    (cint.u16, ctypes.c_uint16),
    (cint.u32, ctypes.c_uint32),
    (cint.u64, ctypes.c_uint64),
    (cint.i8, ctypes.c_int8),
    (cint.i16, ctypes.c_int16),
    (cint.i32, ctypes.c_int32),
    (cint.i64, ctypes.c_int64),
]


@pytest.mark.parametrize(("reduce", "c_type"), WIDTHS)
@given(value=st.integers(-(1 << 70), 1 << 70))
def test_reduction_agrees_with_c(
    reduce: Callable[[int], int], c_type: Callable[[int], "ctypes._SimpleCData[int]"], value: int
) -> None:
    assert reduce(value) == c_type(value).value


@pytest.mark.parametrize(
    ("reduce", "value", "expected"),
    [
        (cint.u8, 256, 0),
        (cint.u8, -1, 255),
        (cint.u16, -1, 0xFFFF),
        (cint.u32, 1 << 32, 0),
        (cint.u32, -1, 0xFFFFFFFF),
        (cint.u64, -1, 0xFFFFFFFFFFFFFFFF),
        (cint.i8, 127, 127),
        (cint.i8, 128, -128),
        (cint.i16, 0x8000, -0x8000),
        (cint.i32, 0x80000000, INT_MIN),
        (cint.i64, 1 << 63, -(1 << 63)),
        (cint.i64, -(1 << 63) - 1, (1 << 63) - 1),
    ],
)
def test_reduction_at_the_edges(reduce: Callable[[int], int], value: int, expected: int) -> None:
    assert reduce(value) == expected


def test_age_across_the_wrap_of_milliseconds() -> None:
    assert cint.u32(200 - 0xFFFFFF9C) == 300


@pytest.mark.parametrize(("value", "expected"), [(1.9, 1), (-1.9, -1), (0.0, 0), (-0.5, 0), (2147483520.0, 2147483520)])
def test_float_is_truncated_toward_zero(value: float, expected: int) -> None:
    assert cint.int_of_float(value) == expected


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 2147483648.0, -2147483904.0, 1e30])
def test_what_int_cannot_hold_gives_int_min(value: float) -> None:
    assert cint.int_of_float(value) == INT_MIN


@pytest.mark.parametrize("value", [-2147483648.0, -2147483648.5])
def test_int_min_itself_is_in_range(value: float) -> None:
    assert cint.int_of_float(value) == INT_MIN


@pytest.mark.parametrize(("value", "expected"), [
    *((1.9, 1), (-1.9, -1), (9223372036854774784.0, 9223372036854774784), (-9223372036854775808.0, -(1 << 63))),
    *((value, -(1 << 63)) for value in (math.nan, math.inf, -math.inf, 9223372036854775808.0, -1e30)),
])  # fmt: skip
def test_float_of_64_bits_is_truncated_or_the_least(value: float, expected: int) -> None:
    assert cint.int64_of_float(value) == expected


def nearest_float32(value: int) -> Fraction:
    """Round an integer to 24 bits, ties to even, in exact arithmetic."""
    spacing = 1 << max(0, value.bit_length() - 24)
    return Fraction(round(Fraction(value, spacing)) * spacing)


@given(value=st.integers(0, (1 << 64) - 1))
@example(value=(1 << 63) + (1 << 39) + 1)  # a detour through binary64 would round to a tie, then down
@example(value=(1 << 63) + (1 << 39))
@example(value=(1 << 64) - 1)
@example(value=(1 << 24) + 1)
@example(value=0)
def test_unsigned_integer_is_rounded_to_float32_once(value: int) -> None:
    assert Fraction(float(cint.float_of_u64(value))) == nearest_float32(value)


def test_unsigned_integer_becomes_float32() -> None:
    assert type(cint.float_of_u64(20_000)) is np.float32


def test_unsigned_integer_is_reduced_before_conversion() -> None:
    assert cint.float_of_u64(-1) == np.float32(2.0**64)
