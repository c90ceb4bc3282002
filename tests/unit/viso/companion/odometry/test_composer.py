# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses in one local frame from poses relative to keyframes."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from viso.companion.odometry.composer import LocalPose, OdometryComposer, local_to_frd
from viso.companion.vio.config import LocalAlignment
from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.companion.vio.types import VioOutput
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp, yaw_of

Make = Callable[..., Any]


def turn(*rotation_vector: float) -> Array:
    return so3_exp(np.array(rotation_vector))


def ahead(metres: float = 1.0) -> SE3:
    return SE3(np.eye(3), np.array([metres, 0.0, 0.0]))


def some_steps(count: int, seed: int = 0) -> list[SE3]:
    random = np.random.default_rng(seed)
    return [SE3(so3_exp(random.normal(0, 0.2, 3)), random.normal(0, 1, 3)) for _ in range(count)]


def composed(composer: OdometryComposer, output: VioOutput) -> LocalPose:
    if not composer.knows(output.keyframe_id):
        assert composer.anchor(output)
    pose = composer.compose(output)
    assert pose is not None
    return pose


def north() -> OdometryComposer:
    return OdometryComposer(world_is_north=True, agl_scale_sigma=0.0)


def test_poses_are_those_of_the_world_from_the_first_pose_on(make_strategy: Make) -> None:
    start = SE3(turn(0.1, -0.2, 2.0), np.array([5.0, -3.0, 40.0]))
    strategy, composer = make_strategy(world_T_body=start), north()
    for number, step in enumerate([SE3.identity(), *some_steps(12)]):
        pose = composed(composer, strategy.move(step, is_keyframe=number % 3 == 2))
        assert pose.L_T_B.t == pytest.approx(strategy.world_T_body.t - start.t, abs=1e-9)
        np.testing.assert_allclose(pose.L_T_B.R, strategy.world_T_body.R, atol=1e-9)


def test_origin_is_the_first_pose_even_if_that_is_no_keyframe(strategy: Any) -> None:
    pose = composed(north(), strategy.move(ahead(3.0), is_keyframe=False))
    assert pose.L_T_B.t == pytest.approx(np.zeros(3), abs=1e-12)


def test_heading0_points_x_along_the_first_heading_and_keeps_the_vertical(make_strategy: Make) -> None:
    lean = turn(0.1, 0.0, 0.0)
    strategy = make_strategy(world_T_body=SE3(turn(0.0, 0.0, 2.5).dot(lean), np.zeros(3)))
    composer = OdometryComposer(LocalAlignment.HEADING0, world_is_north=True)
    pose = composed(composer, strategy.move())
    assert yaw_of(pose.L_T_B.R) == pytest.approx(0.0, abs=1e-12)
    assert pose.L_T_B.R[2] == pytest.approx(strategy.world_T_body.R[2], abs=1e-12)
    assert composed(composer, strategy.move(ahead(7.0))).L_T_B.t == pytest.approx([7.0, 0.0, 0.0], abs=1e-9)


def test_north_turns_a_local_world_by_the_autopilots_yaw(make_strategy: Make) -> None:
    strategy = make_strategy(world_T_body=SE3(turn(0.0, 0.0, 0.7), np.zeros(3)))
    composer = OdometryComposer()
    assert composer.anchor(output := strategy.move(), body_yaw_rad=math.pi / 2)
    assert composer.alignment is LocalAlignment.NORTH
    assert yaw_of(composed(composer, output).L_T_B.R) == pytest.approx(math.pi / 2)
    assert composed(composer, strategy.move(ahead(4.0))).L_T_B.t == pytest.approx([0.0, 4.0, 0.0], abs=1e-9)


def test_north_waits_until_north_is_known(strategy: Any) -> None:
    composer = OdometryComposer(LocalAlignment.NORTH)
    assert not composer.anchor(strategy.move())
    assert composer.compose(strategy.move()) is None
    assert composer.anchor(strategy.move(), body_yaw_rad=0.3)


