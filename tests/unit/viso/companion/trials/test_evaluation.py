# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories are compared as the common benchmarks compare them; evo is the oracle."""

import math
from typing import Any

import numpy as np
import pytest
from evo.core import metrics, sync  # type: ignore[import-untyped]  # evo ships no type information
from evo.core.trajectory import PoseTrajectory3D  # type: ignore[import-untyped]  # as above
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.trials.evaluation import (
    EvaluationError,
    TimedPoses,
    absolute_error,
    in_common,
    umeyama,
)
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp, so3_log

NS = 1_000_000_000
seeds = st.integers(0, 1_000_000)


def flown(seed: int = 0, count: int = 60) -> TimedPoses:
    """Return a smooth flight."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(count) * 0.1
    rates, phases, sizes = rng.uniform(0.3, 1.5, (6, 1)), rng.uniform(0, 6, (6, 1)), rng.uniform(0.5, 2, (6, 1))
    waves = sizes * np.sin(rates * t_s + phases)
    poses = [SE3(so3_exp(wave[3:]), 5 * wave[:3]) for wave in waves.T]
    return timed((t_s * NS).round().astype(np.int64), poses)


def timed(t_ns: np.ndarray, poses: list[SE3]) -> TimedPoses:
    positions, quats = [pose.t for pose in poses], [pose.quat_wxyz() for pose in poses]
    return TimedPoses(t_ns, np.reshape(positions, (-1, 3)), np.reshape(quats, (-1, 4)))


def estimated(truth: TimedPoses, seed: int, sigma_m: float = 0.1, sigma_rad: float = 0.02) -> TimedPoses:
    """Return the truth with noise, in another frame."""
    rng = np.random.default_rng([seed, 1])
    frame = SE3(so3_exp(rng.normal(0, 1, 3)), rng.normal(0, 10, 3))
    errors = [SE3(so3_exp(rng.normal(0, sigma_rad, 3)), rng.normal(0, sigma_m, 3)) for _ in range(len(truth))]
    return timed(truth.t_ns, [frame @ truth.pose(k) @ error for k, error in enumerate(errors)])


def in_evo(poses: TimedPoses) -> PoseTrajectory3D:
    return PoseTrajectory3D(
        positions_xyz=poses.positions_xyz.copy(),
        orientations_quat_wxyz=poses.quats_wxyz.copy(),
        timestamps=poses.t_ns / NS,
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
    assert flown(3).path_length_m() == pytest.approx(in_evo(flown(3)).path_length, rel=1e-12)


def test_poses_in_common_are_those_evo_associates() -> None:
    truth = flown(1)
    estimate = estimated(truth, 1).within(1 * NS, 3 * NS)
    ours, _ = in_common(estimate, truth)
    _, theirs = sync.associate_trajectories(in_evo(truth), in_evo(estimate))
    assert ours.t_ns / NS == pytest.approx(theirs.timestamps)


def test_truth_has_no_error() -> None:
    error = absolute_error(flown(), flown())
    assert error.rmse_m == pytest.approx(0, abs=1e-12)
    assert error.scale == pytest.approx(1)
    assert error.count == 60


def test_scale_is_no_part_of_the_alignment() -> None:
    truth = flown()
    larger = TimedPoses(truth.t_ns, 2 * truth.positions_xyz, truth.quats_wxyz)
    error = absolute_error(larger, truth)
    assert error.scale == pytest.approx(0.5)
    spread = truth.positions_xyz - truth.positions_xyz.mean(axis=0)
    assert error.rmse_m == pytest.approx(math.sqrt(float((spread**2).sum(axis=1).mean())))


def test_path_is_that_of_the_truth_over_the_same_time() -> None:
    truth = flown()
    assert absolute_error(truth.within(1 * NS, 2 * NS), truth).path_m == truth.within(1 * NS, 2 * NS).path_length_m()


def test_estimate_is_compared_with_the_truth_at_its_times() -> None:
    truth = flown(count=1000)
    between = truth.interpolated(truth.t_ns[:-1] + 37_000_000)
    assert absolute_error(between, truth).rmse_m == pytest.approx(0, abs=1e-9)


def test_poses_before_and_after_the_truth_do_not_count() -> None:
    truth = flown()
    assert absolute_error(truth, truth.within(1 * NS, 2 * NS)).count == 11


def test_alignment_does_not_mirror() -> None:
    points = flown().positions_xyz
    alignment, _ = umeyama(points, points * [1, 1, -1])
    assert np.linalg.det(alignment.R) == pytest.approx(1)


def test_flight_in_a_plane_is_aligned() -> None:
    points = flown().positions_xyz * [1, 1, 0]
    frame = SE3(so3_exp(np.array([0.3, -0.2, 2.0])), np.array([4.0, 5.0, 6.0]))
    alignment, _ = umeyama(points, frame.map(points))
    assert np.abs(alignment.R - frame.R).max() < 1e-9


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
def test_positions_are_interpolated_linearly(share: float) -> None:
    poses = timed(np.array([0, 100]), [SE3.identity(), SE3(np.eye(3), np.array([4.0, 0, -8.0]))])
    at = poses.interpolated(np.array([int(100 * share)]))
    assert at.positions_xyz[0] == pytest.approx([4 * share, 0, -8 * share])


def turned_half_way(first: Array, second: Array) -> Array:
    poses = TimedPoses(np.array([0, 100]), np.zeros((2, 3)), np.array([first, second]))
    return so3_log(poses.interpolated(np.array([50])).pose(0).R)


def test_attitudes_are_interpolated_the_shorter_way() -> None:
    first, second = np.array([1.0, 0, 0, 0]), np.array([math.cos(0.3), 0, 0, math.sin(0.3)])
    assert turned_half_way(first, second) == pytest.approx([0, 0, 0.3])
    assert turned_half_way(first, -second) == pytest.approx([0, 0, 0.3])


def test_quaternions_need_not_be_normalised() -> None:
    first, second = np.array([3.0, 0, 0, 0]), np.array([math.cos(0.3), 0, 0, math.sin(0.3)])
    assert turned_half_way(first, 0.1 * second) == pytest.approx([0, 0, 0.3])


def test_interpolation_stays_within_the_trajectory() -> None:
    with pytest.raises(EvaluationError, match="outside"):
        flown().interpolated(np.array([-1]))


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        (flown(count=0), "the truth is empty"),
        (flown(count=1), "times outside"),
        (flown(count=2), "2 poses in common"),
    ],
)
def test_too_little_truth_is_told(truth: TimedPoses, message: str) -> None:
    with pytest.raises(EvaluationError, match=message):
        absolute_error(flown(), truth)


def test_estimate_at_another_time_is_told() -> None:
    late = TimedPoses(flown().t_ns + 1000 * NS, flown().positions_xyz, flown().quats_wxyz)
    with pytest.raises(EvaluationError, match="0 poses in common"):
        absolute_error(late, flown())


def test_estimate_that_does_not_move_is_told() -> None:
    truth = flown()
    still = TimedPoses(truth.t_ns, np.ones((60, 3)), truth.quats_wxyz)
    with pytest.raises(EvaluationError, match="does not move"):
        absolute_error(still, truth)


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("t_ns", (np.array([0, 0]), np.zeros((2, 3)), np.ones((2, 4)))),
        ("t_ns", (np.zeros((1, 2)), np.zeros((1, 3)), np.ones((1, 4)))),
        ("positions_xyz", (np.array([0, 1]), np.zeros((3, 3)), np.ones((2, 4)))),
        ("positions_xyz", (np.array([0]), np.full((1, 3), np.nan), np.ones((1, 4)))),
        ("quats_wxyz", (np.array([0]), np.zeros((1, 3)), np.ones((1, 3)))),
        ("quats_wxyz", (np.array([0]), np.zeros((1, 3)), np.zeros((1, 4)))),
    ],
)
def test_poses_are_validated(field: str, values: tuple[Any, Any, Any]) -> None:
    with pytest.raises(ValueError, match=field):
        TimedPoses(*values)


def test_pose_at_a_time_is_interpolated_and_unknown_outside() -> None:
    poses = TimedPoses.of([(0, SE3.identity()), (10, SE3(np.eye(3), np.array([2.0, 4.0, 6.0])))])
    pose = poses.at(5)
    assert pose is not None
    assert pose.t.tolist() == [1.0, 2.0, 3.0]
    assert poses.at(11) is poses.at(-1) is TimedPoses.of([]).at(0) is None
