# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded trajectory: what it refuses, its velocities, and what stands between its records."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.trajectories import make_trajectory
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_log
from viso.geometry.trajectory import TIME_END_NS, Trajectory

LEVEL = [1.0, 0.0, 0.0, 0.0]
YAWED_90 = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("times_ns", np.array([0, 2, 2])),
        ("times_ns", np.array([-TIME_END_NS, 0, 1])),
        ("times_ns", np.array([0, 1, TIME_END_NS])),
        ("positions", np.zeros((3, 2))),
        ("positions", np.full((3, 3), np.nan)),
        ("quats_wxyz", np.zeros((3, 4))),
        ("velocities", np.zeros((2, 3))),
        ("velocities", np.full((3, 3), np.inf)),
        ("covariances", np.zeros((3, 6, 5))),
        ("resets", np.zeros(2)),
    ],
)
def test_field_that_is_wrong_is_named(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"^{field}: "):
        make_trajectory(3, **{field: value})


def test_trajectory_without_records_has_no_length() -> None:
    empty = make_trajectory(0)
    assert (len(empty), empty.duration_s, empty.path_length_m) == (0, 0.0, 0.0)


def test_arrays_cannot_be_written_to() -> None:
    trajectory = make_trajectory()
    for array in (trajectory.times_ns, trajectory.positions, trajectory.quats_wxyz, trajectory.world_velocities):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_quaternions_become_unit() -> None:
    trajectory = make_trajectory(2, quats_wxyz=np.array([[2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -0.5]]))
    assert trajectory.quats_wxyz.tolist() == [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0]]


def test_velocities_follow_from_positions() -> None:
    np.testing.assert_allclose(make_trajectory().world_velocities, np.tile([1.0, 0.0, 0.0], (5, 1)))


def test_velocities_of_the_recording_win() -> None:
    given_velocities = np.full((5, 3), 7.0)
    trajectory = make_trajectory(velocities=given_velocities)
    assert (trajectory.world_velocities == given_velocities).all()
    np.testing.assert_allclose(trajectory.without_velocities().pose(2).velocity, [1.0, 0.0, 0.0])


def test_velocities_of_uneven_times_are_those_of_a_parabola() -> None:
    times_s = np.array([0.0, 0.1, 0.4, 0.5])
    positions = np.outer(times_s**2, [1.0, 0.0, 0.0])
    trajectory = make_trajectory(4, times_ns=(times_s * 1e9).astype(np.int64), positions=positions)
    np.testing.assert_allclose(trajectory.world_velocities[1:3, 0], 2 * times_s[1:3])


def test_single_record_stands_still() -> None:
    assert make_trajectory(1).pose(0).velocity.tolist() == [0.0, 0.0, 0.0]


def test_jump_is_a_reset_and_no_velocity() -> None:
    positions = np.array([[0.0, 0, 0], [0.1, 0, 0], [5.2, 0, 0], [5.3, 0, 0]])
    trajectory = make_trajectory(4, positions=positions).with_resets_at_jumps(1.0)
    assert [trajectory.pose(number).resets for number in range(4)] == [0, 0, 1, 1]
    np.testing.assert_allclose(trajectory.world_velocities[:, 0], 1.0)


def test_unknown_covariance_of_a_record_is_none() -> None:
    covariances = np.stack([np.eye(6), np.full((6, 6), np.nan)])
    trajectory = make_trajectory(2, covariances=covariances)
    assert trajectory.pose(0).covariance is not None
    assert trajectory.pose(1).covariance is None


def test_one_covariance_may_stand_everywhere() -> None:
    covariance = make_trajectory().with_sigmas((0.2, 0.1)).pose(3).covariance
    assert covariance is not None
    np.testing.assert_allclose(covariance, np.diag([0.04] * 3 + [0.01] * 3))
    assert make_trajectory().with_sigmas((1, 1)).with_sigmas(None).pose(3).covariance is None


def test_resampling_interpolates() -> None:
    quats = np.array([LEVEL, YAWED_90])
    trajectory = make_trajectory(2, quats_wxyz=quats, velocities=np.array([[1.0, 0, 0], [3.0, 0, 0]]))
    middle = trajectory.resampled(20.0, 1.0).pose(1)
    np.testing.assert_allclose(middle.position, [0.05, 0.0, 0.0])
    np.testing.assert_allclose(middle.velocity, [2.0, 0.0, 0.0])
    np.testing.assert_allclose(middle.quat_wxyz, [math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8)])


