# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all strategies share."""

import logging
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
import pytest

from tests.unit.viso.companion.vio.strategy_rig import (
    FEW,
    GOOD,
    INITIAL,
    LOST,
    PERIOD_NS,
    EventHandler,
    Ticks,
    WaxRig,
    make_frame,
    make_logger,
    make_output,
    make_warm_start,
    still_window,
)
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.health import FrameFacts
from viso.companion.vio.log import StrategyLog
from viso.companion.vio.result import Degraded, Initializing, Lost, Tracking
from viso.companion.vio.types import NavCameraFrame, VioOutput, VioState

SIZES = [(47, 64), (48, 65), (64, 48)]


def state_of(rig: WaxRig) -> VioState:
    return rig.strategy.health.snapshot().state


def lost(**config: Any) -> WaxRig:
    rig = WaxRig(lost_frames_fatal=1, **config)
    rig.strategy.run(0)
    rig.strategy.finds(LOST)
    assert isinstance(rig.strategy.run(1), Lost)
    rig.strategy.finds(INITIAL)
    return rig


def test_tracking_returns_the_output() -> None:
    rig = WaxRig()
    result = rig.strategy.run(0)
    assert isinstance(result, Tracking)
    assert np.array_equal(result.output.pose_covariance_6x6, make_output(make_frame(0)).pose_covariance_6x6)


def test_init_is_initializing() -> None:
    rig = WaxRig()
    rig.strategy.step = lambda frame: (GOOD, None)
    result = rig.strategy.run(0)
    assert isinstance(result, Initializing)
    assert (result.reason, result.is_warm) == ("waiting for stillness or a warm start", False)


def test_init_after_a_warm_start_is_warm() -> None:
    rig = WaxRig()
    rig.strategy.reset(make_warm_start())
    result = rig.strategy.run(0)
    assert isinstance(result, Tracking)
    rig.strategy.reset(make_warm_start())
    rig.strategy.finds(GOOD)
    result = rig.strategy.run(1)
    assert isinstance(result, Initializing)
    assert result.is_warm


def test_degraded_carries_the_inflated_output() -> None:
    rig = WaxRig(degraded_inflation=4.0)
    rig.strategy.run(0)
    rig.strategy.finds(FEW)
    result = rig.strategy.run(1)
    assert isinstance(result, Degraded)
    assert result.reason == "few_inliers"
    expected = 4.0 * make_output(make_frame(1)).pose_covariance_6x6
    assert np.array_equal(result.output.pose_covariance_6x6, expected)


def test_lost_frame_before_the_limit_is_degraded() -> None:
    rig = WaxRig()
    rig.strategy.run(0)
    rig.strategy.finds(LOST)
    result = rig.strategy.run(1)
    assert isinstance(result, Degraded)
    assert result.consecutive_lost == 1


def test_lost_stays_lost_until_a_warm_start() -> None:
    rig = lost()
    for sequence in (2, 3):
        result = rig.strategy.run(sequence)
        assert isinstance(result, Lost)
        assert result.reason == "too_few_inliers"
    rig.strategy.reset(make_warm_start())
    assert state_of(rig) is VioState.INIT


def test_lost_strategy_does_not_see_frames() -> None:
    rig = lost()
    rig.strategy.run(2)
    assert [sequence for sequence, _ in rig.strategy.seen] == [0, 1]


@pytest.mark.parametrize(("sequence", "starts_over"), [(10, False), (11, True)])
def test_auto_reinit_starts_over_when_due(sequence: int, starts_over: bool) -> None:
    rig = lost(auto_reinit_s=1.0)
    assert isinstance(rig.strategy.run(sequence), Tracking if starts_over else Lost)
    assert rig.strategy.calls == [None] * starts_over


def test_state_that_is_not_finite_is_lost_at_once() -> None:
    rig = WaxRig()
    rig.strategy.run(0)
    rig.strategy.step = lambda frame: (replace(GOOD, is_finite=False), None)
    assert rig.strategy.run(1).reason == "state not finite"
    health = rig.strategy.health.snapshot()
    assert (health.state, health.consecutive_lost) == (VioState.LOST, 1)


