# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion's log: events of a strategy, each as one line of JSON."""

import json
import logging
import math
import uuid
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from viso.companion.vio.types import VioOutput, VioState, WarmStartPose

COMPONENT: Final = "vio"
PLAIN: Final = "log"  # the event of records that do not name theirs
_DEGRADED_PERIOD_NS: Final = 1_000_000_000
_LEVELS: Final = {"WARNING": "WARN"}


def finite_json(value: object) -> object:
    """Return a value as JSON takes it: NaN and infinities as None, what JSON does not know as text."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None  # numpy's float64 is a float, too
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, Mapping):
        return {str(key): finite_json(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray)):
        return [finite_json(item) for item in value]
    if hasattr(value, "tolist"):  # numpy's arrays and other scalars
        return finite_json(value.tolist())
    return str(value)


def compact_json(value: object) -> str:
    """Return a value as JSON without needless spaces, on one line."""
    return json.dumps(finite_json(value), separators=(",", ":"), allow_nan=False)


def log_event(
    logger: logging.Logger,
    level: int,
    event: str,
    msg: str,
    fields: Mapping[str, object] = MappingProxyType({}),
    *,
    strategy: str | None = None,
    frame: object = None,
    error: BaseException | None = None,
) -> None:
    """Log an event with its fields.

    Args:
        logger: whose handlers format with :class:`JsonFormatter`.
        event: what happened, for machines.
        msg: what happened, for people.
        fields: anything else; their names must not be those of the standing keys.
        error: whose traceback to log with it.
    """
    extra = {"event": event, "strategy": strategy, "frame": frame, "fields": fields}
    logger.log(level, "%s", msg, extra=extra, exc_info=error, stacklevel=2)


class JsonFormatter(logging.Formatter):
    """Formats any record as one line of JSON, also those that know nothing of events."""

    def __init__(self, clock_ns: Callable[[], int]) -> None:
        super().__init__()
        self._clock_ns = clock_ns

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, without its end."""
        fields = dict(getattr(record, "fields", {}))
        if record.exc_info:
            fields["exception"] = self.formatException(record.exc_info)
        standing = {
            "ts_ns": self._clock_ns(),
            "level": _LEVELS.get(record.levelname, record.levelname),
            "component": COMPONENT,
            "event": getattr(record, "event", PLAIN),
            "strategy": getattr(record, "strategy", None),
            "frame": getattr(record, "frame", None),
            "msg": record.getMessage(),
        }
        return compact_json(standing | fields | standing)  # they come first, and no field overrides them


class StrategyLog:
    """Logs what happens to a strategy."""

    def __init__(self, strategy: str, logger: logging.Logger, clock_ns: Callable[[], int]) -> None:
        self._strategy = strategy
        self._logger = logger
        self._clock_ns = clock_ns
        self._degraded_ns: int | None = None  # when a degraded frame was logged last
        self._suppressed = 0  # since then

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
        now_ns = self._clock_ns()
        if self._degraded_ns is not None and now_ns < self._degraded_ns + _DEGRADED_PERIOD_NS:
            self._suppressed += 1
            return
        suppressed, self._suppressed, self._degraded_ns = self._suppressed, 0, now_ns
        quality = output.feature_quality
        fields = {
            "parallax": quality.mean_parallax_px,
            "mre": quality.mre_px,
            "bias_norm": output.imu_bias.norm(),
            "reason": reason,
            "suppressed": suppressed,
        }
        self._event(logging.WARNING, "vio_degraded", f"VIO degraded: {reason}", fields, output.frame_id)

    def fatal(self, reason: str, error: Exception) -> None:
        """Log what ended in LOST."""
        log_event(self._logger, logging.ERROR, "vio_fatal", reason, strategy=self._strategy, error=error)

    def frame(self, output: VioOutput, stage_ms: Mapping[str, float]) -> None:
        """Log a frame, for debugging."""
        if not self._logger.isEnabledFor(logging.DEBUG):
            return
        quality = output.feature_quality
        fields = {"tracked": quality.tracked, "new": quality.new, "keyframe": output.is_keyframe, "ms": dict(stage_ms)}
        self._event(logging.DEBUG, "frame", "frame", fields, output.frame_id)