def test_quaternions_are_interpolated_the_short_way() -> None:
    trajectory = make_trajectory(2, quats_wxyz=np.array([LEVEL, [-1.0, 0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(trajectory.resampled(20.0, 1.0).quats_wxyz[1], LEVEL)


def test_records_are_met_exactly() -> None:
    trajectory = make_trajectory()
    again = trajectory.resampled(10.0, 1.0)
    assert (again.times_ns == trajectory.times_ns).all()
    np.testing.assert_allclose(again.positions, trajectory.positions)


def test_nothing_is_made_up_in_a_gap() -> None:
    times_ns = np.array([0, 100, 2100, 2200]) * 1_000_000
    resampled = make_trajectory(4, times_ns=times_ns).resampled(20.0, 1.0)
    assert (resampled.times_ns // 1_000_000).tolist() == [0, 50, 100, 2100, 2150, 2200]


def test_earlier_record_stands_up_to_a_reset() -> None:
    trajectory = make_trajectory(2, positions=np.array([[0.0, 0, 0], [9.0, 0, 0]]), resets=np.array([0, 1]))
    resampled = trajectory.resampled(20.0, 1.0)
    assert resampled.positions[:, 0].tolist() == [0.0, 0.0, 9.0]
    assert [resampled.pose(number).resets for number in range(3)] == [0, 0, 1]


def test_covariance_beside_an_unknown_one_is_known_at_its_record_only() -> None:
    covariances = np.stack([np.eye(6), np.full((6, 6), np.nan)])
    resampled = make_trajectory(2, covariances=covariances).resampled(20.0, 1.0)
    assert [resampled.pose(number).covariance is None for number in range(3)] == [False, True, True]


def test_resampling_keeps_what_was_left_out() -> None:
    assert dict(make_trajectory(left_out={"reason": 3}).resampled(30.0, 1.0).left_out) == {"reason": 3}


@given(
    st.lists(st.integers(1, 3_000_000_000), min_size=1, max_size=20),
    st.floats(0.5, 200.0),
    st.floats(0.0, 5.0),
)
def test_resampled_records_lie_between_their_neighbours(steps_ns: list[int], rate_hz: float, max_gap_s: float) -> None:
    times_ns = np.cumsum([0, *steps_ns])
    positions = np.outer(np.arange(len(times_ns)), [1.0, 2.0, -1.0])
    trajectory = Trajectory(times_ns, positions, np.tile(LEVEL, (len(times_ns), 1)))
    resampled = trajectory.resampled(rate_hz, max_gap_s)
    after = np.searchsorted(times_ns, resampled.times_ns)
    assert resampled.times_ns[0] == 0
    assert (resampled.positions[:, 0] <= after + 1e-9).all()
    assert (resampled.positions[:, 0] >= after - 1 - 1e-9).all()


def timed(t_ns: np.ndarray, poses: list[SE3]) -> Trajectory:
    positions, quats = [pose.t for pose in poses], [pose.quat_wxyz() for pose in poses]
    return Trajectory(t_ns, np.reshape(positions, (-1, 3)), np.reshape(quats, (-1, 4)))


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
def test_positions_are_interpolated_linearly(share: float) -> None:
    poses = timed(np.array([0, 100]), [SE3.identity(), SE3(np.eye(3), np.array([4.0, 0, -8.0]))])
    at = poses.interpolated(np.array([int(100 * share)]))
    assert at.positions[0] == pytest.approx([4 * share, 0, -8 * share])


def turned_half_way(first: Array, second: Array) -> Array:
    poses = Trajectory(np.array([0, 100]), np.zeros((2, 3)), np.array([first, second]))
    return so3_log(poses.interpolated(np.array([50])).se3(0).R)


def test_attitudes_are_interpolated_the_shorter_way() -> None:
    first, second = np.array([1.0, 0, 0, 0]), np.array([math.cos(0.3), 0, 0, math.sin(0.3)])
    assert turned_half_way(first, second) == pytest.approx([0, 0, 0.3])
    assert turned_half_way(first, -second) == pytest.approx([0, 0, 0.3])


def test_quaternions_need_not_be_normalised() -> None:
    first, second = np.array([3.0, 0, 0, 0]), np.array([math.cos(0.3), 0, 0, math.sin(0.3)])
    assert turned_half_way(first, 0.1 * second) == pytest.approx([0, 0, 0.3])


def test_interpolation_stays_within_the_trajectory() -> None:
    with pytest.raises(ValueError, match="outside"):
        timed(np.array([0, 100]), [SE3.identity(), SE3.identity()]).interpolated(np.array([-1]))


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("times_ns", (np.array([0, 0]), np.zeros((2, 3)), np.ones((2, 4)))),
        ("times_ns", (np.zeros((1, 2)), np.zeros((1, 3)), np.ones((1, 4)))),
        ("positions", (np.array([0, 1]), np.zeros((3, 3)), np.ones((2, 4)))),
        ("positions", (np.array([0]), np.full((1, 3), np.nan), np.ones((1, 4)))),
        ("quats_wxyz", (np.array([0]), np.zeros((1, 3)), np.ones((1, 3)))),
        ("quats_wxyz", (np.array([0]), np.zeros((1, 3)), np.zeros((1, 4)))),
    ],
)
def test_poses_are_validated(field: str, values: tuple[Any, Any, Any]) -> None:
    with pytest.raises(ValueError, match=field):
        Trajectory(*values)


def test_pose_at_a_time_is_interpolated_and_unknown_outside() -> None:
    poses = Trajectory.of([(0, SE3.identity()), (10, SE3(np.eye(3), np.array([2.0, 4.0, 6.0])))])
    pose = poses.at(5)
    assert pose is not None
    assert pose.t.tolist() == [1.0, 2.0, 3.0]
    assert poses.at(11) is poses.at(-1) is Trajectory.of([]).at(0) is None
