# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What strategies with a front end share: how they begin, what they do with bad data, where their world is."""

import dataclasses
import uuid
from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.strategies.survey import (
    PERIOD_NS,
    Aboard,
    Recorded,
    aboard,
    begun,
    flown_survey,
    record,
    survey,
)
from tests.unit.viso.companion.world.from_ground import from_ground
from viso.companion.strategies.tracking import LEAST_VARIANCE_M2
from viso.companion.vio.config import AglSource, ImuNoise
from viso.companion.vio.imu import IMU_EMPTY, IMU_GAP
from viso.companion.vio.types import HeightMeasurement, ImuSample, NavCameraFrame, SensorEvent, VioState, WarmStartPose
from viso.companion.world.motion import nadir_survey
from viso.geometry.pose import SE3

QUIET = ImuNoise(gyro=2e-4, accel=2e-3)


@pytest.fixture(scope="module")
def on_the_ground() -> Recorded:
    return record(trajectory=from_ground(nadir_survey(5.0, 20.0, seed=1)), duration_s=2.0, imu_noise=QUIET)


@pytest.fixture(scope="module")
def flown() -> Aboard:
    return flown_survey()


def shifted(pose: WarmStartPose, by_m: Any) -> WarmStartPose:
    world_T_body = pose.body_T_world.inverse()
    return dataclasses.replace(pose, body_T_world=SE3(world_T_body.R, world_T_body.t + by_m).inverse())


class TestBeginning:
    """How a state comes to be."""

    @pytest.mark.slow
    def test_two_good_frames_after_a_warm_start_are_enough(self, flown: Aboard) -> None:
        assert [health.state for health in flown.healths[:4]] == [VioState.INIT] * 2 + [VioState.TRACKING] * 2
        assert [output is None for output in flown.outputs[:3]] == [True, True, False]

    @pytest.mark.slow
    def test_body_in_motion_waits(self) -> None:
        flying = Aboard(survey()).fly(15)
        assert {health.state for health in flying.healths} == {VioState.INIT}
        assert flying.outputs == [None] * len(flying.outputs)

    def test_body_at_rest_begins_after_half_a_second(self, on_the_ground: Recorded) -> None:
        standing = Aboard(on_the_ground).fly()
        first = next(index for index, output in enumerate(standing.outputs) if output is not None)
        assert 0.5 <= first * PERIOD_NS * 1e-9 <= 0.75
        assert {health.state for health in standing.healths[first:]} == {VioState.TRACKING}

    def test_body_at_rest_is_level_and_has_no_yaw(self, on_the_ground: Recorded) -> None:
        standing = Aboard(on_the_ground, agl_source=AglSource.NONE).fly()
        pose, truth = standing.last().world_T_body, on_the_ground.truth(0)
        assert pose.R[2] == pytest.approx(truth.R[2], abs=0.02)
        assert np.arctan2(pose.R[1, 0], pose.R[0, 0]) == pytest.approx(0, abs=0.01)
        assert pose.t == pytest.approx(np.zeros(3), abs=0.01)
        assert standing.last().imu_bias.gyro == pytest.approx([0.004, -0.006, 0.003], abs=1e-3)

    def test_body_at_rest_is_as_high_as_the_range_finder_says(self, on_the_ground: Recorded) -> None:
        def on_a_roof(event: SensorEvent) -> SensorEvent:
            return dataclasses.replace(event, height_m=12.5) if isinstance(event, HeightMeasurement) else event

        standing = Aboard(on_the_ground.changed(on_a_roof), ground_z_m=3.0).fly()
        assert standing.last().world_T_body.t[2] == pytest.approx(15.5, abs=0.1)

    def test_warm_start_is_where_it_was_said(self) -> None:
        start = survey().warm_start()
        began = Aboard(survey(), start).fly(3)
        assert np.linalg.norm(began.last().world_T_body.t - start.body_T_world.inverse().t) < 2.5
        first = Aboard(survey(), start)
        first.fly(1)
        state = first.strategy._estimator.state  # type: ignore[union-attr]  # it was started
        assert state.p == pytest.approx(np.zeros(3), abs=0.5)

    def test_warm_start_in_flight_counts_as_a_reset(self) -> None:
        flying = begun(3)
        before = flying.result.resets
        flying.start_again()
        flying.fly(8)
        assert [health.state for health in flying.healths[3:]] == [VioState.INIT] * 2 + [VioState.TRACKING] * 3
        assert (before, flying.result.resets) == (0, 1)
        assert flying.error_m() < 0.6


class TestWorld:
    """Where the world's origin is makes no difference."""

    @pytest.mark.slow
    @pytest.mark.parametrize("by_m", [(1e6, -2e6, 0.0), (0.0, 0.0, 800.0)])
    def test_poses_are_as_far_away_as_the_start(self, flown: Aboard, by_m: tuple[float, float, float]) -> None:
        far = Aboard(survey(), shifted(survey().warm_start(), by_m), ground_z_m=by_m[2]).fly(15).last()
        near = flown.outputs[14]
        assert near is not None
        assert far.world_T_body.t - by_m == pytest.approx(near.world_T_body.t, abs=1e-6)
        assert far.relative_pose_T.log() == pytest.approx(near.relative_pose_T.log(), abs=1e-9)
        assert far.pose_covariance_6x6 == pytest.approx(near.pose_covariance_6x6, rel=1e-6)


