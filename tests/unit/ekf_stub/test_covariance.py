# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a covariance: it stays one, and is that of Kalman's formulae.

The formulae are those of any book, in numpy; how errors grow is by differences of the motion, which is quadratic in
the quaternion and linear in all else, so that differences of any size are exact.
"""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ekf_stub.core.covariance import ACCEL, BODY, EARTH, GYRO, POS, STATES, VEL, Covariance
from ekf_stub.core.vectors import matrix, quat_of_euler
from tests.unit.ekf_stub.filter_rig import navigating

Array = npt.NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1)
HIGHEST = 1e9


def drawn(seed: int, *, rank: int = STATES) -> Array:
    """Return a covariance whose errors have much to do with each other."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(STATES, rank)) * 10.0 ** rng.uniform(-3, 0, size=(STATES, 1))
    cov: Array = root @ root.T
    return 0.5 * (cov + cov.T)


def of(array: Array) -> Covariance:
    """Return a covariance without limits."""
    cov = Covariance()
    cov.set_limits(0, STATES, 0.0, HIGHEST)
    for i in range(STATES):
        for j in range(i + 1):
            cov.put(i, j, float(array[i, j]))
    return cov


def as_array(cov: Covariance) -> Array:
    return np.array([[cov.at(i, j) for j in range(STATES)] for i in range(STATES)])


def least_eigenvalue(cov: Array) -> float:
    """Return that of the correlations."""
    sigma = np.sqrt(np.where(cov.diagonal() > 0, cov.diagonal(), 1.0))
    return float(np.linalg.eigvalsh(cov / np.outer(sigma, sigma))[0])


def joseph(cov: Array, row: Array, variance: float, left_alone: list[int]) -> Array:
    """Return the covariance after any gain at all, in the form that holds for any."""
    gain = cov @ row / (row @ cov @ row + variance)
    gain[left_alone] = 0.0
    rest = np.eye(STATES) - np.outer(gain, row)
    after: Array = rest @ cov @ rest.T + variance * np.outer(gain, gain)
    return after


def firmwares(cov: Array, index: int, variance: float, left_alone: list[int]) -> Array:
    """Return what the firmware makes of it."""
    gain = cov[:, index] / (cov[index, index] + variance)
    gain[left_alone] = 0.0
    after: Array = cov - np.outer(gain, cov[index])
    return 0.5 * (after + after.T)


def lifted(cov: Array) -> Array:
    """Return it with the accelerometer's bias of no axis known much better than the worst, as the firmware has it."""
    after = cov.copy()
    least = max(0.01 * cov.diagonal()[ACCEL:EARTH].max(), 5e-9)
    for axis in range(ACCEL, EARTH):
        after[axis, axis] = max(after[axis, axis], least)
    return after


def bits(states: list[int]) -> int:
    return sum(1 << state for state in states)


# Fusion


@given(SEEDS, st.integers(0, STATES - 1), st.floats(1e-3, 1e3))
def test_fusion_of_a_state_is_kalmans(seed: int, index: int, variance: float) -> None:
    before = drawn(seed)
    cov = of(before)
    expected = cov.look_at(index)
    assert expected == before[index, index]
    sigma = cov.fuse(expected, variance, 0)
    after = as_array(cov)
    assert sigma == pytest.approx(np.sqrt(expected + variance))
    assert np.array_equal(after, after.T)
    assert np.allclose(after, lifted(joseph(before, np.eye(STATES)[index], variance, [])), rtol=1e-9, atol=1e-12)
    assert np.allclose(list(cov.gain), before[index] / sigma, rtol=1e-12)


@given(SEEDS, st.lists(st.floats(-3, 3), min_size=STATES, max_size=STATES), st.floats(1e-2, 1e3))
def test_fusion_along_a_row_is_kalmans(seed: int, row: list[float], variance: float) -> None:
    before = drawn(seed)
    cov = of(before)
    for i, value in enumerate(row):
        cov.row[i] = value
    expected = cov.look_along(0, STATES)
    direction = np.array(row)
    assert expected == pytest.approx(direction @ before @ direction, rel=1e-9, abs=1e-12)
    assert cov.fuse(expected, variance, 0) > 0.0
    assert np.allclose(as_array(cov), lifted(joseph(before, direction, variance, [])), rtol=1e-6, atol=1e-9)