def test_first_state_that_is_not_finite_is_lost_at_once() -> None:
    rig = WaxRig()
    rig.strategy.step = lambda frame: (replace(INITIAL, is_finite=False), None)
    assert rig.strategy.run(0).reason == "state not finite as soon as there was one"
    assert state_of(rig) is VioState.LOST


def test_exception_of_a_library_ends_in_lost() -> None:
    def fail(frame: NavCameraFrame) -> NoReturn:
        raise np.linalg.LinAlgError("singular")

    rig = WaxRig()
    rig.strategy.step = fail
    result = rig.strategy.run(0)
    assert isinstance(result, Lost)
    assert result.reason == "LinAlgError: singular"
    (record,) = rig.log.events("vio_fatal")
    assert record.exc_info is not None


def test_frame_of_another_camera_is_fatal() -> None:
    rig = WaxRig()
    result = rig.strategy.process(make_frame(1, camera_id="other"), still_window(0, PERIOD_NS))
    assert isinstance(result, Lost)
    assert result.reason == "frame of camera 'other', strategy for 'cam'"


@pytest.mark.parametrize("size", SIZES)
def test_frame_of_another_size_is_fatal(size: tuple[int, int]) -> None:
    rig = WaxRig()
    frame = make_frame(1, size=size)
    result = rig.strategy.process(frame, still_window(0, PERIOD_NS))
    assert isinstance(result, Lost)
    assert result.reason == f"frame of {size[1]}x{size[0]} pixels, calibration of 64x48"


def test_second_caller_is_refused_and_the_state_left_alone() -> None:
    rig = WaxRig()
    rig.strategy.run(0)
    before = rig.strategy.health.snapshot()
    seen: list[object] = []

    def call_again(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput]:
        with pytest.raises(VioFatalError, match=r"^concurrent use of a strategy$"):
            rig.strategy.run(7)
        with pytest.raises(VioFatalError, match=r"^concurrent use of a strategy$"):
            rig.strategy.reset(make_warm_start())
        seen.append(rig.strategy.health.snapshot())
        return GOOD, make_output(frame)

    rig.strategy.step = call_again
    rig.strategy.run(1)
    assert seen == [before]


def test_caller_after_a_failure_is_not_refused() -> None:
    rig = WaxRig()
    for sequence in range(2):
        rig.strategy.step = lambda frame: (GOOD, None)
        assert isinstance(rig.strategy.run(sequence), Initializing)


def test_warm_start_reaches_the_strategy() -> None:
    rig = WaxRig()
    rig.strategy.reset(make_warm_start())
    assert len(rig.strategy.calls) == len(rig.log.events("warm_start_applied")) == 1


@pytest.mark.parametrize("field", ["velocity_b", "covariance", "body_T_world", "bias"])
def test_bad_warm_start_is_refused_and_the_state_left_alone(field: str) -> None:
    rig = WaxRig()
    rig.strategy.run(0)
    pose = make_warm_start()
    object.__setattr__(pose, field, np.full(3, np.nan))
    with pytest.raises(VioFatalError, match="bad warm start"):
        rig.strategy.reset(pose)
    assert state_of(rig) is VioState.TRACKING
    assert rig.strategy.calls == []


def test_warm_start_that_is_no_rotation_is_refused() -> None:
    rig = WaxRig()
    pose = make_warm_start()
    object.__setattr__(pose.body_T_world, "R", 1.1 * np.eye(3))
    with pytest.raises(VioFatalError, match="bad warm start: R: not orthonormal"):
        rig.strategy.reset(pose)


def test_transition_is_logged_once() -> None:
    rig = WaxRig()
    rig.strategy.run(0)
    rig.strategy.run(1)
    change = {"old": "INIT", "new": "TRACKING", "reason": "static initialisation"}
    assert rig.log.fields("state_change") == [change]


def test_result_has_ratio_resets_and_stages() -> None:
    rig = WaxRig()
    rig.strategy.finds(replace(INITIAL, innovation_ratio=1.5))
    rig.strategy.run(0)
    rig.strategy.reset(make_warm_start())
    result = rig.strategy.run(1)
    assert (result.innovation_ratio, result.resets, result.stage_ms) == (1.5, 1, {"step": 0.0, "total": 0.0})


