# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories are compared as the common benchmarks compare them; evo is the oracle."""

import math

import numpy as np
import pytest
from evo.core import metrics, sync  # type: ignore[import-untyped]  # evo ships no type information
from evo.core.trajectory import PoseTrajectory3D  # type: ignore[import-untyped]  # as above
from hypothesis import given
from hypothesis import strategies as st

from viso.geometry.errors import EvaluationError, absolute_error, in_common, umeyama
from viso.geometry.pose import SE3
from viso.geometry.rotation import so3_exp
from viso.geometry.trajectory import Trajectory

NS = 1_000_000_000
seeds = st.integers(0, 1_000_000)


def flown(seed: int = 0, count: int = 60) -> Trajectory:
    """Return a smooth flight."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(count) * 0.1
    rates, phases, sizes = rng.uniform(0.3, 1.5, (6, 1)), rng.uniform(0, 6, (6, 1)), rng.uniform(0.5, 2, (6, 1))
    waves = sizes * np.sin(rates * t_s + phases)
    poses = [SE3(so3_exp(wave[3:]), 5 * wave[:3]) for wave in waves.T]
    return timed((t_s * NS).round().astype(np.int64), poses)


def timed(t_ns: np.ndarray, poses: list[SE3]) -> Trajectory:
    positions, quats = [pose.t for pose in poses], [pose.quat_wxyz() for pose in poses]
    return Trajectory(t_ns, np.reshape(positions, (-1, 3)), np.reshape(quats, (-1, 4)))


def estimated(truth: Trajectory, seed: int, sigma_m: float = 0.1, sigma_rad: float = 0.02) -> Trajectory:
    """Return the truth with noise, in another frame."""
    rng = np.random.default_rng([seed, 1])
    frame = SE3(so3_exp(rng.normal(0, 1, 3)), rng.normal(0, 10, 3))
    errors = [SE3(so3_exp(rng.normal(0, sigma_rad, 3)), rng.normal(0, sigma_m, 3)) for _ in range(len(truth))]
    return timed(truth.times_ns, [frame @ truth.se3(k) @ error for k, error in enumerate(errors)])


def in_evo(poses: Trajectory) -> PoseTrajectory3D:
    return PoseTrajectory3D(
        positions_xyz=poses.positions.copy(),
        orientations_quat_wxyz=poses.quats_wxyz.copy(),
        timestamps=poses.times_ns / NS,
    )


@pytest.mark.slow
@given(seeds)
def test_absolute_error_is_evos(seed: int) -> None:
    truth = flown(seed, 20)
    estimate = estimated(truth, seed)
    theirs = in_evo(estimate)
    theirs.align(in_evo(truth))
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((in_evo(truth), theirs))
    assert absolute_error(estimate, truth).rmse_m == pytest.approx(ape.get_all_statistics()["rmse"], rel=1e-9)


@pytest.mark.slow
@given(seeds)
def test_alignment_and_scale_are_evos(seed: int) -> None:
    truth = flown(seed, 20)
    estimate = estimated(truth, seed, sigma_m=0.5)
    ours = absolute_error(estimate, truth)
    rotation, _, scale = in_evo(estimate).align(in_evo(truth), correct_scale=True)
    assert np.abs(ours.alignment.R - rotation).max() < 1e-9
    assert ours.scale == pytest.approx(scale, rel=1e-9)


def test_path_length_is_evos() -> None:
    assert flown(3).path_length_m == pytest.approx(in_evo(flown(3)).path_length, rel=1e-12)


def test_poses_in_common_are_those_evo_associates() -> None:
    truth = flown(1)
    estimate = estimated(truth, 1).within(1 * NS, 3 * NS)
    ours, _ = in_common(estimate, truth)
    _, theirs = sync.associate_trajectories(in_evo(truth), in_evo(estimate))
    assert ours.times_ns / NS == pytest.approx(theirs.timestamps)


def test_truth_has_no_error() -> None:
    error = absolute_error(flown(), flown())
    assert error.rmse_m == pytest.approx(0, abs=1e-12)
    assert error.scale == pytest.approx(1)
    assert error.count == 60


def test_scale_is_no_part_of_the_alignment() -> None:
    truth = flown()
    larger = Trajectory(truth.times_ns, 2 * truth.positions, truth.quats_wxyz)
    error = absolute_error(larger, truth)
    assert error.scale == pytest.approx(0.5)
    spread = truth.positions - truth.positions.mean(axis=0)
    assert error.rmse_m == pytest.approx(math.sqrt(float((spread**2).sum(axis=1).mean())))


def test_path_is_that_of_the_truth_over_the_same_time() -> None:
    truth = flown()
    assert absolute_error(truth.within(1 * NS, 2 * NS), truth).path_m == truth.within(1 * NS, 2 * NS).path_length_m


def test_estimate_is_compared_with_the_truth_at_its_times() -> None:
    truth = flown(count=1000)
    between = truth.interpolated(truth.times_ns[:-1] + 37_000_000)
    assert absolute_error(between, truth).rmse_m == pytest.approx(0, abs=1e-9)


def test_poses_before_and_after_the_truth_do_not_count() -> None:
    truth = flown()
    assert absolute_error(truth, truth.within(1 * NS, 2 * NS)).count == 11


def test_alignment_does_not_mirror() -> None:
    points = flown().positions
    alignment, _ = umeyama(points, points * [1, 1, -1])
    assert np.linalg.det(alignment.R) == pytest.approx(1)


def test_flight_in_a_plane_is_aligned() -> None:
    points = flown().positions * [1, 1, 0]
    frame = SE3(so3_exp(np.array([0.3, -0.2, 2.0])), np.array([4.0, 5.0, 6.0]))
    alignment, _ = umeyama(points, frame.map(points))
    assert np.abs(alignment.R - frame.R).max() < 1e-9


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        (flown(count=0), "the truth is empty"),
        (flown(count=1), "times outside"),
        (flown(count=2), "2 poses in common"),
    ],
)
def test_too_little_truth_is_told(truth: Trajectory, message: str) -> None:
    with pytest.raises(EvaluationError, match=message):
        absolute_error(flown(), truth)


def test_estimate_at_another_time_is_told() -> None:
    late = Trajectory(flown().times_ns + 1000 * NS, flown().positions, flown().quats_wxyz)
    with pytest.raises(EvaluationError, match="0 poses in common"):
        absolute_error(late, flown())


def test_estimate_that_does_not_move_is_told() -> None:
    truth = flown()
    still = Trajectory(truth.times_ns, np.ones((60, 3)), truth.quats_wxyz)
    with pytest.raises(EvaluationError, match="does not move"):
        absolute_error(still, truth)