@given(SEEDS, st.integers(VEL, GYRO - 1), st.floats(1e-3, 1e3))
def test_states_that_are_left_alone_give_the_firmwares_covariance_where_that_is_one(
    seed: int, index: int, variance: float
) -> None:
    before, left_alone = drawn(seed), [10, 13, 14, 15]
    cov = of(before)
    assert cov.fuse(cov.look_at(index), variance, bits(left_alone)) > 0.0
    after, expected = as_array(cov), firmwares(before, index, variance, left_alone)
    if least_eigenvalue(expected) > -1e-14:
        assert np.allclose(after, lifted(expected), rtol=1e-9, atol=1e-12)
    assert np.array_equal(after, after.T)
    assert least_eigenvalue(after) > -1e-11
    assert [cov.gain[state] for state in left_alone] == [0.0] * 4


def test_states_that_are_left_alone_give_a_covariance_where_the_firmware_has_none() -> None:
    before, left_alone = drawn(1, rank=3) + 1e-9 * np.eye(STATES), [10, 13, 14, 15]
    assert least_eigenvalue(firmwares(before, VEL, 1e-6, left_alone)) < -0.01
    cov = of(before)
    assert cov.fuse(cov.look_at(VEL), 1e-6, bits(left_alone)) > 0.0
    after = as_array(cov)
    assert least_eigenvalue(after) > -1e-12
    assert np.allclose(after, lifted(joseph(before, np.eye(STATES)[VEL], 1e-6, left_alone)), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("left_alone", [0, 1 << 10])
def test_variance_that_would_become_negative_is_not_fused(left_alone: int) -> None:
    # GIVEN two errors that seem to go together more than they can
    cov = of(np.eye(STATES))
    cov.put(VEL, VEL + 1, 10.0)
    before = as_array(cov)
    assert cov.fuse(cov.look_at(VEL), 0.01, left_alone) == 0.0
    assert np.array_equal(as_array(cov), before)


def test_what_a_sharp_measurement_leaves_is_a_covariance_in_spite_of_lost_digits() -> None:
    cov = of(np.diag([588856.0 if state == POS else 0.0025 if state == 3 else 0.0 for state in range(STATES)]))
    cov.row[POS], cov.row[3] = 8.0, 2.0
    assert cov.fuse(cov.look_along(0, STATES), 0.0, 0) > 0.0
    assert least_eigenvalue(as_array(cov)) >= 0
    assert cov.is_positive()


def test_measurement_without_an_error_counts_as_a_very_good_one() -> None:
    cov = of(np.eye(STATES))
    assert cov.fuse(cov.look_at(POS), 0.0, 0) == pytest.approx(1.0)
    assert cov.var(POS) == pytest.approx(1e-8, rel=1e-3)


# Prediction


def grown(cov: Array, quat: Array, del_ang: Array, del_vel: Array, dt: float, noise: float) -> Array:
    """Return what a step makes of a covariance, by differences of the motion."""

    def product(p: Array, q: Array) -> Array:
        a, b, c, d = p
        w, x, y, z = q
        return np.array(
            [
                a * w - b * x - c * y - d * z,
                a * x + b * w + c * z - d * y,
                a * y - b * z + c * w + d * x,
                a * z + b * y - c * x + d * w,
            ]
        )

    def rotation(q: Array) -> Array:
        # It counts a quaternion's length in as the firmware does.
        w, x, y, z = q
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    def moved(errors: Array) -> Array:
        q = quat + errors[:4]
        after = errors.copy()
        turn = np.concatenate([[1.0], 0.5 * (del_ang - errors[GYRO : GYRO + 3])])
        after[:4] = product(q, turn) - quat
        after[VEL : VEL + 3] += rotation(q) @ (del_vel - errors[ACCEL : ACCEL + 3])
        after[POS : POS + 3] += dt * errors[VEL : VEL + 3]
        return after

    transition = np.array([moved(0.5 * unit) - moved(-0.5 * unit) for unit in np.eye(STATES)]).T
    added = np.zeros((STATES, STATES))
    by_rotation = np.array([product(quat, np.array([0.0, *(0.5 * axis)])) for axis in np.eye(3)]).T
    added[:4, :4] = noise * by_rotation @ by_rotation.T
    for first, variance in (
        (VEL, 2 * noise),
        (GYRO, 3 * noise),
        (ACCEL, 4 * noise),
        (EARTH, 5 * noise),
        (BODY, 6 * noise),
    ):
        added[first : first + 3, first : first + 3] = variance * np.eye(3)
    found: Array = transition @ cov @ transition.T + added
    return found


@settings(max_examples=20)
@given(
    SEEDS,
    st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    st.tuples(*[st.floats(-0.05, 0.05)] * 3),
    st.tuples(*[st.floats(-1, 1)] * 3),
)
def test_prediction_is_that_of_the_motion(
    seed: int,
    rpy: tuple[float, float, float],
    del_ang: tuple[float, float, float],
    del_vel: tuple[float, float, float],
) -> None:
    before, quat, dt, noise = drawn(seed), quat_of_euler(*rpy), 0.0125, 1e-4
    cov = of(before)
    variances = (3 * noise, 4 * noise), (5 * noise, 6 * noise)
    cov.predict(quat, matrix(quat), del_ang, del_vel, dt, noise, 2 * noise, *variances)
    after = as_array(cov)
    expected = grown(before, np.array(quat), np.array(del_ang), np.array(del_vel), dt, noise)
    assert np.array_equal(after, after.T)
    assert np.allclose(after, expected, rtol=1e-9, atol=1e-10)


def test_position_that_is_lost_does_not_grow_less_certain() -> None:
    cov = of(np.eye(STATES))
    for axis in range(3):
        cov.put(POS + axis, POS + axis, 6000.0)
    quat = quat_of_euler(0.0, 0.0, 0.0)
    for _ in range(80):
        cov.predict(quat, matrix(quat), (0.0, 0.0, 0.0), (0.0, 0.0, -0.12), 0.0125, 0.0, 0.0, (0.0, 0.0), (0.0, 0.0))
    assert [cov.var(POS), cov.var(POS + 1)] == [6000.0, 6000.0]
    assert cov.var(POS + 2) > 6000.5
    assert cov.at(POS, VEL) == 0.0 != cov.at(POS + 2, VEL + 2)


# Limits


@given(SEEDS)
def test_lowered_variances_keep_correlations(seed: int) -> None:
    before = 1e3 * drawn(seed)
    cov = of(before)
    cov.set_limits(0, STATES, 0.0, 1.0)
    cov.lower()
    after = as_array(cov)
    variances = after.diagonal()
    assert (variances <= 1.0).all()
    assert np.array_equal(after, after.T)
    sigma, sigma_before = np.sqrt(variances), np.sqrt(before.diagonal())
    assert np.allclose(after / np.outer(sigma, sigma), before / np.outer(sigma_before, sigma_before), atol=1e-9)


def test_lifted_variances_change_no_covariances() -> None:
    before = 1e-12 * drawn(3)
    before[ACCEL, ACCEL] = 1e-4
    cov = of(before)
    cov.set_limits(VEL, GYRO, 1e-4, HIGHEST)
    cov.lift()
    after = as_array(cov)
    assert (after.diagonal()[VEL:GYRO] == 1e-4).all()
    # Of the accelerometer's bias, none is known much better than the others.
    assert after.diagonal()[ACCEL:EARTH] == pytest.approx([1e-4, 1e-6, 1e-6])
    assert np.array_equal(after.diagonal()[:4], before.diagonal()[:4])
    off = ~np.eye(STATES, dtype=bool)
    assert np.array_equal(after[off], before[off])


@pytest.mark.parametrize(
    ("variance", "expected"), [(0.3, 0.3), (-1.0, 0.0), (1e9, 1e3), (float("inf"), 1e3), (float("nan"), 1e3)]
)
def test_cleared_variance_is_one_that_can_be(variance: float, expected: float) -> None:
    cov = of(drawn(1))
    cov.set_limits(VEL, POS, 0.0, 1e3)
    cov.clear(VEL, POS, variance)
    after = as_array(cov)
    assert (after.diagonal()[VEL:POS] == expected).all()
    assert np.count_nonzero(after[VEL:POS]) == (3 if expected else 0)


def test_attitude_is_as_uncertain_as_a_rotation_and_the_bias_of_the_gyro_over_a_step() -> None:
    before = drawn(1)
    cov, (w, x, y, z) = of(before), quat_of_euler(0.1, -0.2, 1.0)
    cov.set_attitude((w, x, y, z), (0.1, 0.2, 0.3))
    by_turning = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]])
    turn = np.diag([0.1, 0.2, 0.3]) + before[GYRO:ACCEL, GYRO:ACCEL]
    found = [[cov.at(i, j) for j in range(VEL)] for i in range(VEL)]
    assert found == pytest.approx(by_turning @ turn @ by_turning.T, abs=1e-12)


