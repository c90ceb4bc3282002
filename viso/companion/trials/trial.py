# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strategy on trial: sensor data go in as they would in flight, and what comes out is compared with the truth.

Nothing here reads a clock: unless one is given, time is that of the newest data, and the same data give the same trial.
"""

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from viso.companion.odometry.composer import LocalPose, OdometryComposer
from viso.companion.trials.evaluation import AbsoluteError, EvaluationError, TimedPoses, absolute_error, nees_per_dof
from viso.companion.vio.config import AglSource, LocalAlignment, VioConfig
from viso.companion.vio.imu_buffer import ImuBuffer
from viso.companion.vio.registry import build_vio_strategy
from viso.companion.vio.se3 import SE3, Array
from viso.companion.vio.types import CameraCalibration, ImuSample, NavCameraFrame, VioState, WarmStartPose
from viso.companion.vio.update import Listener, VioUpdate
from viso.companion.vio.worker import VioWorker

_LOGGER: Final = logging.getLogger(__name__)


class Height(Protocol):
    """What a range finder or barometer tells.

    Attributes:
        t_ns: when.
        height_m: of the body above the ground.
        sigma_m: its standard deviation.
    """

    @property
    def t_ns(self) -> int: ...
    @property
    def height_m(self) -> float: ...
    @property
    def sigma_m(self) -> float: ...


Event = ImuSample | NavCameraFrame | Height


class TrialSource(Protocol):
    """Sensor data, and the truth about them as far as it is known.

    Attributes:
        calibration: of the camera.
    """

    @property
    def calibration(self) -> CameraCalibration: ...

    def events(self) -> Iterator[Event]:
        """Yield the data in the order in which they arrive: a frame comes after an IMU sample that is later than it."""

    def truth(self, t_ns: int) -> SE3 | None:
        """Return world_T_body at a time of the IMU's clock, None where it is not known."""

    def truth_velocity_w(self, t_ns: int) -> Array | None:
        """Return the velocity [3] in m/s, in the world, at a time of the IMU's clock, None where it is not known."""


@dataclass(frozen=True, slots=True, eq=False)
class TrialFrame:
    """A frame, what the strategy made of it, and the truth.

    Attributes:
        update: what the worker told; its output is None in INIT and LOST.
        local: the composed pose, north as its alignment and the first output as its origin; None without output.
        truth: world_T_body, None where it is not known.
        truth_velocity_w: in m/s, in the world, None where it is not known.
    """

    update: VioUpdate
    local: LocalPose | None
    truth: SE3 | None
    truth_velocity_w: Array | None


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """How a strategy did.

    Attributes:
        frames: those that the strategy processed.
        counters: the worker's.
    """

    frames: tuple[TrialFrame, ...]
    counters: Mapping[str, int]

    def states(self) -> Counter[VioState]:
        """Return how many frames ended in which state."""
        return Counter(frame.update.health.state for frame in self.frames)

    def estimate(self) -> TimedPoses:
        """Return the poses of all outputs, in the strategy's world."""
        return _timed([(frame.update.t_ns, pose) for frame in self.frames if (pose := _estimated(frame)) is not None])

    def truth(self) -> TimedPoses:
        """Return the true poses at all frames where they are known."""
        return _timed([(frame.update.t_ns, frame.truth) for frame in self.frames if frame.truth is not None])

    def absolute_error(self) -> AbsoluteError:
        """Return the error of the trajectory after alignment without scale.

        Raises:
            EvaluationError: if fewer than 3 outputs are within the time of the truth.
        """
        return absolute_error(self.estimate(), self.truth())

    def position_errors(self) -> Array:
        """Return [N, 3] in m, estimated less true position without any alignment, of outputs whose truth is known."""
        pairs = [(_estimated(frame), frame.truth) for frame in self.frames]
        errors = [pose.t - truth.t for pose, truth in pairs if pose is not None and truth is not None]
        return np.array(errors).reshape(-1, 3)

    def velocity_errors(self) -> Array:
        """Return [N, 3] in m/s, estimated less true velocity in the world, of outputs whose truth is known."""
        errors = []
        for frame in self.frames:
            output, true_w = frame.update.output, frame.truth_velocity_w
            if output is not None and true_w is not None:
                errors.append(output.world_T_body.R.dot(output.velocity_b) - true_w)
        return np.array(errors).reshape(-1, 3)

    def drift_share(self) -> float:
        """Return the last horizontal position error, without any alignment, as a share of the true path.

        Raises:
            EvaluationError: if there is no output whose truth is known, or the truth does not move.
        """
        errors, path_m = self.position_errors(), self.truth().path_length_m()
        if not len(errors) or path_m == 0:
            raise EvaluationError("no error, or no path: no drift")
        return float(np.hypot(*errors[-1, :2])) / path_m

    def relative_nees(self) -> float:
        """Return the mean NEES per degree of freedom of the poses relative to their keyframes, all TRACKING frames.

        Raises:
            EvaluationError: if there is none whose truth is known.
        """
        truths = {frame.update.frame_id: frame.truth for frame in self.frames}
        errors, covariances = [], []
        for frame in self.frames:
            output, truth = frame.update.output, frame.truth
            if output is None or truth is None or frame.update.health.state is not VioState.TRACKING:
                continue
            keyframe = truths.get(output.keyframe_id)
            if keyframe is not None and output.keyframe_id != output.frame_id:
                true_relative = keyframe.inverse() @ truth
                errors.append((true_relative.inverse() @ output.relative_pose_T).log())
                covariances.append(output.pose_covariance_6x6)
        return _nees(errors, covariances)

    def horizontal_nees(self) -> float:
        """Return the mean NEES per degree of freedom of x and y of the composed poses, from the second one on.

        What the first pose did not know, where it was and how it was turned, is no error of the poses that begin there.

        Raises:
            EvaluationError: if there is none whose truth is known.
        """
        composed = [(frame.local, frame.truth) for frame in self.frames if frame.local and frame.truth]
        errors, covariances = [], []
        for local, truth in composed[1:]:
            first_local, first_truth = composed[0]
            true_place = (first_local.L_T_B @ first_truth.inverse() @ truth).t
            errors.append((local.L_T_B.t - true_place)[:2])
            covariance = local.L_T_B.R.dot(local.covariance_6x6[3:, 3:]).dot(local.L_T_B.R.T)
            covariances.append(covariance[:2, :2])
        return _nees(errors, covariances)


