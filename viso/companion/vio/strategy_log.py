# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The events that a strategy logs."""

import logging
import uuid
from collections.abc import Callable, Mapping

from viso.companion.vio.json_log import RateLimiter, log_event
from viso.companion.vio.types import VioOutput, VioState, WarmStartPose


class StrategyLog:
    """Logs what happens to a strategy.

    Args:
        strategy: its name.
        logger: for events.
        clock_ns: the companion's monotonic clock.
    """

    def __init__(self, strategy: str, logger: logging.Logger, clock_ns: Callable[[], int]) -> None:
        self._strategy = strategy
        self._logger = logger
        self._clock_ns = clock_ns
        self._degraded = RateLimiter()

    def _event(
        self, level: int, event: str, msg: str, fields: Mapping[str, object], frame: uuid.UUID | None = None
    ) -> None:
        log_event(self._logger, level, event, msg, fields, strategy=self._strategy, frame=frame)

    def state_change(self, old: VioState, new: VioState, reason: str, consecutive_lost: int) -> None:
        """Log a change of state, and LOST as an error, too."""
        states = {"old": old.value, "new": new.value, "reason": reason}
        self._event(logging.INFO, "state_change", f"{old.value} -> {new.value}: {reason}", states)
        if new is VioState.LOST:
            msg = f"VIO LOST after {consecutive_lost} consecutive frames; strategy={self._strategy}"
            self._event(logging.ERROR, "vio_lost", msg, {"consecutive_lost": consecutive_lost, "reason": reason})

    def warm_start_applied(self, pose: WarmStartPose) -> None:
        """Log that a state was given."""
        position = pose.body_T_world.inverse().t
        fields = {"position_enu": position, "velocity_b": pose.velocity_b, "bias_norm": pose.bias.norm()}
        self._event(logging.INFO, "warm_start_applied", "warm start applied", fields)

    def degraded(self, output: VioOutput, reason: str) -> None:
        """Log a degraded frame, at most one a second."""
        suppressed = self._degraded.admit(self._clock_ns())
        if suppressed is None:
            return
        quality = output.feature_quality
        fields = {
            "parallax": quality.mean_parallax_px,
            "mre": quality.mre_px,
            "bias_norm": output.imu_bias.norm(),
            "reason": reason,
            "suppressed": suppressed,
        }
        self._event(logging.WARNING, "vio_degraded", f"VIO degraded: {reason}", fields, output.frame_id)

    def frame(self, output: VioOutput, stage_ms: Mapping[str, float]) -> None:
        """Log a frame, for debugging."""
        if not self._logger.isEnabledFor(logging.DEBUG):
            return
        quality = output.feature_quality
        fields = {"tracked": quality.tracked, "new": quality.new, "keyframe": output.is_keyframe, "ms": dict(stage_ms)}
        self._event(logging.DEBUG, "frame", "frame", fields, output.frame_id)