def test_without_a_choice_the_first_heading_serves_when_north_is_not_known(strategy: Any) -> None:
    composer = OdometryComposer()
    assert composer.anchor(strategy.move())
    assert composer.alignment is LocalAlignment.HEADING0


def test_alignments_name_the_axes_of_the_message() -> None:
    assert local_to_frd(LocalAlignment.NORTH) is ENU_TO_NED
    assert local_to_frd(LocalAlignment.HEADING0) is FLU_TO_FRD


def test_unknown_keyframe_gives_nothing(make_strategy: Make) -> None:
    strategy, composer = make_strategy(), north()
    composed(composer, strategy.move())
    strategy.move()  # its output went astray
    output = strategy.move()
    assert not composer.knows(output.keyframe_id)
    assert composer.compose(output) is None


def covariances(count: int, seed: int = 1) -> list[Array]:
    random = np.random.default_rng(seed)
    roots = [random.normal(0, 1e-3, (6, 6)) for _ in range(count)]
    return [root.dot(root.T) for root in roots]


def test_covariance_over_keyframes_is_that_of_the_errors_of_all_steps(make_strategy: Make) -> None:
    """The errors of the steps are independent; their Jacobians are taken by differences of the whole product."""
    steps, covs = some_steps(8), covariances(8)
    strategy, composer = make_strategy(), north()
    for step, cov in zip(steps, covs, strict=True):
        strategy.pose_covariance = cov
        pose = composed(composer, strategy.move(step))

    def product(number: int, error: Array) -> SE3:
        chain = SE3.identity()
        for index, step in enumerate(steps):
            chain = chain @ step @ (SE3.exp(error) if index == number else SE3.identity())
        return chain

    back, h = product(-1, np.zeros(6)).inverse(), 1e-5
    expected = np.zeros((6, 6))
    for number, cov in enumerate(covs):
        columns = [
            ((back @ product(number, e)).log() - (back @ product(number, -e)).log()) / (2 * h) for e in h * np.eye(6)
        ]
        jacobian = np.array(columns).T
        expected += jacobian.dot(cov).dot(jacobian.T)
    assert pose.covariance_6x6 == pytest.approx(expected, rel=1e-6, abs=1e-11)


def test_frame_that_is_no_keyframe_does_not_advance_the_covariance(strategy: Any) -> None:
    composer = north()
    composed(composer, strategy.move())
    first = composed(composer, strategy.move(is_keyframe=False)).covariance_6x6
    for _ in range(5):
        composed(composer, strategy.move(is_keyframe=False))
    assert composed(composer, strategy.move(is_keyframe=False)).covariance_6x6 == pytest.approx(first, rel=1e-12)


def test_covariance_is_never_below_that_of_the_output(make_strategy: Make) -> None:
    strategy, composer = make_strategy(), OdometryComposer(world_is_north=True)
    for step, cov in zip(some_steps(10), covariances(10), strict=True):
        strategy.pose_covariance = cov
        difference = composed(composer, strategy.move(step)).covariance_6x6 - cov
        assert np.linalg.eigvalsh(difference)[0] > -1e-15


def stated_ahead_m2(strategy: Any, scale_sigma: float, steps: int) -> float:
    """Return the variance along the body's x after steps of 2 m ahead, each a quarter turn from north."""
    composer = OdometryComposer(world_is_north=True, agl_scale_sigma=scale_sigma)
    pose = composed(composer, strategy.move())
    for _ in range(steps):
        pose = composed(composer, strategy.move(ahead(2.0)))
    return float(pose.covariance_6x6[3, 3])


def test_scale_error_grows_with_the_whole_displacement(make_strategy: Make) -> None:
    start = SE3(turn(0.0, 0.0, math.pi / 2), np.zeros(3))
    added = stated_ahead_m2(make_strategy(world_T_body=start), 0.03, 10) - stated_ahead_m2(
        make_strategy(world_T_body=start), 0.0, 10
    )
    assert added == pytest.approx((0.03 * 20.0) ** 2)


