# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Quaternion: a plain binary64 quaternion bounds the error, and the firmware's corners are kept."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ap_core.fmath import M_PI, M_PI_2, f32
from ap_core.internal_error import InternalError, InternalErrors
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f

Wide = tuple[float, float, float, float]
WideVector = tuple[float, float, float]

PI = float(f32(math.pi))
ANGLES = st.floats(-PI, PI, width=32)
PITCHES = st.floats(-1.375, 1.375, width=32)
COMPONENTS = st.floats(-100, 100, width=32)
VECTORS = st.builds(Vector3f, COMPONENTS, COMPONENTS, COMPONENTS)


@st.composite
def attitudes(draw: st.DrawFn) -> Quaternion:
    """Draw a quaternion of length 1 within float32."""
    wxyz = [draw(st.floats(-1, 1)) for _ in range(4)]
    length = math.hypot(*wxyz)
    assume(length > 0.1)
    return Quaternion(*(component / length for component in wxyz))


# The oracle: textbook formulas in binary64, with no regard to order or rounding.


def wide(q: Quaternion) -> Wide:
    return float(q.q1), float(q.q2), float(q.q3), float(q.q4)


def wide_vector(v: Vector3f) -> WideVector:
    return float(v.x), float(v.y), float(v.z)


def product(a: Wide, b: Wide) -> Wide:
    (aw, *av), (bw, *bv) = a, b
    dot = sum(x * y for x, y in zip(av, bv, strict=True))
    cross = (av[1] * bv[2] - av[2] * bv[1], av[2] * bv[0] - av[0] * bv[2], av[0] * bv[1] - av[1] * bv[0])
    x, y, z = (aw * bv[i] + bw * av[i] + cross[i] for i in range(3))
    return aw * bw - dot, x, y, z


def conjugate(q: Wide) -> Wide:
    return q[0], -q[1], -q[2], -q[3]


def rotated(q: Wide, v: WideVector) -> WideVector:
    _, x, y, z = product(product(q, (0.0, *v)), conjugate(q))
    return x, y, z


def of_euler(roll: float, pitch: float, yaw: float) -> Wide:
    about_x = math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0
    about_y = math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0
    about_z = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
    return product(product(about_z, about_y), about_x)


