# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Between smoother and filter: the same errors in other words."""

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("gtsam")

from tests.unit.viso.companion.smoother.scene import B_T_C, NOISE, PERIOD_NS, start, window
from viso.companion.msckf.window_filter import WindowFilter
from viso.companion.smoother.belief import adopt, correction_nis, motion_of, smoother_cov
from viso.companion.smoother.lag_smoother import LagSmoother, preintegrated
from viso.companion.vio.imu import steps_of
from viso.companion.vio.types import ImuBias
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array


def turned_state(seed: int = 3) -> WindowFilter:
    """Return a state that is turned, far from the origin and fast, with a covariance that couples everything."""
    rng = np.random.default_rng(seed)
    pose = SE3.exp(np.array([0.3, -0.4, 1.2, 20.0, -30.0, 10.0]))
    root = rng.normal(size=(15, 15)) * np.repeat([0.01, 0.05, 0.1, 0.002, 0.05], 3)
    bias = ImuBias(np.array([0.1, -0.2, 0.1]), np.array([0.01, 0.02, -0.01]))
    return WindowFilter(NOISE, pose.R, pose.t, np.array([5.0, -3.0, 1.0]), bias, 0.1 * root.T @ root)


def relative(cov: Array, reference: Array) -> Array:
    sigma = np.sqrt(reference.diagonal())
    errors: Array = (cov - reference) / np.outer(sigma, sigma)
    return errors


def carried_by_smoother(state: WindowFilter) -> WindowFilter:
    """Return what a smoother makes of a state by inertial data alone."""
    since = preintegrated(window(0, PERIOD_NS).samples, NOISE, state.bias)
    smoother = LagSmoother(B_T_C, 0, 0.0, motion_of(state), smoother_cov(state))
    smoother.add_node(1, PERIOD_NS * 1e-9, motion_of(state), since)
    smoother.solve(passes=5)
    adopt(state, smoother.motion(), {0: smoother.pose(0)}, smoother.joint_cov(0))
    return state


def carried_by_filter(state: WindowFilter) -> WindowFilter:
    state.clone(0)
    state.propagate(steps_of(window(0, PERIOD_NS)))
    return state


def test_smoother_and_filter_move_alike() -> None:
    ours, theirs = carried_by_smoother(turned_state()), carried_by_filter(turned_state())
    assert np.allclose(ours.pose.matrix(), theirs.pose.matrix(), atol=1e-5)
    assert np.allclose(ours.v, theirs.v, atol=1e-5)
    assert np.allclose(ours.bias.gyro, theirs.bias.gyro, atol=1e-6)
    assert np.allclose(ours.bias.accel, theirs.bias.accel, atol=1e-5)


def test_smoother_and_filter_know_the_relative_pose_alike() -> None:
    ours, theirs = carried_by_smoother(turned_state()), carried_by_filter(turned_state())
    (pose, cov), (reference_pose, reference_cov) = ours.relative_to(0), theirs.relative_to(0)
    assert np.allclose(pose.matrix(), reference_pose.matrix(), atol=1e-5)
    assert np.abs(relative(cov, reference_cov)).max() < 0.02


def test_smoother_and_filter_know_velocity_and_bias_alike() -> None:
    ours, theirs = carried_by_smoother(turned_state()), carried_by_filter(turned_state())
    assert np.abs(relative(ours.cov[6:15, 6:15], theirs.cov[6:15, 6:15])).max() < 0.02


def test_certain_place_is_no_obstacle() -> None:
    state = start()
    assert not state.cov[3:6, 3:6].any()
    assert np.linalg.eigvalsh(smoother_cov(state))[0] > 0


def test_adopting_leaves_one_clone() -> None:
    state = start()
    state.clone(4)
    state.clone(5)
    adopt(state, motion_of(state), {7: SE3.identity()}, np.eye(21))
    assert [clone.number for clone in state.clones] == [7]
    assert state.cov.shape == (21, 21)


@pytest.mark.slow
def test_nis_of_honest_corrections_is_one() -> None:
    rng = np.random.default_rng(5)
    ratios = []
    for _ in range(300):
        state = start()
        state.cov += 1e-6 * np.eye(15)
        before, cov_before = motion_of(state), state.cov
        jacobian = rng.normal(size=(4, 15))
        jacobian[:, 9:] = 0
        root = np.linalg.cholesky(cov_before)
        innovation = jacobian @ root @ rng.normal(size=15) + rng.normal(0, 1e-3, 4)
        state.update(jacobian, innovation, 1e-3)
        ratios.append(correction_nis(before, cov_before, motion_of(state), state.cov))
    assert np.mean([ratio for ratio in ratios if ratio is not None]) == pytest.approx(1.0, abs=0.1)


def test_correction_too_large_for_what_was_known_stands_out() -> None:
    state = start()
    state.cov += 1e-6 * np.eye(15)
    before, cov_before = motion_of(state), state.cov
    jacobian = np.zeros((3, 15))
    jacobian[:, 6:9] = np.eye(3)
    state.update(jacobian, np.full(3, 1.5), 1e-3)
    nis = correction_nis(before, cov_before, motion_of(state), state.cov)
    assert nis is not None
    assert nis == pytest.approx((1.5 / 0.3) ** 2, rel=0.1)


def test_learning_nothing_is_no_nis() -> None:
    state = start()
    state.cov += 1e-6 * np.eye(15)
    assert correction_nis(motion_of(state), state.cov, motion_of(state), state.cov) is None
