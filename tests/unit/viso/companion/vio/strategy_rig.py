# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of strategies and of what runs them have in common: a camera, frames, inertial data, a strategy of wax."""

import logging
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from viso.companion.vio.config import VioConfig
from viso.companion.vio.health import FrameFacts
from viso.companion.vio.pipeline import StrategyBase, StrategyContext
from viso.companion.vio.result import Degraded, Initializing, Lost, Result, Tracking
from viso.companion.vio.types import (
    CameraCalibration,
    DistortionModel,
    FeatureQuality,
    ImuBias,
    ImuSample,
    ImuWindow,
    NavCameraFrame,
    Pixels,
    VioOutput,
    VioState,
    WarmStartPose,
    frame_uuid,
)
from viso.geometry.pose import SE3

WIDTH, HEIGHT = 64, 48
PERIOD_NS = 100_000_000
IMU_PERIOD_NS = 5_000_000
GRAVITY = np.array([0.0, 0.0, 9.80665])

GOOD = FrameFacts(inliers=100, coverage=0.8, mre_px=0.5)
INITIAL = FrameFacts(inliers=100, coverage=0.8, mre_px=0.5, initialised=True)
LOST = FrameFacts(inliers=0, coverage=0.0, mre_px=0.0, has_model=False)
FEW = FrameFacts(inliers=20, coverage=0.8, mre_px=0.5)


def make_calibration(width: int = WIDTH, height: int = HEIGHT, **changed: Any) -> CameraCalibration:
    fields: dict[str, Any] = {
        "camera_id": "cam",
        "unit": "7",
        "fx": 50.0,
        "fy": 50.0,
        "cx": width / 2,
        "cy": height / 2,
    }
    fields |= {"distortion_model": DistortionModel.NONE, "distortion": np.empty(0), "B_T_C": SE3.identity()}
    return CameraCalibration(**(fields | {"width": width, "height": height} | changed))


