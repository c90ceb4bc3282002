# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trials: what goes into the strategy, and the measures of what comes out, for a strategy whose errors are known."""

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from tests.acceptance.trial import Trial, nees_per_dof, run_trial
from tests.unit.viso.companion.vio.strategy_rig import (
    FEW,
    GOOD,
    GRAVITY,
    IMU_PERIOD_NS,
    INITIAL,
    PERIOD_NS,
    Ticks,
    WaxStrategy,
    make_calibration,
    make_frame,
    make_output,
    make_warm_start,
)
from viso.companion.vio import runtime
from viso.companion.vio.config import AglSource, VioConfig
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.health import FrameFacts
from viso.companion.vio.pipeline import StrategyContext
from viso.companion.vio.result import Result
from viso.companion.vio.types import (
    CameraCalibration,
    HeightMeasurement,
    ImuSample,
    NavCameraFrame,
    SensorEvent,
    VioOutput,
    VioState,
    WarmStartPose,
)
from viso.geometry.errors import EvaluationError
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

FRAMES = 10
VELOCITY_W = np.array([3.0, 0.0, 0.0])
SIGMA_M = 0.1
COVARIANCE = np.diag([1e-6] * 3 + [SIGMA_M**2] * 3)
NO_HEIGHT = VioConfig(agl_source=AglSource.NONE)

Step = Callable[[NavCameraFrame], tuple[FrameFacts, VioOutput | None]]


@dataclass(frozen=True)
class Line:
    """A flight along x at 3 m/s; a frame each 100 ms, from the second 1 on."""

    truth_until_ns: int = 1 << 60
    heights: tuple[HeightMeasurement, ...] = ()
    calibration: CameraCalibration = field(default_factory=make_calibration)

    def events(self) -> Iterator[SensorEvent]:
        yield from self.heights
        sample_ns = 0
        for sequence in range(10, 10 + FRAMES):
            frame = make_frame(sequence)
            while sample_ns <= frame.capture_timestamp:
                yield ImuSample(sample_ns, GRAVITY, np.zeros(3))
                sample_ns += IMU_PERIOD_NS
            yield frame

    def truth(self, t_ns: int) -> SE3 | None:
        return place(t_ns) if t_ns <= self.truth_until_ns else None


def place(t_ns: int, error: Any = (0.0, 0.0, 0.0)) -> SE3:
    return SE3(np.eye(3), VELOCITY_W * t_ns * 1e-9 + np.array(error))


def told(frame: NavCameraFrame, before: NavCameraFrame | None, error: Array, **changed: Any) -> VioOutput:
    """Return the output for a frame whose keyframe is the one before, and the pose relative to it is wrong."""
    t_ns = frame.capture_timestamp
    keyframe = before or frame
    relative = SE3(
        np.eye(3), VELOCITY_W * (t_ns - keyframe.capture_timestamp) * 1e-9 + (0 if before is None else error)
    )
    fields: dict[str, Any] = {
        "keyframe_id": keyframe.frame_id,
        "relative_pose_T": relative,
        "pose_covariance_6x6": COVARIANCE,
        "world_T_body": place(t_ns),
        "velocity_b": VELOCITY_W,
    }
    return make_output(frame, **(fields | changed))


class Script:
    """Makes the strategy's outputs: the first frame initialises it, all others refer to the frame before.

    Args:
        error: of each relative position in m.
        changed: fields of the outputs by the number of the frame.
        facts: by the number of the frame.
    """

    def __init__(
        self,
        error: Any = (0.0, 0.0, 0.0),
        changed: Callable[[int], dict[str, Any]] = lambda index: {},
        facts: Callable[[int], FrameFacts] = lambda index: GOOD,
    ) -> None:
        self._error, self._changed, self._facts = np.array(error), changed, facts
        self._before: NavCameraFrame | None = None

    def __call__(self, frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput | None]:
        before, self._before = self._before, frame
        index = frame.sequence - 10
        output = told(frame, before, self._error, **self._changed(index))
        return (INITIAL if before is None else self._facts(index)), output


class Rig:
    """Trials with strategies of wax.

    Attributes:
        strategies: that were built.
        make_script: gives each its own script.
    """

    def __init__(self) -> None:
        self.strategies: list[WaxStrategy] = []
        self.kind: type[WaxStrategy] = WaxStrategy
        self.make_script: Callable[[], Step] = Script

    def build(self, config: VioConfig, calibration: CameraCalibration, *rest: Any) -> WaxStrategy:
        strategy = self.kind(StrategyContext(config, calibration, *rest))
        strategy.step = self.make_script()
        self.strategies.append(strategy)
        return strategy

    def run(self, source: Line | None = None, **options: Any) -> Trial:
        source = source or Line()
        return run_trial(source, options.pop("config", VioConfig()), truth=source.truth, **options)


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    rig = Rig()
    monkeypatch.setattr(runtime, "build_vio_strategy", rig.build)
    return rig


