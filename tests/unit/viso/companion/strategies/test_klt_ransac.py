# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The baseline on short flights: its course, its health, its keyframes, and what it keeps."""

import dataclasses
import uuid

import numpy as np
import pytest

from tests.unit.viso.companion.strategies.survey import PERIOD_NS, Aboard, aboard, begun, flown_survey, record, survey
from tests.unit.viso.companion.world.from_ground import from_ground
from viso.companion.vio.config import AglSource, ImuNoise, Scene
from viso.companion.vio.health import SCALE_UNOBSERVED, TOO_FEW_INLIERS
from viso.companion.vio.types import ImuSample, SensorEvent, VioOutput, VioState
from viso.companion.world.motion import nadir_survey
from viso.geometry.pose import SE3

SIDEWAYS = np.array([0.0, 1.0, 0.0])


def as_bytes(output: VioOutput | None) -> bytes:
    if output is None:
        return b""
    arrays = (
        output.relative_pose_T.matrix(),
        output.pose_covariance_6x6,
        output.imu_bias.accel,
        output.imu_bias.gyro,
        output.velocity_b,
        output.world_T_body.matrix(),
    )
    return b"".join(array.tobytes() for array in arrays) + repr(output.feature_quality).encode()


@pytest.fixture(scope="module")
def flown() -> Aboard:
    return flown_survey()


@pytest.fixture(scope="module")
def covered() -> Aboard:
    """Return a flight with five dark frames, the first of them the twelfth."""
    return aboard(record(covered_s=((2.1, 3.1),), duration_s=5.0))


class TestCourse:
    """Where it thinks it is."""

    def test_plane_and_height_keep_it_on_course(self, flown: Aboard) -> None:
        assert flown.error_m() < 0.6

    @pytest.mark.slow
    def test_scene_nothing_is_known_of_keeps_it_on_course(self) -> None:
        general = begun(20, scene=Scene.GENERAL, agl_source=AglSource.NONE)
        assert general.error_m() < 2.5

    @pytest.mark.slow
    def test_scene_that_turns_out_to_be_a_plane_keeps_it_on_course(self) -> None:
        assert begun(20, scene=Scene.AUTO).error_m() < 1.5

    @pytest.mark.slow
    def test_same_input_gives_the_same_bytes(self, flown: Aboard) -> None:
        again = begun(15)
        assert [as_bytes(output) for output in again.outputs] == [as_bytes(output) for output in flown.outputs[:15]]
        assert again.healths == flown.healths[:15]


class TestHealth:
    """How it thinks it is."""

    def test_good_flight_is_tracking(self, flown: Aboard) -> None:
        assert [health.state for health in flown.healths] == [VioState.INIT] * 2 + [VioState.TRACKING] * 28

    @pytest.mark.slow
    def test_covered_lens_is_degraded_while_it_lasts(self, covered: Aboard) -> None:
        lost = [health.consecutive_lost for health in covered.healths]
        first = lost.index(1)
        # Five frames are dark, and the one after them has nothing to be compared with.
        assert lost[first : first + 7] == [1, 2, 3, 4, 5, 6, 0]
        assert covered.healths[first].reason == TOO_FEW_INLIERS
        assert covered.healths[-1].state is VioState.TRACKING
        assert covered.error_m() < 1.5

    @pytest.mark.slow
    def test_pose_grows_uncertain_while_nothing_is_seen(self, covered: Aboard) -> None:
        first = next(index for index, health in enumerate(covered.healths) if health.consecutive_lost)
        traces = [output.pose_covariance_6x6.trace() for output in covered.outputs[first : first + 6] if output]
        assert len(traces) == 6
        assert traces == sorted(traces)
        assert traces[-1] > 5 * traces[0]

    @pytest.mark.slow
    def test_lens_covered_for_too_long_is_lost(self) -> None:
        covered = aboard(record(covered_s=((2.1, 9.0),), duration_s=4.5), lost_frames_fatal=9)
        states = [health.state for health in covered.healths]
        assert states.index(VioState.LOST) == 11 + 8
        assert set(states[19:]) == {VioState.LOST}
        assert covered.outputs[19:] == [None] * len(covered.outputs[19:])
        assert len(covered.fatal) == len(covered.outputs[19:])

    def test_scale_that_nothing_fixes_is_degraded(self) -> None:
        unaided = begun(4, agl_source=AglSource.NONE)
        assert unaided.reasons()[3] == SCALE_UNOBSERVED
        assert unaided.healths[3].state is VioState.DEGRADED

    def test_degraded_pose_is_inflated(self) -> None:
        plain = begun(4, agl_source=AglSource.NONE, degraded_inflation=1.0)
        inflated = begun(4, agl_source=AglSource.NONE, degraded_inflation=4.0)
        assert inflated.healths[-1].state is VioState.DEGRADED
        assert np.allclose(inflated.last().pose_covariance_6x6, 4 * plain.last().pose_covariance_6x6)

    @pytest.mark.slow
    def test_inertial_data_that_contradict_the_pictures_show(self) -> None:
        """A body that is told it flies sideways: the tracks are refused, or their errors tell."""

        def pushed(event: SensorEvent) -> SensorEvent:
            if isinstance(event, ImuSample) and 3_000_000_000 < event.t_ns < 4_000_000_000:
                return ImuSample(event.t_ns, event.accel + 40.0 * SIDEWAYS, event.gyro)
            return event

        flying = begun(21, survey().changed(pushed))
        assert VioState.DEGRADED in {health.state for health in flying.healths[15:]}