class TestOutputs:
    """What is told about a frame."""

    def test_numbers_are_those_of_the_front_end(self, flown: Aboard) -> None:
        quality = flown.last().feature_quality
        assert quality.tracked >= quality.inliers > 30
        assert quality.lost < quality.tracked
        assert 0 < quality.mre_px < 2
        assert quality.mean_parallax_px > 1
        assert quality.coverage > 0.5

    def test_place_is_never_certain_to_less_than_a_millimetre(self, flown: Aboard) -> None:
        for output in flown.outputs:
            if output is not None:
                smallest = np.linalg.eigvalsh(output.pose_covariance_6x6[3:, 3:])[0]
                assert smallest >= LEAST_VARIANCE_M2 * (1 - 1e-9)

    def test_velocity_is_the_bodys(self, flown: Aboard) -> None:
        t_ns = round((0.0017 + 0.2 * (len(flown.outputs) - 1)) * 1e9)
        truth = survey().truth(t_ns)
        assert flown.last().velocity_b == pytest.approx(truth.R.T @ survey().flight.truth_velocity_w(t_ns), abs=0.4)

    def test_stages_are_measured(self, flown: Aboard) -> None:
        assert set(flown.result.stage_ms) == {"grey", "propagate", "track", "filter", "total"}


class TestBadData:
    """Data that are missing, wrong or of another camera."""

    @staticmethod
    def without_imu(from_ns: int, to_ns: int) -> Recorded:
        def cut(event: SensorEvent) -> SensorEvent | None:
            return None if isinstance(event, ImuSample) and from_ns < event.t_ns < to_ns else event

        return survey().changed(cut)

    @pytest.mark.slow
    def test_gap_in_the_inertial_data_is_degraded_and_passes(self) -> None:
        flying = begun(20, self.without_imu(2_450_000_000, 2_500_000_000))
        assert flying.reasons().count(IMU_GAP) >= 1
        at = flying.reasons().index(IMU_GAP)
        assert flying.healths[at].state is VioState.DEGRADED
        assert flying.healths[at].consecutive_lost == 0
        assert flying.healths[-1].state is VioState.TRACKING

    @pytest.mark.slow
    def test_frame_without_inertial_data_is_lost_and_its_pose_uncertain(self) -> None:
        flying = begun(20, self.without_imu(2_195_000_000, 2_615_000_000))
        at = flying.reasons().index(IMU_EMPTY)
        assert flying.healths[at].consecutive_lost == 1
        lost, before = flying.outputs[at], flying.outputs[at - 2]
        assert lost is not None
        assert before is not None
        assert lost.pose_covariance_6x6.trace() > 4 * before.pose_covariance_6x6.trace()
        assert flying.healths[-1].state is VioState.TRACKING

    def test_heights_that_are_none_do_no_harm(self, flown: Aboard) -> None:
        flying = Aboard(survey(), survey().warm_start())
        for height_m, sigma_m in ((np.nan, 0.1), (-5.0, 0.1), (20.0, np.inf)):
            flying.strategy.add_height(0, height_m, sigma_m)
        unharmed = flown.outputs[4]
        flying.fly(5)
        assert unharmed is not None
        assert flying.last().world_T_body.t == pytest.approx(unharmed.world_T_body.t)

    @pytest.mark.slow
    def test_wrong_height_now_and_then_does_little_harm(self, flown: Aboard) -> None:
        def spike(event: SensorEvent) -> SensorEvent:
            if isinstance(event, HeightMeasurement) and event.t_ns // PERIOD_NS % 6 == 5:
                return dataclasses.replace(event, height_m=0.2)
            return event

        flying, unharmed = begun(20, survey().changed(spike)), flown.outputs[19]
        assert unharmed is not None
        assert flying.last().world_T_body.t == pytest.approx(unharmed.world_T_body.t, abs=0.5)

    @pytest.mark.slow
    def test_height_is_made_use_of(self, flown: Aboard) -> None:
        def higher(event: SensorEvent) -> SensorEvent:
            if isinstance(event, HeightMeasurement):
                return dataclasses.replace(event, height_m=event.height_m + 0.8)
            return event

        flying = aboard(survey().changed(higher))
        assert 0.4 < flying.last().world_T_body.t[2] - flown.last().world_T_body.t[2] < 0.9

    def test_height_is_left_alone_without_a_source(self, flown: Aboard) -> None:
        unaided = begun(3, agl_source=AglSource.NONE)
        assert len(unaided.strategy.heights._heights) == len(unaided.outputs)
        assert not flown.strategy.heights._heights

    @pytest.mark.parametrize("field", ["p", "v", "R", "cov"])
    def test_state_that_is_not_finite_is_fatal(self, field: str) -> None:
        flying = begun(3)
        assert flying.fatal == []
        estimator = flying.strategy._estimator
        assert estimator is not None
        getattr(estimator.state, field)[0] = np.nan
        frame = next(event for event in survey().events() if isinstance(event, NavCameraFrame))
        flying.see(dataclasses.replace(frame, frame_id=uuid.UUID(int=1), capture_timestamp=4 * PERIOD_NS))
        assert len(flying.fatal) == 1
        assert flying.healths[-1].state is VioState.LOST

    def test_another_camera_is_fatal(self) -> None:
        flying = Aboard(survey(), survey().warm_start())
        frame = next(event for event in survey().events() if isinstance(event, NavCameraFrame))
        flying.see(dataclasses.replace(frame, camera_id="other"))
        assert flying.fatal == ["frame of camera 'other', strategy for 'synthetic'"]


class TestCamera:
    """Cameras of other sizes, clocks and rates."""

    @pytest.mark.slow
    def test_large_pictures_are_worked_on_when_small(self) -> None:
        small = begun(20, working_width_px=160)
        assert small.healths[-1].state is VioState.TRACKING
        assert small.error_m() < 1.0

    @pytest.mark.slow
    def test_offset_of_the_cameras_clock_is_heeded(self) -> None:
        late = record(calibration=dataclasses.replace(survey().calibration, time_offset_s=-0.15), duration_s=4.0)
        flying = aboard(late)
        assert flying.error_m() < 0.8