def make_frame(
    sequence: int,
    *,
    t_ns: int | None = None,
    camera_id: str = "cam",
    pixels: Pixels | None = None,
    size: tuple[int, int] = (HEIGHT, WIDTH),
) -> NavCameraFrame:
    """Return the frame of a number; its time is that many periods."""
    t_ns = sequence * PERIOD_NS if t_ns is None else t_ns
    pixels = np.zeros(size, np.uint8) if pixels is None else pixels
    return NavCameraFrame(frame_uuid(t_ns // 1_000_000, sequence, 0), sequence, t_ns, pixels, camera_id)


def still_window(t0_ns: int, t1_ns: int, gyro: Sequence[float] = (0.0, 0.0, 0.0)) -> ImuWindow:
    """Return the inertial data of a level body that stands still, or only turns, at 200 Hz on a fixed grid."""
    first, last = t0_ns // IMU_PERIOD_NS, -(-t1_ns // IMU_PERIOD_NS)
    samples = tuple(ImuSample(i * IMU_PERIOD_NS, GRAVITY, np.array(gyro)) for i in range(first, last + 1))
    return ImuWindow(t0_ns, t1_ns, samples)


def make_output(frame: NavCameraFrame, **changed: Any) -> VioOutput:
    fields: dict[str, Any] = {
        "frame_id": frame.frame_id,
        "relative_pose_T": SE3.exp(np.array([0.01, 0.02, 0.03, 0.1, 0.2, 0.3])),
        "pose_covariance_6x6": np.diag([1e-6, 2e-6, 3e-6, 1e-4, 2e-4, 3e-4]),
        "imu_bias": ImuBias(np.array([0.1, 0.0, 0.2]), np.array([0.01, 0.02, 0.0])),
        "feature_quality": FeatureQuality(120, 3, 5, 100, 4.5, 0.5, 0.8),
        "keyframe_id": frame.frame_id,
        "is_keyframe": True,
        "velocity_b": np.array([1.0, 2.0, 3.0]),
        "world_T_body": SE3.exp(np.array([0.1, 0.2, 0.3, 10.0, 20.0, 30.0])),
    }
    return VioOutput(**(fields | changed))


def make_result(
    state: VioState = VioState.TRACKING, output: VioOutput | None = None, *, is_warm: bool = False, **fields: Any
) -> Result:
    """Return the result that leaves a strategy in a state."""
    fields.setdefault("frame_id", frame_uuid(0, 0, 0))
    fields.setdefault("sequence", 0)
    fields.setdefault("t_ns", 0)
    fields.setdefault("reason", "")
    if state is VioState.INIT:
        return Initializing(is_warm=is_warm, **fields)
    if output is None or state is VioState.LOST:
        return Lost(**fields)
    return Degraded(output=output, **fields) if state is VioState.DEGRADED else Tracking(output=output, **fields)


def output_of(result: Result | None) -> VioOutput:
    """Return the output that a result has."""
    assert result is not None
    assert result.output is not None
    return result.output


def make_warm_start() -> WarmStartPose:
    return WarmStartPose(SE3.exp(np.array([0.0, 0.0, 0.3, 1.0, 2.0, 3.0])), np.array([1.0, 0.0, 0.0]), ImuBias.zero())


class Ticks:
    """A clock that is where it was put."""

    def __init__(self, now_ns: int = 0) -> None:
        self.now_ns = now_ns

    def __call__(self) -> int:
        return self.now_ns


class EventHandler(logging.Handler):
    """Keeps records; ``events`` are those that name one."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)

    def events(self, name: str) -> list[logging.LogRecord]:
        return [record for record in self.records if getattr(record, "event", None) == name]

    def fields(self, name: str) -> list[dict[str, Any]]:
        return [getattr(record, "fields") for record in self.events(name)]  # noqa: B009 -- typed as having none


def make_logger(level: int = logging.DEBUG) -> tuple[logging.Logger, EventHandler]:
    """Return a logger of its own and what it has been told."""
    handler, logger = EventHandler(), logging.Logger("vio", level)
    logger.addHandler(handler)
    return logger, handler


class WaxStrategy(StrategyBase):
    """Does with a frame what it is told to; by default all goes well, and it is initialised by its first frame.

    Attributes:
        step: returns facts and output of a frame, or raises.
        seen: the frames' numbers and windows.
        calls: what it was reset to.
    """

    name = "wax"

    def __init__(self, context: StrategyContext) -> None:
        super().__init__(context)
        self.step: Callable[[NavCameraFrame], tuple[FrameFacts, VioOutput | None]] = lambda frame: (
            INITIAL,
            make_output(frame),
        )
        self.seen: list[tuple[int, ImuWindow]] = []
        self.calls: list[object] = []

    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
        self.seen.append((frame.sequence, imu_window))
        with self.stage("step"):
            facts, output = self.step(frame)
        return self._conclude(facts, output)

    def _reset(self, start: WarmStartPose | None) -> None:
        self.calls.append(start)

    def finds(self, facts: FrameFacts) -> None:
        """Let all frames from now on be of this kind."""
        self.step = lambda frame: (facts, make_output(frame))

    def run(self, sequence: int) -> Result:
        """Process the frame of a number, standing still."""
        frame = make_frame(sequence)
        window = still_window(frame.capture_timestamp - PERIOD_NS, frame.capture_timestamp)
        return self.process(frame, window)


class WaxRig:
    """A strategy of wax in its context."""

    def __init__(self, camera: Mapping[str, Any] = MappingProxyType({}), **config: Any) -> None:
        self.logger, self.log = make_logger()
        self.clock = Ticks()
        self.config = VioConfig(**config)
        self.calibration = make_calibration(**camera)
        self.context = StrategyContext(self.config, self.calibration, self.clock, self.logger)
        self.strategy = WaxStrategy(self.context)
