# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which message there is at what instant, from what the strategy said."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mav_handlers.covariance import pose_errors
from mav_handlers.wire.messages import ODOMETRY
from tests.unit.viso.companion.vio.strategy_rig import make_result
from viso.companion.odometry.source import OdometrySource
from viso.companion.vio.config import CovarianceEncoding, LocalAlignment, LostPolicy, OdometryConfig, VioConfig
from viso.companion.vio.types import ImuSample, VioOutput, VioState
from viso.geometry.pose import SE3
from viso.geometry.rotation import so3_exp

Make = Callable[..., Any]
AtRest = Callable[[int], ImuSample]

MS = 1_000_000
FRAME_MS = 300


class Rig:
    """A source fed frames 300 ms apart and, before each, an IMU at rest; time goes on with every frame."""

    def __init__(self, strategy: Any, at_rest: AtRest, config: VioConfig | None = None, **options: Any) -> None:
        self.strategy = strategy
        self.source = OdometrySource(config or VioConfig(), **{"world_is_north": True, **options})
        self._at_rest = at_rest
        self.now_ms = 0

    def wait(self, ms: int) -> None:
        """Let time pass, with inertial data every 10 ms."""
        for t_ms in range(self.now_ms + 10, self.now_ms + ms + 1, 10):
            self.source.take_imu(self._at_rest(t_ms * MS))
        self.now_ms += ms

    def say(
        self, state: VioState, output: VioOutput | None = None, is_warm: bool = False, innovation_ratio: float = 1.0
    ) -> None:
        """Go on to the next frame and hand over what the strategy makes of it."""
        self.wait(FRAME_MS)
        self.source.take_result(
            make_result(state, output, is_warm=is_warm, t_ns=self.now_ms * MS, innovation_ratio=innovation_ratio)
        )

    def track(self, *steps_m: float) -> None:
        """Move ahead by steps, tracking; one frame that stands still if there are none."""
        for step_m in steps_m or (0.0,):
            self.say(VioState.TRACKING, self.strategy.move(SE3(np.eye(3), np.array([step_m, 0.0, 0.0]))))

    def message(self, ms_later: int = 0) -> ODOMETRY | None:
        return self.source.message((self.now_ms + ms_later) * 1000)

    def sent(self, ms_later: int = 0) -> ODOMETRY:
        message = self.message(ms_later)
        assert message is not None
        return message


@pytest.fixture
def rig(strategy: Any, at_rest: AtRest) -> Rig:
    return Rig(strategy, at_rest)


def test_nothing_is_sent_before_the_first_output(rig: Rig) -> None:
    assert rig.message() is None
    rig.say(VioState.INIT)
    assert rig.message() is None


def test_pose_is_that_of_the_last_frame(rig: Rig) -> None:
    rig.track(0.0, 0.2, 0.3)
    message = rig.sent()
    assert (message.x, message.y, message.z) == pytest.approx((0.0, 0.5, 0.0), abs=1e-9)
    assert (message.time_usec, message.quality, message.reset_counter) == (900_000, 100, 0)


def test_state_goes_on_with_the_imu_between_frames(strategy: Any, at_rest: AtRest) -> None:
    rig = Rig(strategy, at_rest)
    rig.say(VioState.TRACKING, strategy.move(velocity_b=(2.0, 0.0, 0.0)))
    before = pose_errors(rig.sent().pose_covariance)
    rig.wait(100)
    message = rig.sent()
    assert message.y == pytest.approx(0.2, abs=1e-6)
    assert message.time_usec == 400_000
    assert pose_errors(message.pose_covariance) > before


def test_degraded_frame_is_sent_with_less_quality(rig: Rig) -> None:
    rig.track()
    rig.say(VioState.DEGRADED, rig.strategy.move())
    assert rig.sent().quality == 49


def test_innovation_ratio_lowers_the_quality(rig: Rig) -> None:
    rig.say(VioState.TRACKING, rig.strategy.move(), innovation_ratio=2.0)
    assert rig.sent().quality == 75


