# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vector3f: float32 throughout, exact comparison, the firmware's length."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.vector3 import Vector3f

COMPONENTS = st.floats(-1e6, 1e6, width=32)
VECTORS = st.builds(Vector3f, COMPONENTS, COMPONENTS, COMPONENTS)
THIRD = f32(1 / 3)


def wide(v: Vector3f) -> tuple[float, float, float]:
    return float(v.x), float(v.y), float(v.z)


def test_vector_is_zero_by_default() -> None:
    assert wide(Vector3f()) == (0, 0, 0)


def test_components_are_rounded_to_float32_once() -> None:
    assert wide(Vector3f(0.1, 1 / 3, 16777217.0)) == (float(f32(0.1)), float(f32(1 / 3)), 16777216.0)


@pytest.mark.parametrize(
    "vector",
    [
        Vector3f(1, 2, 3),
        Vector3f(1, 2, 3) + Vector3f(0.1, 0.2, 0.3),
        Vector3f(1, 2, 3) - Vector3f(0.1, 0.2, 0.3),
        Vector3f(1, 2, 3) * THIRD,
        Vector3f(1, 2, 3) / THIRD,
    ],
)
def test_operations_keep_float32(vector: Vector3f) -> None:
    assert {type(component) for component in vector.to_tuple()} == {np.float32}


def test_length_is_float32() -> None:
    assert type(Vector3f(1, 2, 3).length()) is np.float32


@given(a=VECTORS, b=VECTORS)
def test_sum_and_difference_are_rounded_exact_ones(a: Vector3f, b: Vector3f) -> None:
    # A sum of two float32 is exact in binary64, or rounds to the same float32.
    assert wide(a + b) == tuple(float(f32(x + y)) for x, y in zip(wide(a), wide(b), strict=True))
    assert wide(a - b) == tuple(float(f32(x - y)) for x, y in zip(wide(a), wide(b), strict=True))


@given(a=VECTORS, factor=COMPONENTS)
def test_product_with_a_scalar_is_the_rounded_exact_one(a: Vector3f, factor: float) -> None:
    assert wide(a * f32(factor)) == tuple(float(f32(x * factor)) for x in wide(a))


def test_operations_leave_their_operands() -> None:
    a, b = Vector3f(1, 2, 3), Vector3f(4, 5, 6)
    assert a + b == Vector3f(5, 7, 9)
    assert (a, b) == (Vector3f(1, 2, 3), Vector3f(4, 5, 6))


def test_division_by_zero_gives_infinities() -> None:
    with np.errstate(all="ignore"):
        v = Vector3f(1, -1, 0) / f32(0)
    assert wide(v)[:2] == (math.inf, -math.inf)
    assert math.isnan(v.z)


@given(v=VECTORS)
def test_length_is_within_two_ulp_of_the_exact_one(v: Vector3f) -> None:
    assert float(v.length()) == pytest.approx(math.hypot(*wide(v)), rel=2.0**-22, abs=1e-22)


def test_length_of_three_four_twelve() -> None:
    assert Vector3f(3, 4, 12).length() == 13


@pytest.mark.parametrize("axis", range(3))
def test_nan_in_any_component_is_seen(axis: int) -> None:
    components = [0.0, 0.0, 0.0]
    components[axis] = math.nan
    assert Vector3f(*components).is_nan()


def test_infinity_is_not_nan() -> None:
    assert not Vector3f(math.inf, -math.inf, 0).is_nan()


def test_equality_is_exact() -> None:
    assert Vector3f(1, 2, 3) == Vector3f(1, 2, 3)
    assert Vector3f(1, 2, 3) != Vector3f(1, 2, np.nextafter(f32(3), f32(4)))


def test_equal_vectors_have_equal_hashes() -> None:
    assert hash(Vector3f(0.0, 1, 2)) == hash(Vector3f(-0.0, 1, 2))


def test_vector_differs_from_its_tuple() -> None:
    assert Vector3f(1, 2, 3) != (1, 2, 3)


def test_representation_shows_the_components() -> None:
    assert repr(Vector3f(1, 2.5, -3)) == "Vector3f(1.0, 2.5, -3.0)"