def test_each_frame_is_there_with_its_truth(rig: Rig) -> None:
    result = rig.run()
    assert [frame.result.sequence for frame in result.frames] == list(range(10, 10 + FRAMES))
    truths = [frame.truth.t.tolist() for frame in result.frames if frame.truth is not None]
    assert truths == [place(frame.result.t_ns).t.tolist() for frame in result.frames]


def test_windows_reach_from_frame_to_frame(rig: Rig) -> None:
    rig.run()
    for sequence, window in rig.strategies[0].seen[1:]:
        assert (window.start_t_ns, window.end_t_ns) == ((sequence - 1) * PERIOD_NS, sequence * PERIOD_NS)
        assert window.samples[-1].t_ns == window.end_t_ns


def test_time_is_that_of_the_newest_data(rig: Rig) -> None:
    times: list[int] = []

    def step(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput]:
        times.append(rig.strategies[0].context.clock_ns())
        return INITIAL, make_output(frame)

    rig.make_script = lambda: step
    rig.run()
    assert times == [sequence * PERIOD_NS for sequence in range(10, 10 + FRAMES)]


def test_stages_are_measured_by_the_clock_that_is_given(rig: Rig) -> None:
    clock = Ticks()

    def step(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput]:
        clock.now_ns += 7_000_000
        return INITIAL, make_output(frame)

    rig.make_script = lambda: step
    result = rig.run(clock_ns=clock)
    assert {frame.result.stage_ms["total"] for frame in result.frames} == {7.0}


def test_warm_start_comes_before_the_first_frame(rig: Rig) -> None:
    pose = make_warm_start()
    rig.run(warm_start=pose)
    (called,) = rig.strategies[0].calls
    assert isinstance(called, WarmStartPose)
    assert called.velocity_b.tolist() == pose.velocity_b.tolist()


def test_heights_go_to_a_strategy_that_takes_them(rig: Rig) -> None:
    heights: list[tuple[int, float, float]] = []

    class Measured(WaxStrategy):
        def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
            heights.append((t_ns, height_m, sigma_m))

    rig.kind = Measured
    rig.run(Line(heights=(HeightMeasurement(5, 40.0, 0.3), HeightMeasurement(6, 41.0, 0.3))))
    assert heights == [(5, 40.0, 0.3), (6, 41.0, 0.3)]


def test_heights_do_no_harm_to_a_strategy_that_does_not_take_them(rig: Rig) -> None:
    assert len(rig.run(Line(heights=(HeightMeasurement(5, 40.0, 0.3),))).frames) == FRAMES


def test_listeners_get_each_result(rig: Rig) -> None:
    results: list[Result] = []
    result = rig.run(listeners=[results.append])
    assert results == [frame.result for frame in result.frames]


def test_same_data_give_the_same_trial(rig: Rig) -> None:
    rig.make_script = lambda: Script((0.01, 0.02, 0.0))
    first, second = rig.run(), rig.run()
    assert first.horizontal_nees() == second.horizontal_nees()
    assert first.estimate().positions.tolist() == second.estimate().positions.tolist()


def test_frames_before_the_first_output_have_none(rig: Rig) -> None:
    def step(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput | None]:
        return (GOOD, None) if frame.sequence < 13 else (INITIAL, make_output(frame))

    rig.make_script = lambda: step
    result = rig.run()
    assert [frame.result.output is None for frame in result.frames] == [True] * 3 + [False] * (FRAMES - 3)
    assert result.states() == {VioState.INIT: 3, VioState.TRACKING: FRAMES - 3}
    assert result.frames[0].local is None
    assert len(result.estimate()) == FRAMES - 3


def test_frames_that_a_lost_strategy_does_not_get_are_left_out(rig: Rig) -> None:
    def step(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput]:
        if frame.sequence == 15:
            raise VioFatalError("broken")
        return INITIAL, make_output(frame)

    rig.make_script = lambda: step
    result = rig.run()
    assert result.states() == {VioState.TRACKING: 5, VioState.LOST: 1}


def test_position_errors_are_in_the_world(rig: Rig) -> None:
    error = np.array([0.5, -1.0, 2.0])
    rig.make_script = lambda: Script(
        changed=lambda index: {"world_T_body": place((10 + index) * PERIOD_NS, error * index)}
    )
    assert rig.run().position_errors() == pytest.approx(np.outer(np.arange(FRAMES), error))


