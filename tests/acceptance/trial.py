# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a strategy was on data whose truth is known: what the measured figures and the acceptance tests go by."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from viso.companion.odometry.composer import LocalPose, OdometryComposer
from viso.companion.sources.base import SourceError
from viso.companion.sources.euroc import EurocRecording
from viso.companion.vio.config import LocalAlignment, VioConfig
from viso.companion.vio.result import Result
from viso.companion.vio.runtime import EventSource, run_through
from viso.companion.vio.types import ImuBias, VioState, WarmStartPose
from viso.geometry.errors import AbsoluteError, EvaluationError, absolute_error
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp
from viso.geometry.trajectory import Trajectory

THREE_SIGMA: Final = 14.16  # of the normalised square of three numbers: 99.73 %

Truth = Callable[[int], SE3 | None]
"""Returns world_T_body at a time of the IMU's clock, None where it is not known."""


@dataclass(frozen=True, slots=True, eq=False)
class TrialFrame:
    """A frame, what the strategy made of it, and the truth.

    Attributes:
        result: of the frame; its output is None in INIT and LOST.
        local: the composed pose, north as its alignment and the first output as its origin; None without output.
        truth: world_T_body, None where it is not known.
    """

    result: Result
    local: LocalPose | None
    truth: SE3 | None


@dataclass(frozen=True, slots=True)
class Claims:
    """What a strategy claimed in the state TRACKING.

    Attributes:
        frames: in that state.
        refuted: those of them whose composed place is beyond 3 sigma.
        worst_m: error of a composed place in that state.
        unsaid_m: error of a composed place that is beyond 3 sigma.
    """

    frames: int
    refuted: int
    worst_m: float
    unsaid_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """How a strategy did.

    Attributes:
        frames: those that the strategy processed.
    """

    frames: tuple[TrialFrame, ...]

    def states(self) -> Counter[VioState]:
        """Return how many frames ended in which state."""
        return Counter(frame.result.state for frame in self.frames)

    def estimate(self) -> Trajectory:
        """Return the poses of all outputs, in the strategy's world."""
        return Trajectory.of(
            [(frame.result.t_ns, pose) for frame in self.frames if (pose := _estimated(frame)) is not None]
        )

    def truth(self) -> Trajectory:
        """Return the true poses at all frames where they are known."""
        return Trajectory.of([(frame.result.t_ns, frame.truth) for frame in self.frames if frame.truth is not None])

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

    def drift_share(self) -> float:
        """Return the last horizontal position error, without any alignment, as a share of the true path.

        Raises:
            EvaluationError: if there is no output whose truth is known, or the truth does not move.
        """
        errors, path_m = self.position_errors(), self.truth().path_length_m
        if not len(errors) or path_m == 0:
            raise EvaluationError("no error, or no path: no drift")
        return float(np.hypot(*errors[-1, :2])) / path_m

    def relative_nees(self) -> float:
        """Return the mean NEES per degree of freedom of the poses relative to their keyframes, all TRACKING frames.

        Raises:
            EvaluationError: if there is none whose truth is known.
        """
        truths = {frame.result.frame_id: frame.truth for frame in self.frames}
        errors, covariances = [], []
        for frame in self.frames:
            output, truth = frame.result.output, frame.truth
            if output is None or truth is None or frame.result.state is not VioState.TRACKING:
                continue
            keyframe = truths.get(output.keyframe_id)
            if keyframe is not None and output.keyframe_id != output.frame_id:
                true_relative = keyframe.inverse() @ truth
                errors.append((true_relative.inverse() @ output.relative_pose_T).log())
                covariances.append(output.pose_covariance_6x6)
        return _nees(errors, covariances)

    def claims(self) -> "Claims":
        """Return what the TRACKING frames claimed, and whether that was so: composed poses, from the second one on."""
        composed = [frame for frame in self.frames if frame.local and frame.truth]
        errors, refuted, unsaid = [], 0, 0.0
        for frame in composed[1:]:
            local, error_m = frame.local, _place_error(composed[0], frame)
            if local is None or frame.result.state is not VioState.TRACKING:
                continue
            covariance = local.L_T_B.R.dot(local.covariance_6x6[3:, 3:]).dot(local.L_T_B.R.T)
            errors.append(float(np.linalg.norm(error_m)))
            if error_m.dot(np.linalg.solve(covariance, error_m)) > THREE_SIGMA:
                refuted += 1
                unsaid = max(unsaid, errors[-1])
        return Claims(len(errors), refuted, max(errors, default=0.0), unsaid)

    def horizontal_nees(self) -> float:
        """Return the mean NEES per degree of freedom of x and y of the composed poses, from the second one on.

        What the first pose did not know, where it was and how it was turned, is no error of the poses that begin there.

        Raises:
            EvaluationError: if there is none whose truth is known.
        """
        composed = [frame for frame in self.frames if frame.local and frame.truth]
        errors, covariances = [], []
        for frame in composed[1:]:
            local = frame.local
            assert local is not None
            errors.append(_place_error(composed[0], frame)[:2])
            covariance = local.L_T_B.R.dot(local.covariance_6x6[3:, 3:]).dot(local.L_T_B.R.T)
            covariances.append(covariance[:2, :2])
        return _nees(errors, covariances)