@pytest.mark.parametrize(("sigma_m", "quality"), [(19.0, 100), (21.0, 49)])
def test_position_that_is_hardly_known_is_sent_with_less_quality(rig: Rig, sigma_m: float, quality: int) -> None:
    rig.track(0.0)
    rig.strategy.pose_covariance = np.diag([1e-9] * 3 + [sigma_m**2] * 3)
    rig.track(0.0)
    assert rig.sent().quality == quality


def test_initialising_again_sends_nothing(rig: Rig) -> None:
    rig.track()
    rig.say(VioState.INIT)
    assert rig.message() is None


def test_lost_pose_stands_still_with_a_stamp_that_goes_on(rig: Rig) -> None:
    rig.say(VioState.TRACKING, rig.strategy.move(velocity_b=(2.0, 0.0, 0.0)))
    rig.say(VioState.LOST)
    last = rig.sent()
    rig.wait(500)
    message = rig.sent()
    assert message.quality == -1
    assert (message.x, message.y, message.z) == (last.x, last.y, last.z)
    assert message.time_usec == rig.now_ms * 1000


def test_lost_pose_is_sent_for_a_while_only(strategy: Any, at_rest: AtRest) -> None:
    rig = Rig(strategy, at_rest, VioConfig(odometry=OdometryConfig(lost_policy=LostPolicy(2.0))))
    rig.track()
    rig.say(VioState.LOST)
    rig.sent()
    assert rig.message(2000) is not None
    assert rig.message(2001) is None


def test_every_loss_is_sent_anew(rig: Rig) -> None:
    rig.track()
    for _ in range(2):
        rig.say(VioState.LOST)
        assert rig.sent().quality == -1
        assert rig.message(4000) is None
        rig.track()
        assert rig.sent().quality == 100


def test_loss_before_any_pose_sends_nothing(rig: Rig) -> None:
    rig.say(VioState.LOST)
    assert rig.message() is None


@pytest.mark.parametrize(("ms", "quality"), [(1000, 100), (1001, 49), (3000, 49), (3001, -1)])
def test_camera_that_says_nothing_more_degrades_and_loses_the_pose(rig: Rig, ms: int, quality: int) -> None:
    rig.track()
    assert rig.sent(ms).quality == quality


def test_dead_cameras_pose_falls_silent_at_last(rig: Rig) -> None:
    rig.track()
    assert rig.sent(3001).quality == -1
    assert rig.message(6002) is None


def test_first_start_leaves_the_reset_counter(rig: Rig) -> None:
    rig.say(VioState.INIT)
    rig.track()
    assert rig.sent().reset_counter == 0


def test_starting_again_counts_once_and_goes_on_where_it_was(rig: Rig) -> None:
    rig.track(0.0, 0.4)
    rig.say(VioState.LOST)
    for _ in range(3):
        rig.say(VioState.INIT)
    rig.strategy.restart(SE3.identity())
    rig.track(0.0, 0.3)
    message = rig.sent()
    assert message.reset_counter == 1
    assert message.y == pytest.approx(0.7, abs=1e-6)


def test_warm_start_in_flight_counts_once_and_takes_its_place_in_the_world(rig: Rig) -> None:
    rig.track(0.0, 0.4)
    rig.say(VioState.INIT, is_warm=True)
    rig.strategy.restart(SE3(np.eye(3), np.array([30.0, 0.0, 0.0])))
    rig.track()
    message = rig.sent()
    assert message.reset_counter == 1
    assert message.y == pytest.approx(30.0)
    rig.track(0.1)
    assert rig.sent().reset_counter == 1


@pytest.mark.parametrize("is_warm", [False, True])
def test_starting_again_keeps_the_uncertainty_that_had_grown(rig: Rig, is_warm: bool) -> None:
    rig.track()
    rig.wait(2000)
    grown = rig.sent().pose_covariance[0]
    rig.say(VioState.INIT, is_warm=is_warm)
    rig.strategy.restart(SE3.identity())
    rig.track()
    assert rig.sent().pose_covariance[0] > grown > 0.03


def test_correction_that_jumps_counts(rig: Rig) -> None:
    rig.track(0.0, 0.0)
    assert rig.sent().reset_counter == 0
    rig.track(1.0)
    assert rig.sent().reset_counter == 1


def test_correction_within_what_was_stated_does_not_count(rig: Rig) -> None:
    rig.strategy.pose_covariance = np.diag([1e-6] * 3 + [0.25] * 3)
    rig.track(0.0, 1.0)
    assert rig.sent().reset_counter == 0