class TestKeyframes:
    """What its poses refer to."""

    def outputs(self, flown: Aboard) -> list[VioOutput]:
        return [output for output in flown.outputs if output is not None]

    def test_poses_refer_to_the_last_keyframe(self, flown: Aboard) -> None:
        keyframe_id: uuid.UUID | None = None
        for output in self.outputs(flown):
            assert keyframe_id in (None, output.keyframe_id)
            keyframe_id = output.frame_id if output.is_keyframe else output.keyframe_id

    def test_relative_poses_add_up_to_the_motion(self, flown: Aboard) -> None:
        outputs = self.outputs(flown)
        places = {output.frame_id: output.world_T_body for output in outputs}
        for output in outputs[1:]:
            if output.keyframe_id in places:
                composed = places[output.keyframe_id] @ output.relative_pose_T
                # What is learnt with a frame moves the keyframe a little as well.
                assert composed.t == pytest.approx(output.world_T_body.t, abs=0.5)

    def test_moving_frames_become_keyframes_within_a_second(self, flown: Aboard) -> None:
        gaps = np.diff(
            [index for index, output in enumerate(flown.outputs) if output is not None and output.is_keyframe]
        )
        assert 1 <= gaps.max() <= 5

    @pytest.mark.slow
    def test_standing_still_makes_no_keyframes_and_keeps_no_poses(self) -> None:
        quiet = ImuNoise(gyro=2e-4, accel=2e-3)
        standing = record(trajectory=from_ground(nadir_survey(5.0, 20.0, seed=1)), duration_s=3.0, imu_noise=quiet)
        lengths: list[int] = []
        on_board = Aboard(standing)
        on_board.fly(each=lambda: lengths.append(_clones(on_board)))
        assert sum(output.is_keyframe for output in self.outputs(on_board)) == 1
        assert max(lengths) == lengths[-1] == 1
        assert np.linalg.norm(on_board.last().velocity_b) < 0.01


def _clones(on_board: Aboard) -> int:
    estimator = on_board.strategy._estimator
    return 0 if estimator is None else len(estimator.state.clones)


class TestWindow:
    """What it keeps."""

    @pytest.mark.slow
    @pytest.mark.parametrize("clones", [2, 6])
    def test_window_is_as_long_as_configured(self, clones: int) -> None:
        flying = Aboard(survey(), survey().warm_start(), window_clones=clones)
        lengths: list[int] = []
        flying.fly(15, each=lambda: lengths.append(_clones(flying)))
        assert max(lengths) == clones + 1  # and the one that the flight began with
        assert flying.error_m() < 1.0

    @pytest.mark.slow
    def test_fast_pictures_are_thinned(self) -> None:
        fast = record(duration_s=0.75, frame_rate_hz=60.0)
        flying = Aboard(fast, fast.warm_start())
        numbers: set[int] = set()
        flying.fly(each=lambda: numbers.update(_numbers(flying)))
        assert set(np.diff(sorted(numbers)).tolist()) == {5}  # frames in 80 ms
        assert {health.state for health in flying.healths[2:]} == {VioState.TRACKING}
        assert flying.error_m() < 0.5

    def test_slow_pictures_are_all_kept(self, flown: Aboard) -> None:
        assert _numbers(flown)[1:] == list(range(20, 31))
        assert _numbers(flown)[0] <= 3  # where the flight began


def _numbers(on_board: Aboard) -> list[int]:
    estimator = on_board.strategy._estimator
    return [] if estimator is None else [clone.number for clone in estimator.state.clones]


@pytest.mark.slow
def test_seen_from_a_camera_that_looks_ahead_it_works_as_well() -> None:
    """The mounting is the calibration's: the same flight with the camera tilted by 20 degrees."""
    straight = survey().calibration
    tilt = SE3.exp(np.array([np.radians(20.0), 0.0, 0.0, 0.0, 0.0, 0.0]))
    tilted = record(calibration=dataclasses.replace(straight, B_T_C=straight.B_T_C @ tilt), duration_s=4.0)
    assert aboard(tilted).error_m() < 1.0


def test_period_of_the_survey_is_the_one_assumed() -> None:
    frames = [event.capture_timestamp for event in survey().events() if hasattr(event, "capture_timestamp")]
    assert set(np.diff(frames).tolist()) == {PERIOD_NS}