def run_trial(
    source: EventSource,
    config: VioConfig,
    warm_start: WarmStartPose | None = None,
    *,
    truth: Truth = lambda _t_ns: None,
    **options: Any,
) -> Trial:
    """Return how the strategy that a configuration names does on all data of a source.

    Args:
        source: of the data.
        config: the configuration.
        warm_start: to begin with, at the first frame; None to wait for stillness.
        truth: of the source.
        options: others of ``run_through``.
    """
    composer = OdometryComposer(LocalAlignment.NORTH, world_is_north=True, agl_scale_sigma=config.scale_sigma)
    results = run_through(source, config, warm_start, **options)
    frames = (TrialFrame(result, composer.compose_alone(result.output), truth(result.t_ns)) for result in results)
    return Trial(tuple(frames))


def _place_error(first: TrialFrame, frame: TrialFrame) -> Array:
    """Return [3] in m, the composed less the true place, as seen from the first composed pose."""
    assert first.local is not None
    assert first.truth is not None
    assert frame.local is not None
    assert frame.truth is not None
    error: Array = frame.local.L_T_B.t - (first.local.L_T_B @ first.truth.inverse() @ frame.truth).t
    return error


def _estimated(frame: TrialFrame) -> SE3 | None:
    return None if frame.result.output is None else frame.result.output.world_T_body


def _nees(errors: list[Array], covariances: list[Array]) -> float:
    if not errors:
        raise EvaluationError("no pose with its truth: no NEES")
    return nees_per_dof(np.array(errors), np.array(covariances))


def nees_per_dof(errors: Array, covariances: Array) -> float:
    """Return the mean normalised estimation error squared, divided by its degrees of freedom; 1 for an honest filter.

    Args:
        errors: [N, D].
        covariances: [N, D, D].
    """
    solved = np.linalg.solve(covariances, errors[..., None])[..., 0]
    return float(np.mean(np.sum(errors * solved, axis=-1)) / errors.shape[-1])


def disturbed_start(recording: EurocRecording, seed: int) -> WarmStartPose:
    """Return the true state at the first picture of a recording with errors: 1 degree and 0.2 m/s on each axis.

    Raises:
        SourceError: if the truth is not known there.
    """
    image = recording.images[0]
    pose, velocity_w = recording.truth(image.t_ns), recording.truth_velocity_w(image.t_ns)
    if pose is None or velocity_w is None:
        raise SourceError(f"{image.path}: no ground truth at the first picture, so no warm start")
    rng = np.random.default_rng(seed)
    rotation = pose.R.dot(so3_exp(rng.normal(0, np.radians(1.0), 3)))
    velocity_w = velocity_w + rng.normal(0, 0.2, 3)
    return WarmStartPose(SE3(rotation, pose.t).inverse(), rotation.T.dot(velocity_w), ImuBias.zero())
