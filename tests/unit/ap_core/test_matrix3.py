# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrix3f: products, and the rotation matrix of Euler angles."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import cosf, f32, sinf
from ap_core.matrix3 import Matrix3f
from ap_core.vector3 import Vector3f

PI = float(f32(math.pi))
ANGLES = st.floats(-PI, PI, width=32)
COMPONENTS = st.floats(-100, 100, width=32)
VECTORS = st.builds(Vector3f, COMPONENTS, COMPONENTS, COMPONENTS)
COUNTING = Matrix3f(Vector3f(1, 2, 3), Vector3f(4, 5, 6), Vector3f(7, 8, 9))


def turned(v: Vector3f, roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
    """Turn about x, then y, then z in binary64."""
    x, y, z = float(v.x), float(v.y), float(v.z)
    y, z = y * math.cos(roll) - z * math.sin(roll), y * math.sin(roll) + z * math.cos(roll)
    x, z = x * math.cos(pitch) + z * math.sin(pitch), -x * math.sin(pitch) + z * math.cos(pitch)
    return x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) + y * math.cos(yaw), z


def test_matrix_is_zero_by_default() -> None:
    assert Matrix3f() * Vector3f(1, 2, 3) == Vector3f(0, 0, 0)


def test_product_takes_rows() -> None:
    assert COUNTING * Vector3f(1, 10, 100) == Vector3f(321, 654, 987)


def test_transposed_product_takes_columns() -> None:
    assert COUNTING.mul_transpose(Vector3f(1, 10, 100)) == Vector3f(741, 852, 963)


@pytest.mark.parametrize("product", [Matrix3f.__mul__, Matrix3f.mul_transpose])
def test_products_sum_from_left_to_right(product: Callable[[Matrix3f, Vector3f], Vector3f]) -> None:
    # 1e8 + 1 is 1e8 in float32, so adding up from the other end would give 1.
    ones = Vector3f(1, 1, 1)
    assert product(Matrix3f(ones, ones, ones), Vector3f(1, 1e8, -1e8)) == Vector3f(0, 0, 0)


@pytest.mark.parametrize(
    "vector",
    [
        COUNTING * Vector3f(0.1, 0.2, 0.3),
        COUNTING.mul_transpose(Vector3f(0.1, 0.2, 0.3)),
        Matrix3f.from_euler(f32(0.1), f32(0.2), f32(0.3)).a,
    ],
)
def test_operations_keep_float32(vector: Vector3f) -> None:
    assert {type(component) for component in vector.to_tuple()} == {np.float32}


@given(v=VECTORS, roll=ANGLES, pitch=ANGLES, yaw=ANGLES)
def test_rotation_turns_about_x_then_y_then_z(v: Vector3f, roll: float, pitch: float, yaw: float) -> None:
    result = Matrix3f.from_euler(f32(roll), f32(pitch), f32(yaw)) * v
    bound = 1e-6 * (1 + float(v.length()))
    assert [float(c) for c in result.to_tuple()] == pytest.approx(turned(v, roll, pitch, yaw), rel=0, abs=bound)


@given(v=VECTORS, roll=ANGLES, pitch=ANGLES, yaw=ANGLES)
def test_transpose_undoes_a_rotation(v: Vector3f, roll: float, pitch: float, yaw: float) -> None:
    matrix = Matrix3f.from_euler(f32(roll), f32(pitch), f32(yaw))
    bound = 2e-6 * (1 + float(v.length()))
    assert float((matrix.mul_transpose(matrix * v) - v).length()) <= bound


@given(yaw=ANGLES)
def test_yaw_alone_gives_its_cosine_and_sine(yaw: float) -> None:
    matrix = Matrix3f.from_euler(f32(0), f32(0), f32(yaw))
    c, s = cosf(f32(yaw)), sinf(f32(yaw))
    assert (matrix.a, matrix.b, matrix.c) == (Vector3f(c, -s, 0), Vector3f(s, c, 0), Vector3f(0, 0, 1))


def test_representation_shows_the_rows() -> None:
    assert repr(Matrix3f(Vector3f(1))) == (
        "Matrix3f(Vector3f(1.0, 0.0, 0.0), Vector3f(0.0, 0.0, 0.0), Vector3f(0.0, 0.0, 0.0))"
    )
