# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data: what is sound, and how it adds up to steps."""

import math
from itertools import pairwise

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.filter.inertial import (
    GRAVITY_MSS,
    Array,
    DownSampler,
    InertialDelta,
    InertialGuard,
    InertialStep,
    is_sound,
    limited,
    pure_quat,
    quat_of_rotation,
    rotation_of_quat,
)

DT = 0.0025
GOOD = InertialDelta(np.array([0.01, 0.02, -0.03]), np.array([0.001, 0.002, 0.003]), DT, DT)
COMPONENTS = st.floats(-3, 3)
VECTORS = st.tuples(COMPONENTS, COMPONENTS, COMPONENTS).map(np.array)


def with_one(field: str, value: float) -> InertialDelta:
    values = {"del_vel": GOOD.del_vel, "del_ang": GOOD.del_ang, "del_vel_dt": DT, "del_ang_dt": DT}
    values[field] = value if field.endswith("dt") else np.array([0.0, 0.0, value])
    return InertialDelta(**values)  # type: ignore[arg-type]  # by name, each of its type


def steps_of(deltas: list[InertialDelta]) -> list[InertialStep]:
    sampler = DownSampler()
    steps = (sampler.add(delta, time_ms) for time_ms, delta in enumerate(deltas))
    return [step for step in steps if step is not None]


def test_limit_of_what_is_not_a_number_is_the_low_one() -> None:
    assert limited(math.nan, 1.0, 2.0) == 1.0


@given(VECTORS)
def test_rotations_are_those_of_numpy_quaternion(vector: Array) -> None:
    quat = quat_of_rotation(vector)
    assert np.allclose(
        quaternion.as_float_array(quat), quaternion.as_float_array(quaternion.from_rotation_vector(vector))
    )
    shortest = rotation_of_quat(-quat)
    assert np.linalg.norm(shortest) <= math.pi + 1e-9
    assert abs((quat_of_rotation(shortest) * quat.conjugate()).w) == pytest.approx(1.0)


@given(VECTORS, VECTORS)
def test_turning_a_pure_quaternion_turns_the_vector(rotation: Array, vector: Array) -> None:
    quat = quat_of_rotation(rotation)
    turned = quat * pure_quat(vector) * quat.conjugate()
    assert np.allclose(turned.vec, quaternion.as_rotation_matrix(quat) @ vector, atol=1e-12)


@pytest.mark.parametrize("field", ["del_vel", "del_ang", "del_vel_dt", "del_ang_dt"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e3])
def test_data_that_no_vehicle_survives_is_unsound(field: str, bad: float) -> None:
    assert not is_sound(with_one(field, bad))


@pytest.mark.parametrize("field", ["del_vel_dt", "del_ang_dt"])
def test_time_does_not_run_backwards(field: str) -> None:
    assert not is_sound(with_one(field, -DT))
    assert is_sound(with_one(field, 0.0))


def test_guard_lets_sound_data_through_and_repeats_it_for_unsound() -> None:
    guard = InertialGuard()
    assert guard.sound(GOOD) is GOOD
    assert guard.sound(with_one("del_vel", math.nan)) is GOOD
    assert guard.sound(with_one("del_ang", math.inf)) is GOOD
    assert guard.refused == 2


def test_guard_that_never_had_sound_data_holds_the_vehicle_at_rest() -> None:
    rest = InertialGuard().sound(with_one("del_vel", math.nan))
    assert np.allclose(rest.del_vel / rest.del_vel_dt, (0.0, 0.0, -GRAVITY_MSS))
    assert not rest.del_ang.any()


def test_steps_are_of_twelve_milliseconds_and_a_half_at_400_hz() -> None:
    steps = steps_of([GOOD] * 400)
    assert len(steps) == 80
    assert all(step.del_ang_dt == pytest.approx(0.0125) for step in steps)
    assert [step.time_ms for step in steps[:3]] == [4, 9, 14]


def test_every_pass_is_a_step_at_50_hz() -> None:
    assert len(steps_of([InertialDelta(GOOD.del_vel, GOOD.del_ang, 0.02, 0.02)] * 50)) == 50


@pytest.mark.slow
@given(st.lists(st.tuples(VECTORS, VECTORS), min_size=5, max_size=5))
def test_step_adds_up_velocities_in_the_frame_in_which_it_began(passes: list[tuple[Array, Array]]) -> None:
    passes = [(vel, 0.1 * ang) for vel, ang in passes]
    (step,) = steps_of([InertialDelta(vel, ang, DT, DT) for vel, ang in passes])
    turned, velocity = np.eye(3), np.zeros(3)
    for vel, ang in passes:
        turned = turned @ quaternion.as_rotation_matrix(quaternion.from_rotation_vector(ang))
        velocity = velocity + turned @ vel
    assert np.allclose(step.del_vel, velocity, atol=1e-12)
    assert np.allclose(quaternion.as_rotation_matrix(quat_of_rotation(step.del_ang)), turned, atol=1e-12)


def test_times_that_are_not_given_count_a_tenth_of_a_millisecond() -> None:
    (step,) = steps_of([InertialDelta(GOOD.del_vel, GOOD.del_ang, 0.0, DT)] * 5)
    assert step.del_vel_dt == pytest.approx(5e-4)


def test_average_of_the_steps_follows_them() -> None:
    sampler = DownSampler()
    assert sampler.dt_ekf_avg == 0.012
    for _ in range(4000):
        sampler.add(GOOD, 0)
    assert sampler.dt_ekf_avg == pytest.approx(0.0125, abs=1e-5)


def test_step_that_may_not_be_made_waits_until_it_is_twice_as_long() -> None:
    sampler = DownSampler()
    steps = [sampler.add(GOOD, i, may_step=i > 100) for i in range(1, 111)]
    made = [i for i, step in enumerate(steps, 1) if step is not None]
    assert [after - before for before, after in pairwise(made)][:9] == [10] * 9
    assert made[-2:] == [105, 110]
