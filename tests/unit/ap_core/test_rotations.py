# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed orientations: the two tables agree, and unknown numbers do nothing but complain."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.internal_error import InternalError, InternalErrors
from ap_core.quaternion import Quaternion
from ap_core.rotations import Rotation, quaternion_from_rotation, rotate_vector
from ap_core.vector3 import Vector3f

FIXED = range(44)
CUSTOM = (Rotation.CUSTOM_1, Rotation.CUSTOM_2)
UNKNOWN = (44, 99, 100, 103, 255, -1)

COMPONENTS = st.floats(-100, 100, width=32)
VECTORS = st.builds(Vector3f, COMPONENTS, COMPONENTS, COMPONENTS)
ROTATIONS = st.sampled_from(FIXED)


def turned(v: Vector3f, rotation: int) -> Vector3f:
    errors = InternalErrors()
    result = rotate_vector(v, rotation, errors)
    assert errors.count == 0
    return result


def quaternion_of(rotation: int) -> Quaternion:
    errors = InternalErrors()
    result = quaternion_from_rotation(rotation, errors)
    assert errors.count == 0
    return result


def angles_in_name(rotation: Rotation) -> tuple[np.float32, np.float32, np.float32]:
    """Read the Euler angles in radians from a name such as ROLL_90_YAW_45."""
    degrees = dict(re.findall(r"(ROLL|PITCH|YAW)_(\d+)", rotation.name))
    roll, pitch, yaw = (f32(math.radians(float(degrees.get(axis, 0)))) for axis in ("ROLL", "PITCH", "YAW"))
    return roll, pitch, yaw


def test_every_fixed_orientation_has_a_name() -> None:
    assert {rotation.value for rotation in Rotation} == {*FIXED, 101, 102}


@pytest.mark.parametrize("axis", [Vector3f(1, 0, 0), Vector3f(0, 1, 0), Vector3f(0, 0, 1), Vector3f(0.6, -0.5, 0.3)])
def test_vector_rotation_agrees_with_the_quaternion(axis: Vector3f) -> None:
    for rotation in (*FIXED, *CUSTOM):
        difference = turned(axis, rotation) - quaternion_of(rotation).rotate_vector(axis)
        assert float(difference.length()) < 1e-6, rotation


def test_rotation_is_the_one_in_its_name() -> None:
    v = Vector3f(0.6, -0.5, 0.3)
    for rotation in map(Rotation, FIXED):
        expected = Quaternion.from_euler(*angles_in_name(rotation)).rotate_vector(v)
        # 68 and 293 degrees are rounded in the name.
        bound = 0.02 if rotation is Rotation.ROLL_90_PITCH_68_YAW_293 else 1e-6
        assert float((turned(v, rotation) - expected).length()) < bound, rotation


@given(v=VECTORS, rotation=ROTATIONS)
def test_rotation_keeps_the_length(v: Vector3f, rotation: int) -> None:
    # Squares of tiny lengths underflow, hence the absolute part.
    assert float(turned(v, rotation).length()) == pytest.approx(float(v.length()), rel=1e-6, abs=1e-21)


@given(v=VECTORS, rotation=ROTATIONS)
def test_rotation_keeps_float32(v: Vector3f, rotation: int) -> None:
    assert {type(component) for component in turned(v, rotation).to_tuple()} == {np.float32}


def test_quaternions_have_length_one() -> None:
    lengths = [math.hypot(*map(float, quaternion_of(rotation).to_wxyz())) for rotation in FIXED]
    assert lengths == pytest.approx([1] * len(lengths), abs=1e-7)


@pytest.mark.parametrize(
    ("rotation", "expected"),
    [
        (Rotation.NONE, (1, 2, 3)),
        (Rotation.YAW_90, (-2, 1, 3)),
        (Rotation.YAW_180, (-1, -2, 3)),
        (Rotation.YAW_270, (2, -1, 3)),
        (Rotation.ROLL_180, (1, -2, -3)),
        (Rotation.PITCH_90, (3, 2, -1)),
        (Rotation.PITCH_270, (-3, 2, 1)),
    ],
)
def test_quarter_turns_are_exact(rotation: Rotation, expected: tuple[float, float, float]) -> None:
    assert turned(Vector3f(1, 2, 3), rotation) == Vector3f(*expected)