def test_scale_error_is_gone_when_back_at_the_origin(make_strategy: Make) -> None:
    composer, strategy = OdometryComposer(world_is_north=True, agl_scale_sigma=0.03), make_strategy()
    plain, same = north(), make_strategy()
    for step in (SE3.identity(), ahead(50.0), ahead(-50.0)):
        with_scale, without = composed(composer, strategy.move(step)), composed(plain, same.move(step))
    assert with_scale.covariance_6x6 == pytest.approx(without.covariance_6x6, rel=1e-9)


def test_scale_error_lies_along_the_displacement(make_strategy: Make) -> None:
    composer, strategy = OdometryComposer(world_is_north=True, agl_scale_sigma=0.1), make_strategy()
    strategy.pose_covariance = np.zeros((6, 6))
    composed(composer, strategy.move())
    pose = composed(composer, strategy.move(SE3(turn(0.0, 0.0, math.pi / 2), np.array([10.0, 0.0, 0.0]))))
    # East is to the right of a body that now looks north.
    assert np.diag(pose.covariance_6x6) == pytest.approx([0, 0, 0, 0, 1.0, 0], abs=1e-12)


def test_restart_goes_on_from_a_given_pose_and_covariance(make_strategy: Make) -> None:
    strategy, composer = make_strategy(), north()
    composed(composer, strategy.move())
    strategy.restart(SE3.identity())
    given = LocalPose(SE3(turn(0.0, 0.1, 1.0), np.array([7.0, 8.0, 9.0])), np.diag([1e-3] * 3 + [0.2] * 3))
    output = strategy.move(ahead(0.3))
    composer.restart(output, given)
    pose = composed(composer, output)
    assert pose.L_T_B.t == pytest.approx(given.L_T_B.t, abs=1e-9)
    np.testing.assert_allclose(pose.L_T_B.R, given.L_T_B.R, atol=1e-9)
    assert pose.covariance_6x6 == pytest.approx(given.covariance_6x6 + strategy.pose_covariance, abs=1e-9)


def test_world_pose_has_a_place_after_the_keyframes_are_gone(make_strategy: Make) -> None:
    start = SE3(turn(0.0, 0.0, 2.0), np.array([100.0, 50.0, 3.0]))
    strategy, composer = make_strategy(world_T_body=start), OdometryComposer(LocalAlignment.HEADING0)
    before = composed(composer, strategy.move())
    strategy.restart(strategy.world_T_body @ ahead(5.0))
    place = composer.place_in_world(strategy.move())
    assert place.t == pytest.approx((before.L_T_B @ ahead(5.0)).t, abs=1e-9)


def test_vertical_follows_the_strategys_world(make_strategy: Make) -> None:
    """A filter turns all it knows by a tilt that it has learnt: relative poses do not show it, the vertical does."""
    strategy, composer = make_strategy(), north()
    composed(composer, strategy.move())
    assert composer.up == pytest.approx([0.0, 0.0, 1.0])
    strategy.world_T_body = strategy.world_T_keyframe = SE3(turn(0.02, 0.0, 0.0), np.zeros(3))
    composed(composer, strategy.move())
    assert composer.up == pytest.approx(turn(-0.02, 0.0, 0.0)[:, 2])


def test_rotations_stay_orthonormal_over_many_rough_keyframes(make_strategy: Make) -> None:
    rough = SE3(turn(0.02, 0.01, 0.1) * (1 + 4e-7), np.array([0.1, 0.0, 0.0]))
    strategy, composer = make_strategy(), north()
    world = strategy.world_T_body
    for _ in range(300):
        strategy.world_T_body = strategy.world_T_keyframe = world  # the composer's chain alone grows
        pose = composed(composer, strategy.move(rough))
    assert pose.L_T_B.R.dot(pose.L_T_B.R.T) == pytest.approx(np.eye(3), abs=1e-12)