def run_trial(
    source: TrialSource,
    config: VioConfig,
    warm_start: WarmStartPose | None = None,
    *,
    clock_ns: Callable[[], int] | None = None,
    logger: logging.Logger = _LOGGER,
    listeners: Iterable[Listener] = (),
) -> Trial:
    """Run the strategy that a configuration names over all data of a source.

    Args:
        source: of the data.
        config: the configuration.
        warm_start: to begin with, at the first frame; None to wait for stillness.
        clock_ns: what the strategy and the times of its stages see; None for the time of the newest data.
        logger: for events.
        listeners: called with each update.

    Raises:
        ValueError: if there is no such strategy.
        StrategyNotAvailableError: if this build does not have it.
    """
    return _Run(source, config, clock_ns, logger, listeners).all(warm_start)


class _Run:
    def __init__(
        self,
        source: TrialSource,
        config: VioConfig,
        clock_ns: Callable[[], int] | None,
        logger: logging.Logger,
        listeners: Iterable[Listener],
    ) -> None:
        clock_ns = clock_ns or (lambda: self._newest_ns)
        calibration = source.calibration
        self._source = source
        self._newest_ns = 0
        self._buffer = ImuBuffer(wait=lambda *_: None)  # what there will be is there
        self._strategy = build_vio_strategy(config, calibration, clock_ns, logger)
        self._worker = VioWorker(
            self._strategy,
            config,
            calibration,
            self._buffer,
            clock_ns=clock_ns,
            logger=logger,
            listeners=listeners,
        )
        scale_sigma = 0.0 if config.agl_source is AglSource.NONE else config.agl_scale_sigma
        self._composer = OdometryComposer(LocalAlignment.NORTH, world_is_north=True, agl_scale_sigma=scale_sigma)

    def all(self, warm_start: WarmStartPose | None) -> Trial:
        if warm_start is not None:
            self._worker.request_warm_start(warm_start)
        frames = tuple(frame for event in self._source.events() if (frame := self._take(event)) is not None)
        return Trial(frames, self._worker.counters())

    def _take(self, event: Event) -> TrialFrame | None:
        if isinstance(event, NavCameraFrame):
            self._newest_ns = max(self._newest_ns, event.capture_timestamp)
            update = self._worker.process_one(event)
            return None if update is None else self._frame(update)
        self._newest_ns = max(self._newest_ns, event.t_ns)
        if isinstance(event, ImuSample):
            self._buffer.add(event)
        elif (add_height := getattr(self._strategy, "add_height", None)) is not None:  # not all make use of it
            add_height(event.t_ns, event.height_m, event.sigma_m)
        return None

    def _frame(self, update: VioUpdate) -> TrialFrame:
        output, t_ns = update.output, update.t_ns
        local = None
        if output is not None:
            if not self._composer.knows(output.keyframe_id):
                self._composer.anchor(output)
            local = self._composer.compose(output)
        return TrialFrame(update, local, self._source.truth(t_ns), self._source.truth_velocity_w(t_ns))


def _estimated(frame: TrialFrame) -> SE3 | None:
    return None if frame.update.output is None else frame.update.output.world_T_body


def _timed(poses: list[tuple[int, SE3]]) -> TimedPoses:
    return TimedPoses(
        np.array([t_ns for t_ns, _ in poses], np.int64),
        np.array([pose.t for _, pose in poses]).reshape(-1, 3),
        np.array([pose.quat_wxyz() for _, pose in poses]).reshape(-1, 4),
    )


def _nees(errors: list[Array], covariances: list[Array]) -> float:
    if not errors:
        raise EvaluationError("no pose with its truth: no NEES")
    return nees_per_dof(np.array(errors), np.array(covariances))