@pytest.mark.parametrize("rotation", CUSTOM)
def test_custom_orientation_without_angles_leaves_a_vector(rotation: int) -> None:
    assert turned(Vector3f(1, 2, 3), rotation) == Vector3f(1, 2, 3)


# The firmware writes these four out with a subtraction of their own, whose zero is positive when x equals y; a roll
# followed by a yaw would give some of them the other sign. Expected signs are read off those formulas.
@pytest.mark.parametrize(
    ("rotation", "x", "y", "expected"),
    [
        (9, 1.0, 1.0, ("0x1.6a09e6p+0", "0x0.0p+0")),
        (9, 1.0, -1.0, ("0x0.0p+0", "0x1.6a09e6p+0")),
        (9, 0.0, 0.0, ("0x0.0p+0", "0x0.0p+0")),
        (9, -0.0, -0.0, ("-0x0.0p+0", "0x0.0p+0")),
        (11, 1.0, 1.0, ("0x0.0p+0", "0x1.6a09e6p+0")),
        (11, 1.0, -1.0, ("-0x1.6a09e6p+0", "0x0.0p+0")),
        (11, 0.0, 0.0, ("0x0.0p+0", "0x0.0p+0")),
        (11, -0.0, -0.0, ("0x0.0p+0", "-0x0.0p+0")),
        (13, 1.0, 1.0, ("-0x1.6a09e6p+0", "0x0.0p+0")),
        (13, 1.0, -1.0, ("-0x0.0p+0", "-0x1.6a09e6p+0")),
        (13, 0.0, 0.0, ("-0x0.0p+0", "0x0.0p+0")),
        (13, -0.0, -0.0, ("0x0.0p+0", "0x0.0p+0")),
        (15, 1.0, 1.0, ("0x0.0p+0", "-0x1.6a09e6p+0")),
        (15, 1.0, -1.0, ("0x1.6a09e6p+0", "-0x0.0p+0")),
        (15, 0.0, 0.0, ("0x0.0p+0", "-0x0.0p+0")),
        (15, -0.0, -0.0, ("0x0.0p+0", "0x0.0p+0")),
    ],
)
def test_signs_of_zero_are_the_firmwares(rotation: int, x: float, y: float, expected: tuple[str, str]) -> None:
    result = turned(Vector3f(x, y, 0), rotation)
    want_x, want_y = (float.fromhex(text) for text in expected)
    assert (float(result.x), float(result.y)) == pytest.approx((want_x, want_y), rel=1e-7)
    assert (math.copysign(1, result.x), math.copysign(1, result.y)) == (
        math.copysign(1, want_x),
        math.copysign(1, want_y),
    )


@pytest.mark.parametrize("rotation", [9, 11, 13, 15])
def test_zero_down_component_is_negated(rotation: int) -> None:
    assert math.copysign(1, turned(Vector3f(1, 2, 0), rotation).z) == -1


@pytest.mark.parametrize("rotation", UNKNOWN)
def test_unknown_orientation_leaves_the_vector(rotation: int) -> None:
    assert rotate_vector(Vector3f(1, 2, 3), rotation, InternalErrors()) == Vector3f(1, 2, 3)


@pytest.mark.parametrize("rotation", UNKNOWN)
def test_unknown_orientation_has_the_identity_for_quaternion(rotation: int) -> None:
    assert quaternion_from_rotation(rotation, InternalErrors()) == Quaternion()


@pytest.mark.parametrize("rotation", UNKNOWN)
def test_unknown_orientation_is_an_internal_error(rotation: int) -> None:
    errors = InternalErrors()
    rotate_vector(Vector3f(1, 2, 3), rotation, errors)
    quaternion_from_rotation(rotation, errors)
    assert (errors.count, errors.last) == (2, InternalError.BAD_ROTATION)
