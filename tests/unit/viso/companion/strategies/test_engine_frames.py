# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strategy whose engine answers: what goes in, what comes out, and what each answer becomes."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NoReturn

import numpy as np
import pytest

from tests.unit.viso.companion.strategies.fake_engine import install
from tests.unit.viso.companion.vio.strategy_rig import (
    PERIOD_NS,
    WaxRig,
    make_frame,
    make_warm_start,
    output_of,
    still_window,
)
from viso.companion.engine.protocol import Capability, Status
from viso.companion.strategies.engine import EngineStrategy
from viso.companion.vio.config import EngineConfig
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.health import SCALE_UNOBSERVED, UNSURE_VELOCITY
from viso.companion.vio.imu import IMU_EMPTY, IMU_GAP
from viso.companion.vio.result import Degraded, Initializing, Lost, Result
from viso.companion.vio.types import FeatureQuality, ImuWindow, VioOutput, VioState
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array


class Rig(WaxRig):
    """A strategy with a fake engine; frames are a tenth of a second apart."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *, camera: Mapping[str, Any] = MappingProxyType({}), **config: Any
    ) -> None:
        engine = config.pop("engine", EngineConfig())
        super().__init__(camera, strategy="engine", engine=replace(engine, command="fake"), **config)
        sessions = install(monkeypatch)
        self.engine_strategy = EngineStrategy(self.context)
        (self.engine,) = sessions
        self.next = 0

    def run(self, window: ImuWindow | None = None) -> Result:
        """Process the next frame."""
        t_ns = self.next * PERIOD_NS
        frame = make_frame(self.next, size=(self.calibration.height, self.calibration.width))
        if window is None:
            window = still_window(max(t_ns - PERIOD_NS, 0), t_ns)
        self.next += 1
        return self.engine_strategy.process(frame, window)

    def degraded(self, window: ImuWindow | None = None) -> Degraded:
        """Process a frame that is DEGRADED."""
        result = self.run(window)
        assert isinstance(result, Degraded)
        return result

    def lost(self) -> Lost:
        """Process a frame that ends in LOST."""
        result = self.run()
        assert isinstance(result, Lost)
        return result

    def wait(self, window: ImuWindow | None = None) -> None:
        """Process a frame without a state."""
        assert isinstance(self.run(window), Initializing)

    def initialise(self) -> VioOutput:
        """Process frames up to the first one with an output."""
        self.wait()
        return output_of(self.run())

    def state(self) -> VioState:
        return self.engine_strategy.health.state


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    return Rig(monkeypatch, lost_frames_fatal=3)


def break_down(*_: object) -> NoReturn:
    raise RuntimeError("segmentation would have faulted")


def test_samples_go_in_once_and_the_image_after_them(rig: Rig) -> None:
    rig.initialise()
    rig.run()
    assert rig.engine.imu == list(range(0, 2 * PERIOD_NS + 1, 5_000_000))
    assert rig.engine.images == [0, PERIOD_NS, 2 * PERIOD_NS]


def test_image_has_the_imus_time(rig: Rig) -> None:
    rig.wait(still_window(1_000, 2_000))
    assert rig.engine.images == [2_000]


def test_engines_own_initialisation_brings_tracking(rig: Rig) -> None:
    rig.initialise()
    assert rig.state() is VioState.TRACKING


def test_engine_that_has_a_state_at_once_brings_tracking(rig: Rig) -> None:
    rig.engine.status = Status.TRACKING
    rig.run()
    assert rig.state() is VioState.TRACKING


def test_output_is_the_engines(rig: Rig) -> None:
    rig.engine.world = SE3.exp(np.array([0.1, 0.2, 0.3, 4.0, 5.0, 6.0])).matrix()
    rig.engine.velocity_world = np.array([1.0, 2.0, 3.0])
    output = rig.initialise()
    assert np.array_equal(output.world_T_body.matrix(), rig.engine.world)
    assert output.velocity_b == pytest.approx(rig.engine.world[:3, :3].T @ rig.engine.velocity_world)
    assert rig.engine.covariance_6x6 is not None
    assert np.array_equal(output.pose_covariance_6x6, rig.engine.covariance_6x6)
    assert output.imu_bias.norm() == pytest.approx(np.hypot(0.1, 0.01))
    assert output.feature_quality == FeatureQuality(120, 3, 5, 100, 4.5, 0.5, 0.8)


def test_outputs_refer_to_the_last_keyframe(rig: Rig) -> None:
    outputs = [rig.initialise(), *(output_of(rig.run()) for _ in range(5))]
    ids = [output.frame_id for output in outputs]
    assert [output.is_keyframe for output in outputs] == [True, False, False, True, False, False]
    assert [output.keyframe_id for output in outputs] == [ids[0]] * 4 + [ids[3]] * 2


def test_innovation_ratio_is_reported(rig: Rig) -> None:
    rig.initialise()
    assert rig.run().innovation_ratio == 1.2


def test_features_are_judged(rig: Rig) -> None:
    rig.initialise()
    rig.engine.says["inliers"] = 20
    assert rig.degraded().reason == "few_inliers"


def test_lost_engine_is_a_lost_frame_with_its_prediction(rig: Rig) -> None:
    rig.initialise()
    rig.engine.status = Status.LOST
    for _ in range(2):
        assert rig.degraded().reason == "no_model"
    rig.lost()


def test_covariance_that_is_not_sound_is_a_lost_frame_with_a_larger_one(rig: Rig) -> None:
    before = rig.initialise()
    rig.engine.covariance_6x6 = np.full((6, 6), np.nan)
    result = rig.degraded()
    assert result.reason == "non_finite"
    grown = result.output.pose_covariance_6x6 / rig.config.degraded_inflation
    assert (np.diag(grown) > np.diag(before.pose_covariance_6x6)).all()
    assert result.consecutive_lost == 1


def test_first_covariance_that_is_not_sound_is_fatal(rig: Rig) -> None:
    rig.engine.covariance_6x6 = -np.eye(6)
    rig.wait()
    assert rig.lost().reason == "engine: covariance not sound"


@pytest.mark.parametrize("status", [Status.FAILED, Status.INITIALISING])
def test_state_that_is_gone_ends_in_lost(rig: Rig, status: Status) -> None:
    rig.initialise()
    rig.engine.status = status
    assert "no state any more" in rig.lost().reason


@pytest.mark.parametrize("method", ["add_imu", "add_image"])
def test_method_that_raises_is_fatal(monkeypatch: pytest.MonkeyPatch, rig: Rig, method: str) -> None:
    rig.initialise()
    monkeypatch.setattr(rig.engine, method, break_down)
    assert rig.lost().reason == "RuntimeError: segmentation would have faulted"
    assert rig.state() is VioState.LOST


def test_reset_that_raises_is_fatal(monkeypatch: pytest.MonkeyPatch, rig: Rig) -> None:
    monkeypatch.setattr(rig.engine, "reset", break_down)
    with pytest.raises(VioFatalError):
        rig.engine_strategy.reset(make_warm_start())
    assert rig.state() is VioState.LOST


def test_warm_start_reaches_the_engine_and_wants_two_good_frames(rig: Rig) -> None:
    rig.initialise()
    rig.engine_strategy.reset(make_warm_start())
    (start,) = rig.engine.resets
    assert start is not None
    rig.wait()
    output = output_of(rig.run())
    assert output.world_T_body.t == pytest.approx(make_warm_start().body_T_world.inverse().t)


def test_engine_gets_all_samples_after_a_warm_start(rig: Rig) -> None:
    rig.initialise()
    rig.engine_strategy.reset(make_warm_start())
    rig.wait()
    assert rig.engine.imu[0] == PERIOD_NS


def test_keyframes_begin_anew_after_a_warm_start(rig: Rig) -> None:
    before = rig.initialise()
    rig.engine_strategy.reset(make_warm_start())
    rig.wait()
    assert output_of(rig.run()).keyframe_id != before.keyframe_id


def test_auto_reinit_resets_the_engine_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, lost_frames_fatal=1, auto_reinit_s=0.1)
    rig.initialise()
    rig.engine.status = Status.LOST
    rig.lost()
    rig.engine.status = None
    rig.wait()
    result = rig.run()
    assert rig.engine.resets == [None]
    assert rig.engine.imu[0] == 2 * PERIOD_NS
    assert result.resets == 1


def test_engine_that_has_a_state_at_once_after_auto_reinit(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, lost_frames_fatal=1, auto_reinit_s=0.1)
    rig.initialise()
    rig.engine.status = Status.LOST
    rig.lost()
    rig.engine.status = Status.TRACKING
    rig.run()
    assert rig.state() is VioState.TRACKING


def without(window: ImuWindow, *numbers: int) -> ImuWindow:
    kept = tuple(sample for i, sample in enumerate(window.samples) if i not in numbers)
    return ImuWindow(window.start_t_ns, window.end_t_ns, kept)


@pytest.mark.parametrize(
    ("missing", "reason"), [(range(5, 9), IMU_GAP), (range(18, 21), IMU_GAP), (range(21), IMU_EMPTY)]
)
def test_missing_inertial_data_degrade(rig: Rig, missing: range, reason: str) -> None:
    rig.initialise()
    window = still_window(PERIOD_NS, 2 * PERIOD_NS)
    assert rig.degraded(without(window, *missing)).reason == reason


def test_few_samples_are_a_gap_before_the_period_is_known(rig: Rig) -> None:
    rig.wait()
    assert rig.degraded(without(still_window(0, PERIOD_NS), *range(1, 20))).reason == IMU_GAP


def slow(t0_ns: int, t1_ns: int) -> ImuWindow:
    """Return a window with a sample each 20 ms."""
    window = still_window(t0_ns, t1_ns)
    return ImuWindow(t0_ns, t1_ns, window.samples[::4])


def test_slow_imu_has_no_gaps(rig: Rig) -> None:
    rig.wait(still_window(0, 0))
    for i in range(3):
        rig.run(slow(4 * i * PERIOD_NS, 4 * (i + 1) * PERIOD_NS))
    assert rig.state() is VioState.TRACKING


def test_slow_imu_may_be_known(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, camera={"imu_rate_hz": 50.0})
    rig.wait(still_window(0, 0))
    rig.run(slow(0, PERIOD_NS))  # too few to tell
    assert rig.state() is VioState.TRACKING


def test_few_samples_do_not_make_an_imu_slow(rig: Rig) -> None:
    rig.initialise()
    assert rig.degraded(slow(PERIOD_NS, 2 * PERIOD_NS)).reason == IMU_GAP


def test_engine_gets_working_images_and_their_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    # The fake refuses others than its calibration's, and the frame is as large as the camera's.
    rig = Rig(monkeypatch, camera={"width": 200}, working_width_px=100)
    rig.initialise()
    assert rig.state() is VioState.TRACKING


def sigmas(output: VioOutput) -> Array:
    return np.sqrt(np.diag(output.pose_covariance_6x6))


def test_covariance_is_scaled(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, engine=EngineConfig(covariance_scale=16.0))
    assert sigmas(rig.initialise()) == pytest.approx([4e-3] * 3 + [4e-2] * 3)


def test_engine_without_covariance_has_the_configured_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, engine=EngineConfig(drift_rad=0.01, drift_m=0.1, drift_share=0.0))
    rig.engine.covariance_6x6 = None
    rig.initialise()
    assert sigmas(output_of(rig.run())) == pytest.approx(np.sqrt(0.1) * np.array([0.01] * 3 + [0.1] * 3))
    assert sigmas(output_of(rig.run())) == pytest.approx(np.sqrt(0.2) * np.array([0.01] * 3 + [0.1] * 3))
    assert rig.state() is VioState.TRACKING


def test_drift_grows_with_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, engine=EngineConfig(drift_m=1e-6, drift_share=0.5))
    rig.engine.covariance_6x6 = None
    rig.initialise()
    output = output_of(rig.run())
    way_m = np.linalg.norm(output.relative_pose_T.t)
    assert sigmas(output)[3:] == pytest.approx([0.5 * way_m] * 3, rel=1e-3)


def test_heights_go_in_at_the_image_if_the_engine_takes_them(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, agl_source="rangefinder")
    rig.engine.capabilities |= Capability.TAKES_HEIGHT
    rig.engine_strategy.add_height(0, 50.0, 0.1)
    rig.initialise()
    rig.engine.velocity_world = np.array([0.0, 0.0, 2.0])
    rig.run()
    rig.engine_strategy.add_height(3 * PERIOD_NS - 50_000_000, 60.0, 0.1)
    rig.run()
    assert rig.engine.heights == [(0, 50.0, 0.5), (3 * PERIOD_NS, pytest.approx(60.1), 0.6)]


@pytest.mark.parametrize(("takes_height", "agl_source"), [(True, "none"), (False, "rangefinder")])
def test_no_height_where_nobody_wants_it(monkeypatch: pytest.MonkeyPatch, takes_height: bool, agl_source: str) -> None:
    rig = Rig(monkeypatch, agl_source=agl_source)
    if takes_height:
        rig.engine.capabilities |= Capability.TAKES_HEIGHT
    rig.engine_strategy.add_height(0, 50.0, 0.1)
    rig.initialise()
    assert rig.engine.heights == []


class TestScale:
    """Over a plane, and the engine has no height."""

    @pytest.fixture
    def rig(self, monkeypatch: pytest.MonkeyPatch) -> Rig:
        rig = Rig(monkeypatch, scene="planar", agl_source="rangefinder")
        rig.wait()
        assert rig.degraded().reason == SCALE_UNOBSERVED
        return rig

    def fly(self, rig: Rig, share: float) -> VioState:
        """Fly on to the keyframe after the next; say how well ways to keyframes are known."""
        for _ in range(6):
            way_m = 1e-3 * (rig.engine.since_keyframe + 1)  # of the next image
            rig.engine.covariance_6x6 = np.diag([1e-8] * 3 + [(share * way_m) ** 2] * 3)
            rig.run()
        return rig.state()

    def test_is_known_once_the_ways_between_keyframes_are(self, rig: Rig) -> None:
        assert self.fly(rig, 0.06) is VioState.DEGRADED
        assert self.fly(rig, 0.04) is VioState.TRACKING

    def test_is_not_learnt_from_a_configured_drift(self, rig: Rig) -> None:
        rig.engine.covariance_6x6 = None
        for _ in range(6):
            assert rig.degraded().reason == SCALE_UNOBSERVED

    def test_comes_with_a_height(self, rig: Rig) -> None:
        rig.engine.capabilities |= Capability.TAKES_HEIGHT
        for _ in range(3):
            rig.run()
        assert rig.state() is VioState.TRACKING


def test_keyframe_that_moved_is_told(rig: Rig) -> None:
    rig.initialise()
    better = SE3.exp(np.array([0.0, 0.0, 0.1, 1.0, 2.0, 3.0])).matrix()
    rig.engine.updates = [(2, better), (1, np.eye(4))]
    moved = output_of(rig.run()).world_T_keyframe
    assert moved is not None
    assert np.array_equal(moved.matrix(), better)
    assert output_of(rig.run()).world_T_keyframe is None


def test_engine_that_knows_its_motion_too_badly_is_degraded(rig: Rig) -> None:
    rig.initialise()
    rig.engine.covariance_6x6 = np.diag([1e-6] * 3 + [0.3**2] * 3)
    assert rig.degraded().reason == UNSURE_VELOCITY
