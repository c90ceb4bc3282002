# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every strategy keeps to, whichever estimator it has.

All look at the same scene: a camera before a wall of bright and dark tiles, on a body that stands still, is shaken, or
whose camera is covered.
"""

import dataclasses
import threading
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.engine.compiled import inertial_engine
from tests.unit.viso.companion.vio.strategy_rig import (
    GRAVITY,
    IMU_PERIOD_NS,
    PERIOD_NS,
    Ticks,
    make_calibration,
    make_frame,
    make_logger,
    still_window,
)
from viso.companion.vio.config import EngineConfig, VioConfig
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.frames import MOUNTINGS
from viso.companion.vio.log import compact_json
from viso.companion.vio.registry import STRATEGIES, build_vio_strategy
from viso.companion.vio.result import Degraded, Initializing, Lost, Result
from viso.companion.vio.types import (
    ImuBias,
    ImuSample,
    ImuWindow,
    NavCameraFrame,
    Pixels,
    VioOutput,
    VioState,
    WarmStartPose,
)
from viso.geometry.pose import SE3, sound_covariance

Prepare = Callable[[], object]

# What a strategy needs before the factory can build it. To put one under the contract is to add its row.
PREPARATIONS: dict[str, Prepare] = {
    "klt_ransac": lambda: pytest.importorskip("cv2"),
    "fixed_lag": lambda: [pytest.importorskip(library) for library in ("cv2", "gtsam")],
    "okvis2": lambda: [pytest.importorskip("cv2"), inertial_engine()],
    "vins_mono": lambda: [pytest.importorskip("cv2"), inertial_engine()],
    "engine": lambda: [pytest.importorskip("cv2"), inertial_engine()],
}

PROGRAMS = {"okvis2": "", "vins_mono": " --needs-motion", "engine": ""}
"""Options of the program. One that needs motion finds its state by itself only then; at rest it is given."""

WIDTH, HEIGHT, TILE = 320, 240, 20
PATIENCE = 30  # frames: 3 s
LOST_FRAMES = 3
FEATURES = 48  # as many as the wall shows: with more, each frame would look for new ones


def make_wall() -> Pixels:
    tiles = np.random.default_rng(1).integers(20, 235, (HEIGHT // TILE, WIDTH // TILE)).astype(np.uint8)
    return np.kron(tiles, np.ones((TILE, TILE), np.uint8))


WALL = make_wall()
DARK = np.zeros_like(WALL)


def shaken_window(t0_ns: int, t1_ns: int) -> ImuWindow:
    """Return the inertial data of a body that nobody would call still."""
    samples = tuple(
        ImuSample(t_ns, GRAVITY + 3.0 * sign, np.full(3, 0.5) * sign)
        for t_ns in range(t0_ns - t0_ns % IMU_PERIOD_NS, t1_ns + IMU_PERIOD_NS, IMU_PERIOD_NS)
        for sign in ((-1) ** (t_ns // IMU_PERIOD_NS),)
    )
    return ImuWindow(t0_ns, t1_ns, samples)


def empty_window(t0_ns: int, t1_ns: int) -> ImuWindow:
    return ImuWindow(t0_ns, t1_ns, ())


class Bench:
    """A strategy and the time that passes for it: a frame each tenth of a second."""

    def __init__(self, name: str) -> None:
        logger, self.log = make_logger()
        self.clock = Ticks()
        mounting = SE3(MOUNTINGS["forward"], np.zeros(3))
        self.calibration = make_calibration(WIDTH, HEIGHT, fx=200.0, fy=200.0, B_T_C=mounting)
        self.starts_in_motion = name == "vins_mono"
        command = inertial_engine() + PROGRAMS[name] if name in PROGRAMS else ""
        self.config = VioConfig(
            strategy=name,
            lost_frames_fatal=LOST_FRAMES,
            max_features=FEATURES,
            engine=EngineConfig(command=command),
        )
        self.strategy = build_vio_strategy(self.config, self.calibration, self.clock, logger)
        self.next = 10

    def frame(self, pixels: Pixels = WALL, **changed: Any) -> NavCameraFrame:
        return make_frame(self.next, pixels=pixels, **changed)

    def process(
        self, pixels: Pixels = WALL, window: Callable[[int, int], ImuWindow] = still_window, **changed: Any
    ) -> Result:
        """Process the next frame."""
        frame = self.frame(pixels, **changed)
        t_ns = frame.capture_timestamp
        self.next += 1
        self.clock.now_ns = t_ns + 1_000_000
        return self.strategy.process(frame, window(t_ns - PERIOD_NS, t_ns))

    def see(self, pixels: Pixels = WALL) -> VioOutput | None:
        """Process the next frame, standing still; return its output, degraded or not, or None."""
        return self.process(pixels).output

    def initialise(self) -> VioOutput:
        """Process frames until one has an output."""
        for _ in range(PATIENCE):
            if (output := self.see()) is not None:
                return output
        raise AssertionError("no state after 3 s of standing still")

    def state(self) -> VioState:
        return self.strategy.health.state


def level_start() -> WarmStartPose:
    return WarmStartPose(SE3(np.eye(3), np.array([-10.0, -20.0, -30.0])), np.zeros(3), ImuBias.zero())


def values(output: VioOutput | None) -> str:
    return compact_json(None if output is None else dataclasses.asdict(output))


class Stood:
    """A strategy that has stood still until 1 s after its first output.

    Attributes:
        bench: it.
        told: what it said about each frame, as text.
        outputs: from the first one on.
        expected_ids: of their frames.
        states: after them.
        results: that they came with.
    """

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.told: list[str] = []
        self.outputs: list[VioOutput] = []
        self.expected_ids: list[uuid.UUID] = []
        self.states: list[VioState] = []
        self.results: list[Result] = []
        while len(self.outputs) <= 10 and len(self.told) < PATIENCE:
            self._see()
        assert self.outputs, "no state after 3 s of standing still"

    def _see(self) -> None:
        expected_id, result = self.bench.frame().frame_id, self.bench.process()
        self.told.append(values(result.output))
        if result.output is None:
            assert self.outputs == []
            return
        self.outputs.append(result.output)
        self.expected_ids.append(expected_id)
        self.results.append(result)
        self.states.append(self.bench.state())


@pytest.fixture(scope="module", params=list(PREPARATIONS))
def kind(request: pytest.FixtureRequest) -> str:
    """Return which strategy."""
    return str(request.param)


@pytest.fixture
def bench(kind: str) -> Iterator[Bench]:
    """Yield a bench with a new strategy."""
    PREPARATIONS[kind]()
    bench = Bench(kind)
    yield bench
    bench.strategy.close()


@pytest.fixture(scope="module")
def stood(kind: str) -> Iterator[Stood]:
    """Yield a strategy that has stood still, to be looked at only."""
    PREPARATIONS[kind]()
    bench = Bench(kind)
    yield Stood(bench)
    bench.strategy.close()


class TestStrategy:
    """The contract."""

    def test_has_its_name(self, stood: Stood) -> None:
        assert stood.bench.strategy.name == stood.bench.config.strategy

    def test_is_in_init_when_new(self, bench: Bench) -> None:
        health = bench.strategy.health.snapshot()
        assert (health.state, health.consecutive_lost) == (VioState.INIT, 0)

    def test_initializing_before_there_is_a_state(self, bench: Bench) -> None:
        for _ in range(1 if bench.starts_in_motion else 10):
            result = bench.process(window=still_window if bench.starts_in_motion else shaken_window)
            assert isinstance(result, Initializing)
        assert bench.state() is VioState.INIT

    def test_motion_starts_what_needs_it(self, bench: Bench) -> None:
        states = set[VioState]()
        for _ in range(10):
            states.add(bench.process(window=shaken_window).state)
        assert (states != {VioState.INIT}) == bench.starts_in_motion

    def test_standing_still_brings_outputs(self, stood: Stood) -> None:
        assert stood.states[0] in (VioState.TRACKING, VioState.DEGRADED)

    def test_output_is_of_the_frame_and_sound(self, stood: Stood) -> None:
        for output, expected_id in zip(stood.outputs, stood.expected_ids, strict=True):
            assert output.frame_id == expected_id
            assert sound_covariance(output.pose_covariance_6x6) is not None
            assert output.pose_covariance_6x6.trace() > 0

    def test_standing_still_is_standing_still(self, stood: Stood) -> None:
        assert np.abs(stood.outputs[-1].relative_pose_T.log()).max() < 0.05
        assert np.abs(stood.outputs[-1].velocity_b).max() < 0.05

    def test_output_refers_to_the_last_keyframe(self, stood: Stood) -> None:
        first, *others = stood.outputs
        keyframe_id = first.frame_id if first.is_keyframe else first.keyframe_id
        for output in others:
            assert output.keyframe_id == keyframe_id
            keyframe_id = output.frame_id if output.is_keyframe else keyframe_id

    def test_results_tell_the_state(self, stood: Stood) -> None:
        assert [result.state for result in stood.results] == stood.states

    def test_another_camera_ends_in_lost(self, bench: Bench) -> None:
        bench.initialise()
        assert isinstance(bench.process(camera_id="other"), Lost)

    @pytest.mark.parametrize("size", [(HEIGHT - 1, WIDTH), (WIDTH, HEIGHT)])
    def test_another_size_ends_in_lost(self, bench: Bench, size: tuple[int, int]) -> None:
        bench.initialise()
        assert isinstance(bench.process(np.zeros(size, np.uint8)), Lost)

    def test_colour_is_as_good_as_grey(self, bench: Bench) -> None:
        colour = np.repeat(WALL[:, :, None], 3, axis=2)
        assert any(bench.see(colour) is not None for _ in range(PATIENCE))

    def test_second_caller_is_refused_while_health_is_told(self, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
        bench.initialise()
        before = bench.strategy.health.snapshot()
        told: list[object] = []

        def look() -> None:
            told.append(bench.strategy.health.snapshot())
            with pytest.raises(VioFatalError, match=r"^concurrent use of a strategy$"):
                bench.process()
            told.append(bench.strategy.health.snapshot())

        process = bench.strategy._process

        def work(frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
            other = threading.Thread(target=look)
            other.start()
            other.join(10)
            return process(frame, imu_window)

        with monkeypatch.context() as patch:
            patch.setattr(bench.strategy, "_process", work)
            assert bench.see() is not None
        assert told == [before, before]
        assert bench.see() is not None

    def test_covered_camera_is_degraded_then_lost(self, bench: Bench) -> None:
        bench.initialise()
        for count in range(1, LOST_FRAMES):
            result = bench.process(DARK)
            assert isinstance(result, Degraded)
            assert sound_covariance(result.output.pose_covariance_6x6) is not None
            assert result.consecutive_lost == count
        assert isinstance(bench.process(DARK), Lost)
        assert bench.state() is VioState.LOST

    def test_lost_stays_lost_until_a_warm_start(self, bench: Bench) -> None:
        bench.initialise()
        for _ in range(LOST_FRAMES - 1):
            bench.see(DARK)
        for pixels in (DARK, WALL, WALL):
            assert isinstance(bench.process(pixels), Lost)
        bench.strategy.reset(level_start())
        bench.initialise()
        assert bench.process().resets == 1

    def test_one_dark_frame_does_no_harm(self, bench: Bench) -> None:
        bench.initialise()
        assert isinstance(bench.process(DARK), Degraded)
        assert bench.see() is not None

    def test_frame_without_inertial_data_is_a_lost_one(self, bench: Bench) -> None:
        bench.initialise()
        result = bench.process(window=empty_window)
        assert isinstance(result, Degraded)
        assert result.consecutive_lost == 1

    def test_warm_start_begins_in_init_and_ends_where_it_said(self, bench: Bench) -> None:
        bench.strategy.reset(level_start())
        assert bench.state() is VioState.INIT
        output = bench.initialise()
        assert output.world_T_body.t == pytest.approx([10.0, 20.0, 30.0], abs=0.1)

    def test_warm_start_in_flight_goes_back_to_init(self, bench: Bench) -> None:
        bench.initialise()
        bench.strategy.reset(level_start())
        assert bench.state() is VioState.INIT

    @pytest.mark.parametrize(
        ("where", "field", "bad"),
        [
            ("", "velocity_b", np.full(3, np.nan)),
            ("body_T_world", "t", np.full(3, np.inf)),
            ("body_T_world", "R", 1.01 * np.eye(3)),
            ("body_T_world", "R", -np.eye(3)),
            ("bias", "gyro", np.full(3, np.nan)),
            ("", "covariance", np.full((15, 15), np.nan)),
        ],
    )
    def test_bad_warm_start_is_refused(self, bench: Bench, where: str, field: str, bad: object) -> None:
        pose = level_start()
        object.__setattr__(getattr(pose, where) if where else pose, field, bad)
        with pytest.raises(VioFatalError):
            bench.strategy.reset(pose)
        assert bench.state() is VioState.INIT

    def test_same_input_same_output(self, bench: Bench, stood: Stood) -> None:
        for told in stood.told[:10]:
            assert values(bench.see()) == told
        assert told != "null"

    def test_camera_may_use_its_buffer_again(self, bench: Bench, stood: Stood) -> None:
        buffer = np.empty_like(WALL)
        for told in stood.told[:10]:
            buffer[:] = WALL
            output = bench.see(buffer)
            buffer[:] = 0
            assert values(output) == told
        assert output is not None

    def test_outputs_do_not_change_any_more(self, stood: Stood) -> None:
        assert [values(output) for output in stood.outputs] == stood.told[-len(stood.outputs) :]

    def test_outputs_cannot_be_written_to(self, stood: Stood) -> None:
        output = stood.outputs[0]
        pose, bias = output.relative_pose_T, output.imu_bias
        for array in (pose.R, pose.t, bias.accel, bias.gyro, output.pose_covariance_6x6, output.velocity_b):
            assert not array.flags.writeable
            assert array.flags.c_contiguous

    def test_leaving_init_is_logged_once(self, stood: Stood) -> None:
        (fields,) = (one for one in stood.bench.log.fields("state_change") if one["old"] == "INIT")
        assert fields["new"] == "TRACKING"


def test_every_strategy_is_under_the_contract() -> None:
    assert set(PREPARATIONS) == set(STRATEGIES)