@pytest.mark.parametrize(("closed_m", "resets"), [(0.4, 0), (0.6, 1)])
def test_loop_closure_that_jumps_counts_however_unsure_the_pose_was(rig: Rig, closed_m: float, resets: int) -> None:
    rig.strategy.pose_covariance = np.diag([1e-6] * 3 + [100.0] * 3)
    rig.track(0.0, 5.0)
    rig.strategy.change_mind(SE3(np.eye(3), np.array([0.0, closed_m, 0.0])))
    rig.track(0.0, 0.0)
    message = rig.sent()
    assert message.reset_counter == resets
    assert message.x == pytest.approx(closed_m if resets else closed_m * (1 - 0.9**2), abs=1e-6)


def test_output_that_went_astray_is_bridged_by_the_world(rig: Rig) -> None:
    rig.track(0.0, 0.2)
    rig.strategy.move(SE3(np.eye(3), np.array([0.1, 0.0, 0.0])))
    rig.track(0.1)
    message = rig.sent()
    assert message.y == pytest.approx(0.4)
    assert message.reset_counter == 0


def test_frame_not_later_than_the_last_is_refused_and_counted(rig: Rig) -> None:
    rig.track()
    rig.now_ms -= FRAME_MS
    rig.say(VioState.TRACKING, rig.strategy.move(SE3(np.eye(3), np.array([9.0, 0.0, 0.0]))))
    assert rig.sent().y == pytest.approx(0.0)
    assert rig.source.counters["frames_refused_not_later"] == 1


def test_inertial_sample_not_later_than_the_last_is_counted(rig: Rig, at_rest: AtRest) -> None:
    rig.source.take_imu(at_rest(5))
    rig.source.take_imu(at_rest(5))
    assert rig.source.counters == {"imu_refused_not_later": 1}


def test_frames_are_counted_by_what_became_of_them(rig: Rig) -> None:
    rig.say(VioState.INIT)
    rig.track(0.0, 0.0)
    rig.say(VioState.LOST)
    assert rig.source.counters == {"frames_init": 1, "frames": 2, "frames_lost": 1}


def test_north_is_waited_for(make_strategy: Make, at_rest: AtRest) -> None:
    yaws: dict[int, float] = {2 * FRAME_MS * MS: math.pi / 2}
    rig = Rig(make_strategy(), at_rest, world_is_north=False, local_alignment=LocalAlignment.NORTH, yaw_at=yaws.get)
    rig.track()
    assert rig.message() is None
    assert rig.source.counters == {"frames_waiting_for_north": 1}
    rig.track()
    assert rig.sent().q == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-9)
    assert rig.sent().reset_counter == 0


def test_first_heading_is_ahead(make_strategy: Make, at_rest: AtRest) -> None:
    start = SE3(so3_exp(np.array([0.0, 0.0, 2.0])), np.zeros(3))
    rig = Rig(make_strategy(world_T_body=start), at_rest, local_alignment=LocalAlignment.HEADING0)
    rig.track(0.0, 0.3)
    assert (rig.sent().x, rig.sent().y) == pytest.approx((0.3, 0.0), abs=1e-9)


def test_encoding_is_the_one_asked_for(make_strategy: Make, at_rest: AtRest) -> None:
    rig = Rig(
        make_strategy(),
        at_rest,
        VioConfig(odometry=OdometryConfig(covariance_encoding=CovarianceEncoding.ARDUPILOT_ERROR)),
    )
    rig.strategy.pose_covariance = np.diag([0.01] * 3 + [0.25] * 3)
    rig.track()
    pos_err, ang_err = pose_errors(rig.sent().pose_covariance)
    assert (float(pos_err), float(ang_err)) == pytest.approx((0.5, 0.1), rel=1e-6)


def test_unsound_covariance_leaves_the_last_pose(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.track(0.0, 0.2)
    monkeypatch.setattr("viso.companion.odometry.composer.sound_covariance", lambda _covariance: None)
    rig.track(0.2)
    assert rig.sent().y == pytest.approx(0.2, abs=1e-6)
    assert rig.source.counters["frames_refused_covariance"] == 1