def test_stages_of_one_name_add_up() -> None:
    rig = WaxRig()

    def step(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput]:
        for _ in range(2):
            with rig.strategy.stage("x"):
                rig.clock.now_ns += 3_000_000
        return INITIAL, make_output(frame)

    rig.strategy.step = step
    assert rig.strategy.run(0).stage_ms["x"] == pytest.approx(6.0)


def test_frame_is_logged_with_its_stages() -> None:
    rig = WaxRig()
    rig.strategy.run(0)
    (fields,) = rig.log.fields("frame")
    assert fields["ms"] == {"step": 0.0}


def test_degraded_frames_are_logged_as_a_warning() -> None:
    rig = WaxRig()
    rig.strategy.run(0)
    rig.strategy.finds(FEW)
    rig.strategy.run(1)
    assert [record.levelno for record in rig.log.events("vio_degraded")] == [logging.WARNING]


# The log

OUTPUT = make_output(make_frame(1))


class LogRig:
    def __init__(self, level: int = logging.DEBUG) -> None:
        logger, self.handler = make_logger(level)
        self.clock = Ticks()
        self.log = StrategyLog("klt_ransac", logger, self.clock)

    def only(self, event: str) -> tuple[int, str, dict[str, object]]:
        (record,) = self.handler.events(event)
        return record.levelno, record.getMessage(), self.handler.fields(event)[0]


def names(handler: EventHandler) -> list[str]:
    return [getattr(record, "event") for record in handler.records]  # noqa: B009 -- typed as having none


def test_state_change_is_info() -> None:
    rig = LogRig()
    rig.log.state_change(VioState.TRACKING, VioState.DEGRADED, "imu_gap", 0)
    fields = {"old": "TRACKING", "new": "DEGRADED", "reason": "imu_gap"}
    assert rig.only("state_change") == (logging.INFO, "TRACKING -> DEGRADED: imu_gap", fields)


def test_lost_is_an_error_too() -> None:
    rig = LogRig()
    rig.log.state_change(VioState.DEGRADED, VioState.LOST, "no_model", 9)
    fields = {"consecutive_lost": 9, "reason": "no_model"}
    text = "VIO LOST after 9 consecutive frames; strategy=klt_ransac"
    assert rig.only("vio_lost") == (logging.ERROR, text, fields)
    assert names(rig.handler) == ["state_change", "vio_lost"]


def test_warm_start_tells_where() -> None:
    rig = LogRig()
    pose = make_warm_start()
    rig.log.warm_start_applied(pose)
    level, _, fields = rig.only("warm_start_applied")
    assert level == logging.INFO
    assert fields["position_enu"] == pytest.approx(pose.body_T_world.inverse().t)


def test_degraded_tells_what_is_wrong() -> None:
    rig = LogRig()
    rig.log.degraded(OUTPUT, "low_coverage")
    level, text, fields = rig.only("vio_degraded")
    assert (level, text) == (logging.WARNING, "VIO degraded: low_coverage")
    assert fields == {
        "parallax": 4.5,
        "mre": 0.5,
        "bias_norm": OUTPUT.imu_bias.norm(),
        "reason": "low_coverage",
        "suppressed": 0,
    }


def test_degraded_at_most_once_a_second() -> None:
    rig = LogRig()
    for now_ns in (0, 333_000_000, 999_999_999, 1_000_000_000):
        rig.clock.now_ns = now_ns
        rig.log.degraded(OUTPUT, "low_coverage")
    assert [fields["suppressed"] for fields in rig.handler.fields("vio_degraded")] == [0, 2]


def test_frame_is_for_debugging() -> None:
    rig = LogRig()
    rig.log.frame(OUTPUT, {"track": 3.5})
    fields = {"tracked": 120, "new": 5, "keyframe": True, "ms": {"track": 3.5}}
    assert rig.only("frame") == (logging.DEBUG, "frame", fields)


def test_frame_costs_nothing_when_nobody_debugs() -> None:
    rig = LogRig(logging.INFO)
    rig.log.frame(OUTPUT, {})
    assert rig.handler.records == []


def test_each_event_names_the_strategy() -> None:
    rig = LogRig()
    rig.log.degraded(OUTPUT, "low_coverage")
    (record,) = rig.handler.events("vio_degraded")
    assert (record.__dict__["strategy"], record.__dict__["frame"]) == ("klt_ransac", OUTPUT.frame_id)