def test_unsound_sum_gives_nothing(strategy: Any) -> None:
    composer = north()
    output = strategy.move()
    composer.restart(output, LocalPose(SE3.identity(), -np.eye(6)))
    assert composer.compose(output) is None


class TestRefinement:
    """A strategy takes a keyframe to be elsewhere than it said."""

    def moved(self, strategy: Any, motion: SE3, *, is_keyframe: bool = False) -> tuple[OdometryComposer, list[float]]:
        """Return a composer, and how far its poses are from the strategy's, from the output that tells on."""
        composer = north()
        composed(composer, strategy.move())
        composed(composer, strategy.move(ahead(5.0)))
        strategy.change_mind(motion)
        poses = [composed(composer, strategy.move(ahead(0.1), is_keyframe=is_keyframe)) for _ in range(31)]
        end = strategy.world_T_body
        distances = [
            float(np.linalg.norm(pose.L_T_B.t - (end @ ahead(0.1 * n - 3.0)).t)) for n, pose in enumerate(poses)
        ]
        return composer, distances

    @pytest.mark.parametrize("is_keyframe", [False, True])
    def test_small_one_is_blended(self, strategy: Any, is_keyframe: bool) -> None:
        composer, distances = self.moved(strategy, SE3(np.eye(3), np.array([0.0, 0.4, 0.0])), is_keyframe=is_keyframe)
        assert distances == pytest.approx([0.4 * 0.9 ** (n + 1) for n in range(31)], abs=1e-9)
        assert composer.jumps == 0

    @pytest.mark.parametrize(
        "motion", [SE3(np.eye(3), np.array([0.0, 0.6, 0.0])), SE3(turn(0.0, 0.0, 0.11), np.zeros(3))]
    )
    def test_large_one_is_taken_at_once(self, strategy: Any, motion: SE3) -> None:
        composer = north()
        composed(composer, strategy.move())
        strategy.change_mind(motion)
        pose = composed(composer, strategy.move(ahead(5.0)))
        assert pose.L_T_B.t == pytest.approx(strategy.world_T_body.t)
        np.testing.assert_allclose(pose.L_T_B.R, strategy.world_T_body.R, atol=1e-9)
        composed(composer, strategy.move())
        assert composer.jumps == 1

    def test_turned_one_is_blended_along_the_way(self, strategy: Any) -> None:
        motion = SE3(turn(0.0, 0.0, 0.05), np.zeros(3))
        assert self.moved(strategy, motion, is_keyframe=True)[1][-1] < 0.02

    def test_later_one_replaces_what_is_left(self, strategy: Any) -> None:
        composer = north()
        composed(composer, strategy.move())
        for way_m in (0.3, -0.3):
            strategy.change_mind(ahead(way_m))
            pose = composed(composer, strategy.move())
        assert pose.L_T_B.t[0] == pytest.approx(0.3 * 0.1 * 0.9)

    def test_restart_forgets_what_is_left(self, strategy: Any) -> None:
        composer = north()
        composed(composer, strategy.move())
        strategy.change_mind(ahead(0.4))
        composed(composer, strategy.move())
        given = LocalPose(ahead(9.0), np.zeros((6, 6)))
        composer.restart(output := strategy.move(), given)
        assert composed(composer, output).L_T_B.t == pytest.approx([9.0, 0.0, 0.0])


def test_covariance_of_all_since_the_start_counts_for_more_than_the_links(make_strategy: Make) -> None:
    strategy, composer = make_strategy(world_T_body=SE3.identity()), north()
    composed(composer, strategy.move(SE3.identity()))
    whole = np.diag([1e-4] * 3 + [0.25] * 3)
    pose = composed(composer, dataclasses.replace(strategy.move(ahead()), start_covariance_6x6=whole))
    np.testing.assert_allclose(pose.covariance_6x6, whole, atol=1e-12)
