# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Floats as hex digits: exact both ways, one NaN, and complaints about anything else."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from viso.files.float_bits import bits_of, float_of, floats_of, json_value, quaternion_of, vector_of

ONE, TWO, THREE, FOUR = "3f800000", "40000000", "40400000", "40800000"


@pytest.mark.parametrize(
    ("value", "bits"),
    [(1.0, ONE), (-0.0, "80000000"), (math.inf, "7f800000"), (0.1, "3dcccccd"), (2.0**-149, "00000001")],
)
def test_bits_are_written_most_significant_first(value: float, bits: str) -> None:
    assert bits_of(f32(value)) == bits


@given(word=st.integers(0, (1 << 32) - 1))
def test_value_comes_back_from_its_bits(word: int) -> None:
    bits = f"{word:08x}"
    value = float_of(bits)
    assert type(value) is np.float32
    assert bits_of(value) == ("7fc00000" if math.isnan(value) else bits)


@pytest.mark.parametrize("bits", ["7fc00000", "ffc00000", "7f800001", "7fffffff"])
def test_every_nan_is_written_alike(bits: str) -> None:
    assert bits_of(float_of(bits)) == "7fc00000"


def test_bits_may_be_in_capitals() -> None:
    assert float_of("3F800000") == 1


@pytest.mark.parametrize(
    "bits", ["", "3f8", "3f8000000", "0x3f8000", "3f80 000", "3f 80 00", "spam" * 2, 1.0, 1, None, [ONE]]
)
def test_anything_else_is_no_float(bits: object) -> None:
    with pytest.raises(ValueError, match=r"hex|buffer size"):
        float_of(bits)


def test_list_of_floats() -> None:
    assert [float(value) for value in floats_of([ONE, TWO], 2)] == [1, 2]


@pytest.mark.parametrize("bits", [[], [ONE], [ONE, TWO, THREE], ONE, None, {}])
def test_list_of_another_length_is_refused(bits: object) -> None:
    with pytest.raises(ValueError, match="not a list of 2 floats"):
        floats_of(bits, 2)


def test_vector() -> None:
    assert vector_of([ONE, TWO, THREE]) == Vector3f(1, 2, 3)


def test_quaternion_has_w_first() -> None:
    assert quaternion_of([ONE, TWO, THREE, FOUR]) == Quaternion(1, 2, 3, 4)


@pytest.mark.parametrize(("value", "written"), [(f32(1), ONE), (1, 1), ("text", "text"), (1.0, 1.0)])
def test_only_float32_is_written_in_hex(value: object, written: object) -> None:
    assert json_value(value) == written
