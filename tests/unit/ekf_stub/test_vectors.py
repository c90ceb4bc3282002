# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors, quaternions and times as tuples and numbers: they are those of numpy and numpy-quaternion."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.core import vectors as v

PARTS = st.floats(-10, 10)
VECTORS = st.tuples(PARTS, PARTS, PARTS)
QUATS = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(x * x for x in q) > 1e-6).map(v.normalized)
TILTS = st.floats(-1.4, 1.4)
YAWS = st.floats(-math.pi, math.pi, exclude_min=True)  # which is the same yaw as pi
TIMES = st.integers(0, 2**32 - 1)


def numpys(q: v.Quat) -> quaternion.quaternion:
    return quaternion.quaternion(*q)


@given(VECTORS, VECTORS, PARTS)
def test_vectors_are_numpys(a: v.Vec3, b: v.Vec3, by: float) -> None:
    first, second = np.array(a), np.array(b)
    assert v.add(a, b) == tuple(first + second)
    assert v.sub(a, b) == tuple(first - second)
    assert v.scaled(a, by) == tuple(first * by)
    assert v.dot(a, b) == pytest.approx(float(first @ second), abs=1e-12)
    assert v.cross(a, b) == pytest.approx(np.cross(first, second), abs=1e-12)
    assert v.length(a) == pytest.approx(float(np.linalg.norm(first)))
    assert v.length2(a[0], a[1]) == pytest.approx(math.hypot(a[0], a[1]))
    assert v.is_zero(a) is not bool(first.any())


@given(QUATS, QUATS, VECTORS)
def test_quaternions_are_numpy_quaternions(p: v.Quat, q: v.Quat, a: v.Vec3) -> None:
    assert v.times(p, q) == pytest.approx(quaternion.as_float_array(numpys(p) * numpys(q)), abs=1e-12)
    assert v.conjugate(p) == tuple(quaternion.as_float_array(numpys(p).conjugate()))
    rotation = quaternion.as_rotation_matrix(numpys(p))
    assert v.rotated(p, a) == pytest.approx(rotation @ np.array(a), abs=1e-9)
    assert np.allclose(v.matrix(p), rotation, atol=1e-12)
    assert v.to_earth(v.matrix(p), a) == pytest.approx(rotation @ np.array(a), abs=1e-9)
    assert v.to_body(v.matrix(p), a) == pytest.approx(rotation.T @ np.array(a), abs=1e-9)


@given(QUATS, st.tuples(*[st.floats(-3, 3)] * 3))
def test_turns_are_those_of_rotation_vectors(q: v.Quat, by: v.Vec3) -> None:
    after = numpys(q) * quaternion.from_rotation_vector(np.array(by))
    assert v.turned(q, by) == pytest.approx(quaternion.as_float_array(after), abs=1e-9)
    shortest = v.rotation_vector(v.turned(v.ONE, by))
    assert v.length(shortest) <= math.pi + 1e-9
    back = v.times(v.turned(v.ONE, shortest), v.conjugate(v.turned(v.ONE, by)))
    assert abs(back[0]) == pytest.approx(1.0)


def test_turns_below_the_epsilon_of_a_float_are_none_and_vectors_below_twice_that_half() -> None:
    epsilon = 2.0**-23
    assert v.turned(v.ONE, (0.99 * epsilon, 0.0, 0.0)) == v.ONE
    assert v.turned(v.ONE, (1.01 * epsilon, 0.0, 0.0))[1] == pytest.approx(0.505 * epsilon)
    for turn, found in ((1.9, 0.95), (2.1, 2.1)):
        assert v.rotation_vector((1.0, 0.0, 0.5 * turn * epsilon, 0.0))[1] == pytest.approx(found * epsilon)


@pytest.mark.parametrize("by", [(0.0, 0.0, 0.0), (1e-15, 0.0, 0.0), (0.0, 5e-324, 0.0)])
def test_next_to_no_turn_is_none(by: v.Vec3) -> None:
    assert v.turned((2.0, 0.0, 0.0, 0.0), by) == v.ONE
    assert v.rotation_vector(v.ONE) == v.ZERO == v.rotation_vector((-1.0, 0.0, 0.0, 0.0))


@given(TILTS, TILTS, YAWS)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    q = v.quat_of_euler(roll, pitch, yaw)
    assert v.euler_of(q) == pytest.approx((roll, pitch, yaw), abs=1e-9)
    about = [quaternion.from_rotation_vector(angle * np.eye(3)[axis]) for axis, angle in enumerate((roll, pitch, yaw))]
    assert q == pytest.approx(quaternion.as_float_array(about[2] * about[1] * about[0]), abs=1e-12)


@given(TILTS, TILTS, YAWS)
def test_yaw_is_the_first_angle_of_either_sequence(roll: float, pitch: float, yaw: float) -> None:
    by_321 = v.quat_of_euler(roll, pitch, yaw)
    by_312 = v.times(v.times(v.quat_of_euler(0, 0, yaw), v.quat_of_euler(roll, 0, 0)), v.quat_of_euler(0, pitch, 0))
    assert math.remainder(v.yaw_of(by_321, True) - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert math.remainder(v.yaw_of(by_312, False) - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.3, -2.0, 3.1])
def test_angle_between_attitudes_is_the_shorter_way_round(turn: float) -> None:
    first, second = v.quat_of_euler(0.1, -0.2, 0.3), v.quat_of_euler(0.1, -0.2, 0.3 + turn)
    w, x, y, z = second
    # The cosine of a small angle has lost half of its digits.
    assert v.angle_between(first, second) == pytest.approx(abs(turn), abs=1e-7)
    assert v.angle_between(first, (-w, -x, -y, -z)) == pytest.approx(abs(turn), abs=1e-7)


@given(st.floats(-100, 100))
def test_angle_is_wrapped(angle: float) -> None:
    wrapped = v.wrap_pi(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.remainder(wrapped - angle, 2 * math.pi) == pytest.approx(0, abs=1e-9)


def test_limits_of_what_is_not_a_number() -> None:
    nan = math.nan
    assert v.limited(nan, 1.0, 2.0) == 1.0
    assert [v.limited(value, 1.0, 2.0) for value in (0.0, 1.5, 9.0, math.inf, -math.inf)] == [1.0, 1.5, 2.0, 2.0, 1.0]
    assert v.larger(1.0, nan) == v.smaller(1.0, nan) == 1.0
    assert (v.larger(1.0, 2.0), v.smaller(1.0, 2.0)) == (2.0, 1.0)
    assert v.within((5.0, -5.0, nan), 1.0) == (1.0, -1.0, -1.0)
    assert [v.is_finite((0.0, value, 0.0)) for value in (1.0, nan, math.inf)] == [True, False, False]


# Times that wrap


@given(TIMES, st.integers(-(2**31) + 1, 2**31 - 1))
def test_time_between_stamps_goes_across_the_wrap(stamp: int, ahead: int) -> None:
    other = (stamp + ahead) % 2**32
    assert v.signed_since_ms(other, stamp) == ahead
    assert v.since_ms(other, stamp) == ahead % 2**32
    assert v.later_ms(stamp, other) == v.later_ms(other, stamp) == (other if ahead > 0 else stamp)