def test_drift_is_the_last_horizontal_error_by_the_path(rig: Rig) -> None:
    def changed(index: int) -> dict[str, Any]:
        error = (0.03, 0.04, 5.0) if index == FRAMES - 1 else (1.0, 1.0, 1.0)
        return {"world_T_body": place((10 + index) * PERIOD_NS, error)}

    rig.make_script = lambda: Script(changed=changed)
    path_m = 3.0 * (FRAMES - 1) * PERIOD_NS * 1e-9
    assert rig.run().drift_share() == pytest.approx(0.05 / path_m)


def test_absolute_error_is_after_alignment(rig: Rig) -> None:
    def changed(index: int) -> dict[str, Any]:
        return {"world_T_body": SE3(np.eye(3), np.array([0.0, 0.3 * index + (index % 2) * 0.1, 0.0]))}

    rig.make_script = lambda: Script(changed=changed)
    error = rig.run().absolute_error()
    assert error.count == FRAMES
    assert error.rmse_m == pytest.approx(0.05, rel=0.1)


def test_relative_nees_is_that_of_the_error_by_the_covariance(rig: Rig) -> None:
    rig.make_script = lambda: Script((2 * SIGMA_M, SIGMA_M, 0.0))
    assert rig.run().relative_nees() == pytest.approx((4 + 1) / 6)


def test_relative_nees_is_of_tracking_frames(rig: Rig) -> None:
    rig.make_script = lambda: Script((SIGMA_M, 0.0, 0.0), facts=lambda index: FEW if index >= 4 else GOOD)
    result = rig.run()
    assert result.states()[VioState.DEGRADED] == FRAMES - 4
    assert result.relative_nees() == pytest.approx(1 / 6)  # with the inflated ones it would be less


def test_horizontal_nees_compares_what_was_composed(rig: Rig) -> None:
    rig.make_script = lambda: Script((SIGMA_M, SIGMA_M, 0.0))
    steps = np.arange(1, FRAMES)
    # After n steps the error is n sigma, and the variance that of n + 1 outputs, as the first one has one as well.
    expected = np.mean(steps**2 / (steps + 1))
    assert rig.run(config=NO_HEIGHT).horizontal_nees() == pytest.approx(expected, rel=1e-2)


def test_horizontal_nees_admits_an_error_of_the_scale_where_there_is_a_height(rig: Rig) -> None:
    rig.make_script = lambda: Script((SIGMA_M, 0.0, 0.0))
    without = rig.run(config=NO_HEIGHT).horizontal_nees()
    admitted = VioConfig(agl_source=AglSource.RANGEFINDER, agl_scale_sigma=0.5)
    assert rig.run(config=admitted).horizontal_nees() < 0.7 * without


def test_composed_pose_begins_at_the_first_output(rig: Rig) -> None:
    result = rig.run()
    places = [frame.local.L_T_B.t for frame in result.frames if frame.local is not None]
    expected = np.outer(np.arange(FRAMES) * PERIOD_NS * 1e-9, VELOCITY_W)
    assert np.array(places) == pytest.approx(expected)


def test_frames_without_truth_are_left_out(rig: Rig) -> None:
    rig.make_script = lambda: Script(
        changed=lambda index: {"world_T_body": place((10 + index) * PERIOD_NS, (0.0, 1.0, 0.0))}
    )
    result = rig.run(Line(truth_until_ns=14 * PERIOD_NS))
    assert len(result.frames) == FRAMES
    assert len(result.truth()) == 5
    assert len(result.position_errors()) == 5


@pytest.mark.parametrize("measure", [Trial.drift_share, Trial.relative_nees, Trial.horizontal_nees])
def test_measure_without_truth_says_so(rig: Rig, measure: Callable[[Trial], float]) -> None:
    result = rig.run(Line(truth_until_ns=0))
    with pytest.raises(EvaluationError, match=r"^no "):
        measure(result)


def test_record_cannot_be_changed(rig: Rig) -> None:
    result = rig.run()
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.frames = ()  # type: ignore[misc]  # it is frozen


def test_honest_covariances_give_a_nees_of_1() -> None:
    rng = np.random.default_rng(0)
    mixing = rng.normal(0, 1, (2000, 3, 3))
    errors = np.einsum("nij,nj->ni", mixing, rng.standard_normal((2000, 3)))
    covariances = mixing @ mixing.transpose(0, 2, 1)
    assert nees_per_dof(errors, covariances) == pytest.approx(1, abs=0.05)
    assert nees_per_dof(3 * errors, covariances) == pytest.approx(9, abs=0.45)