def test_positive_is_what_has_no_mix_of_negative_variance() -> None:
    for together, is_positive in ((0.0, True), (1.0, True), (1.001, False)):
        cov = of(np.eye(STATES))
        cov.put(0, 1, together)
        assert cov.is_positive() is is_positive
    assert of(np.zeros((STATES, STATES))).is_positive()


def test_correlations_are_forgotten_and_how_large_errors_are_is_not() -> None:
    before = drawn(5)
    cov = of(before)
    cov.forget_correlations()
    after = as_array(cov)
    assert np.array_equal(after.diagonal(), before.diagonal())
    assert np.array_equal(after[:4, :4], before[:4, :4])
    assert np.array_equal(after[VEL:GYRO, VEL:GYRO], before[VEL:GYRO, VEL:GYRO])
    assert not after[:4, 4:].any()
    assert np.count_nonzero(after[GYRO:EARTH]) == 6


@settings(max_examples=20)
@given(SEEDS, st.lists(st.tuples(st.integers(0, STATES - 1), st.floats(1e-8, 100), st.booleans()), max_size=30))
def test_covariance_stays_symmetric_and_positive(seed: int, fused: list[tuple[int, float, bool]]) -> None:
    cov = of(drawn(seed))
    quat = quat_of_euler(0.2, 0.1, -1.0)
    for index, variance, is_left in fused:
        noise = 1e-6, 1e-4, (1e-10, 1e-8), (1e-8, 1e-9)
        cov.predict(quat, matrix(quat), (0.01, -0.02, 0.03), (0.05, -0.02, -0.12), 0.0125, *noise)
        cov.lower()
        cov.fuse(cov.look_at(index), variance, 7 << ACCEL if is_left else 0)
        after = as_array(cov)
        assert np.array_equal(after, after.T)
        assert (after.diagonal() >= 0).all()
        assert least_eigenvalue(after) > -1e-9  # of a correlation of 1


@pytest.mark.parametrize("limit", [1.0, 0.1])
def test_biases_stay_within_limits_of_which_that_of_accelerometers_is_as_its_parameter_is_now(limit: float) -> None:
    rig = navigating()
    rig.set_param("ACC_BIAS_LIM", limit)
    rig.run(0.05)
    state, dt = rig.core.state, rig.core.dt_ekf_avg
    state.set_gyro_bias((9.0, -9.0, 0.0))
    state.set_accel_bias((9.0, -9.0, 0.0))
    assert state.gyro_bias == pytest.approx((0.5 * dt, -0.5 * dt, 0.0))
    assert state.accel_bias == pytest.approx((limit * dt, -limit * dt, 0.0))


def test_correction_of_a_bias_may_exceed_its_limit_until_the_next_prediction() -> None:
    rig = navigating()
    rig.set_param("ACC_BIAS_LIM", 0.01)
    rig.run(0.05)
    state, limit = rig.core.state, 0.01 * rig.core.dt_ekf_avg
    state.fuse(state.cov.look_at(ACCEL + 2), 1.0, 0.0)
    assert state.accel_bias[2] < -2 * limit
    rig.step()
    assert state.accel_bias[2] == pytest.approx(-limit, rel=1e-3)
