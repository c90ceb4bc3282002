# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log of a run: the result of each frame, and the figures of all."""

import math
from collections import Counter
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Final

import numpy as np

from viso.companion.odometry.composer import OdometryComposer
from viso.companion.vio.config import LocalAlignment, VioConfig
from viso.companion.vio.result import Result
from viso.companion.vio.types import VioState
from viso.geometry.errors import AbsoluteError, EvaluationError, absolute_error
from viso.geometry.pose import SE3
from viso.geometry.trajectory import Trajectory

TOTAL: Final = "total"


@dataclass(frozen=True, slots=True, eq=False)
class LoggedFrame:
    """A frame.

    Attributes:
        t_ns: its stamp, as the source gave it, in the IMU's time.
        sigma_m: of the position against the start, root mean square of the three axes; None without an output.
    """

    t_ns: int
    result: Result
    sigma_m: float | None

    @property
    def state(self) -> VioState:
        """The state after the frame."""
        return self.result.state

    @property
    def pose(self) -> SE3 | None:
        """The pose world_T_body; None without an output."""
        return None if self.result.output is None else self.result.output.world_T_body

    @property
    def total_ms(self) -> float:
        """How long the strategy took."""
        return self.result.stage_ms.get(TOTAL, 0.0)


class VioLog:
    """Keeps all frames; a listener of the pipeline.

    Attributes:
        shift_ns: offset that was added to the source's stamps; it is subtracted again.
    """

    def __init__(self, config: VioConfig) -> None:
        sigma = config.scale_sigma
        self._composer = OdometryComposer(LocalAlignment.NORTH, world_is_north=True, agl_scale_sigma=sigma)
        self.shift_ns = 0
        self.frames: list[LoggedFrame] = []

    def take(self, result: Result) -> None:
        """Add the result of a frame."""
        local = self._composer.compose_alone(result.output)
        sigma_m = None if local is None else math.sqrt(float(np.trace(local.covariance_6x6[3:, 3:])) / 3)
        self.frames.append(LoggedFrame(result.t_ns - self.shift_ns, result, sigma_m))

    @property
    def last(self) -> LoggedFrame | None:
        """The last frame, None before the first."""
        return self.frames[-1] if self.frames else None

    def states(self) -> Counter[str]:
        """Return the number of frames by state."""
        return Counter(frame.state.value for frame in self.frames)

    def trajectory(self) -> Trajectory:
        """Return the poses of all frames that have one, in the strategy's world."""
        return Trajectory.of([(frame.t_ns, frame.pose) for frame in self.frames if frame.pose is not None])

    def error(self, truth: Trajectory | None) -> AbsoluteError | None:
        """Return the error after alignment without scale; None without enough ground truth."""
        if truth is None:
            return None
        try:
            return absolute_error(self.trajectory(), truth)
        except EvaluationError:
            return None

    def summary(self, truth: Trajectory | None) -> dict[str, Any]:
        """Return the figures of the run, for people and for machines."""
        last, trajectory, error = self.last, self.trajectory(), self.error(truth)
        times_ms = [frame.total_ms for frame in self.frames]
        features = [frame.result.output.feature_quality for frame in self.frames if frame.result.output is not None]
        return {
            "frames": len(self.frames),
            "seconds": (self.frames[-1].t_ns - self.frames[0].t_ns) * 1e-9 if self.frames else 0.0,
            "states": dict(self.states()),
            "ended": None if last is None else last.state.value,
            "reason": None if last is None else last.result.reason,
            "poses": len(trajectory),
            "path_m": trajectory.path_length_m,
            "sigma_m": None if last is None else last.sigma_m,
            "tracked_median": _quantile([feature.tracked for feature in features], 50),
            "ate_m": None if error is None else error.rmse_m,
            "true_path_m": None if error is None else error.path_m,
            "scale_error": None if error is None else 1.0 / error.scale - 1.0,
            "ms_median": _quantile(times_ms, 50),
            "ms_95": _quantile(times_ms, 95),
            "dropped": 0 if last is None else last.result.dropped,
            "resets": 0 if last is None else last.result.resets,
            **({"engine": dict(last.result.counters)} if last and last.result.counters else {}),
        }


def tum_lines(trajectory: Trajectory) -> list[str]:
    """Return a trajectory as lines ``t x y z qx qy qz qw``, t in s (TUM's format)."""
    lines = []
    rows = np.hstack((trajectory.positions, np.roll(trajectory.quats_wxyz, -1, axis=1)))
    for t_ns, numbers in zip(trajectory.times_ns.tolist(), rows.tolist(), strict=True):
        lines.append(f"{Decimal(t_ns).scaleb(-9):f} " + " ".join(f"{number:.9g}" for number in numbers))
    return lines


def _quantile(values: list[Any], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None