def distance(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


def angle_between(a: float, b: float) -> float:
    return abs(math.remainder(a - b, 2 * math.pi))


@given(a=attitudes(), b=attitudes())
def test_product_is_close_to_the_oracle(a: Quaternion, b: Quaternion) -> None:
    assert distance(wide(a * b), product(wide(a), wide(b))) < 3e-7


@given(q=attitudes(), v=VECTORS)
def test_rotated_vector_is_close_to_the_oracle(q: Quaternion, v: Vector3f) -> None:
    bound = 1e-6 * (1 + float(v.length()))
    assert distance(wide_vector(q.rotate_vector(v)), rotated(wide(q), wide_vector(v))) < bound


@given(q=attitudes(), v=VECTORS)
def test_rotation_matrix_rotates_as_the_oracle(q: Quaternion, v: Vector3f) -> None:
    bound = 1e-6 * (1 + float(v.length()))
    assert distance(wide_vector(q.rotation_matrix() * v), rotated(wide(q), wide_vector(v))) < bound


@given(roll=ANGLES, pitch=ANGLES, yaw=ANGLES)
def test_quaternion_of_euler_angles_is_close_to_the_oracle(roll: float, pitch: float, yaw: float) -> None:
    q = Quaternion.from_euler(f32(roll), f32(pitch), f32(yaw))
    assert distance(wide(q), of_euler(roll, pitch, yaw)) < 3e-7


@given(roll=ANGLES, pitch=PITCHES, yaw=ANGLES)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    back = Quaternion.from_euler(f32(roll), f32(pitch), f32(yaw)).to_euler()
    assert max(angle_between(float(a), b) for a, b in zip(back, (roll, pitch, yaw), strict=True)) < 1e-5


@given(a=attitudes(), b=attitudes())
def test_angular_difference_takes_the_second_attitude_to_the_first(a: Quaternion, b: Quaternion) -> None:
    assert distance(wide(b * a.angular_difference(b)), wide(a)) < 1e-6


@given(q=attitudes())
def test_rotation_vector_is_close_to_the_oracle(q: Quaternion) -> None:
    w, *v = wide(q)
    length = math.hypot(*v)
    assume(abs(w) > 1e-3)  # half a turn has two rotation vectors
    assume(length > 1e-3)
    angle = math.remainder(2 * math.atan2(length, w), 2 * math.pi)
    expected = tuple(component / length * angle for component in v)
    assert distance(wide_vector(q.to_axis_angle()), expected) < 2e-6


@given(a=attitudes(), b=attitudes())
def test_tilt_difference_is_close_to_the_oracle(a: Quaternion, b: Quaternion) -> None:
    down_a, down_b = (rotated(conjugate(wide(q)), (0.0, 0.0, 1.0)) for q in (a, b))
    half = math.dist(down_a, down_b) / 2
    assume(half < 0.998)  # the arc sine is steep at its end
    difference = float(a.roll_pitch_difference(b, InternalErrors()))
    assert difference == pytest.approx(2 * math.asin(half), rel=0, abs=3e-5)


@given(yaw=ANGLES, other_yaw=ANGLES, roll=ANGLES, pitch=PITCHES)
def test_tilt_difference_is_blind_to_yaw(yaw: float, other_yaw: float, roll: float, pitch: float) -> None:
    a = Quaternion.from_euler(f32(roll), f32(pitch), f32(yaw))
    b = Quaternion.from_euler(f32(roll), f32(pitch), f32(other_yaw))
    assert a.roll_pitch_difference(b, InternalErrors()) < 2e-6


# Corners of the firmware.


def test_quaternion_is_the_identity_by_default() -> None:
    assert wide(Quaternion()) == (1, 0, 0, 0)


def test_quaternion_is_not_normalised_on_the_way_in() -> None:
    assert wide(Quaternion(2, 0, 0, 2)) == (2, 0, 0, 2)


def test_product_is_not_normalised() -> None:
    assert wide(Quaternion(2, 0, 0, 0) * Quaternion(0, 3, 0, 0)) == (0, 6, 0, 0)


def test_product_follows_hamilton() -> None:
    i, j, k = Quaternion(0, 1, 0, 0), Quaternion(0, 0, 1, 0), Quaternion(0, 0, 0, 1)
    assert (i * j, j * k, k * i) == (k, i, j)


def test_inverse_does_not_divide_by_the_norm() -> None:
    assert wide(Quaternion(2, 1, -3, 4).inverse()) == (2, -1, 3, -4)


def test_zero_quaternion_leaves_a_vector() -> None:
    assert Quaternion(0, 0, 0, 0).rotate_vector(Vector3f(1, 2, 3)) == Vector3f(1, 2, 3)


def test_long_quaternion_stretches_a_vector() -> None:
    # v + 2 (w uv + q x uv) with w = z = 2: the part beside the axis grows.
    assert Quaternion(2, 0, 0, 2).rotate_vector(Vector3f(1, 0, 5)) == Vector3f(-7, 8, 5)


@pytest.mark.parametrize(("q", "pitch"), [(Quaternion(1, 0, 1, 0), M_PI_2), (Quaternion(1, 0, -1, 0), -M_PI_2)])
def test_pitch_of_a_long_quaternion_is_limited(q: Quaternion, pitch: np.float32) -> None:
    assert q.get_euler_pitch() == pitch


def test_pitch_of_nan_is_zero() -> None:
    assert Quaternion(math.nan, 0, 0, 0).get_euler_pitch() == 0


def test_roll_and_yaw_of_nan_are_nan() -> None:
    roll, _, yaw = Quaternion(math.nan, 0, 0, 0).to_euler()
    assert math.isnan(roll)
    assert math.isnan(yaw)


def test_yaw_of_half_a_turn_is_pi() -> None:
    assert Quaternion(0, 0, 0, 1).get_euler_yaw() == M_PI


def test_rotation_vector_of_a_tiny_rotation_is_not_doubled() -> None:
    assert Quaternion(1, 0, 0, 1e-7).to_axis_angle() == Vector3f(0, 0, 1e-7)


def test_rotation_vector_just_above_the_limit_is_the_angle() -> None:
    tiny = np.float32(2.0**-23)
    assert Quaternion(1, 0, 0, tiny).to_axis_angle().z == pytest.approx(2.0**-22)


@pytest.mark.parametrize("z", [0.6, -0.6])
def test_rotation_vector_beyond_half_a_turn_goes_the_short_way(z: float) -> None:
    vector = Quaternion(-0.8, 0, 0, z).to_axis_angle()
    assert float(vector.z) == pytest.approx(-math.copysign(2 * math.asin(0.6), z), abs=1e-6)


def test_tilt_difference_of_opposite_attitudes_is_half_a_turn() -> None:
    upside_down = Quaternion(0, 1, 0, 0)
    assert float(Quaternion().roll_pitch_difference(upside_down, InternalErrors())) == pytest.approx(math.pi)


def test_tilt_difference_of_a_long_quaternion_is_limited_to_half_a_turn() -> None:
    errors = InternalErrors()
    assert float(Quaternion().roll_pitch_difference(Quaternion(0, 5, 0, 0), errors)) == pytest.approx(math.pi)
    assert errors.count == 0


def test_tilt_difference_with_nan_is_a_third_of_half_a_turn_and_an_internal_error() -> None:
    errors = InternalErrors()
    difference = Quaternion().roll_pitch_difference(Quaternion(math.nan, 0, 0, 0), errors)
    # NaN becomes the midpoint 0.5 of the limits, whose doubled arc sine is pi/3.
    assert float(difference) == pytest.approx(math.pi / 3)
    assert errors.last is InternalError.CONSTRAINING_NAN


Q = Quaternion(0.5, 0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    "values",
    [
        Q.to_wxyz(),
        (Q * Q).to_wxyz(),
        Q.inverse().to_wxyz(),
        Q.angular_difference(Q).to_wxyz(),
        Quaternion.from_euler(f32(0.1), f32(0.2), f32(0.3)).to_wxyz(),
        Q.to_euler(),
        Q.to_axis_angle().to_tuple(),
        Quaternion().to_axis_angle().to_tuple(),
        Q.rotate_vector(Vector3f(1, 2, 3)).to_tuple(),
        Q.rotation_matrix().b.to_tuple(),
        (Q.roll_pitch_difference(Quaternion(), InternalErrors()),),
    ],
)
def test_operations_keep_float32(values: tuple[object, ...]) -> None:
    assert {type(value) for value in values} == {np.float32}


def test_equality_is_exact() -> None:
    assert Quaternion(1, 2, 3, 4) == Quaternion(1, 2, 3, 4)
    assert Quaternion(1, 2, 3, 4) != Quaternion(1, 2, 3, np.nextafter(f32(4), f32(5)))


def test_quaternion_differs_from_its_opposite() -> None:
    assert Quaternion(1, 0, 0, 0) != Quaternion(-1, 0, 0, 0)


def test_equal_quaternions_have_equal_hashes() -> None:
    assert hash(Quaternion(1, 0.0, 0, 0)) == hash(Quaternion(1, -0.0, 0, 0))


def test_quaternion_differs_from_its_tuple() -> None:
    assert Quaternion() != (1, 0, 0, 0)


def test_representation_shows_w_first() -> None:
    assert repr(Quaternion(1, 2, 3, 4)) == "Quaternion(1.0, 2.0, 3.0, 4.0)"


@pytest.mark.parametrize("index", range(4))
def test_quaternion_is_nan_when_a_component_is(index: int) -> None:
    parts = [1.0, math.inf, 0.0, 0.0]
    assert not Quaternion(*parts).is_nan()
    parts[index] = math.nan
    assert Quaternion(*parts).is_nan()


def test_yaw_is_the_same_when_it_is_asked_for_again() -> None:
    quat = Quaternion(0.9, 0.1, -0.2, 0.374)
    first = quat.get_euler_yaw()
    assert quat.get_euler_yaw().tobytes() == first.tobytes() == quat.to_euler()[2].tobytes()
    assert quat == Quaternion(0.9, 0.1, -0.2, 0.374)
