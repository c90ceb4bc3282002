# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a frame: a strategy returns one of four classes, and all that follows reads it."""

import dataclasses
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from viso.companion.vio.types import VioOutput, VioState


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _FrameResult:
    """The fields that all results have.

    Attributes:
        frame_id, sequence: of the frame.
        t_ns: of the frame, in the IMU's time.
        reason: of the last change of state, or the present problem.
        consecutive_lost: frames since the last usable one.
        bias_norm: of the estimated bias.
        innovation_ratio: running mean of the inliers' normalised innovation squared per degree of freedom.
        resets: how often the pose has jumped to another origin since the start.
        stage_ms: duration of each stage, and ``total``.
        counters: of other events since the start, such as restarts of an engine.
        dropped: frames that gave way to newer ones, since the start.
    """

    frame_id: uuid.UUID
    sequence: int
    t_ns: int
    reason: str
    consecutive_lost: int = 0
    bias_norm: float = 0.0
    innovation_ratio: float = 1.0
    resets: int = 0
    stage_ms: Mapping[str, float] = field(default_factory=dict)
    counters: Mapping[str, int] = field(default_factory=dict)
    dropped: int = 0

    def lost(self, reason: str) -> "Lost":
        """Return the result that takes this one's place when the pose is lost after the frame."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(Lost)}
        return Lost(**(fields | {"reason": reason}))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Initializing(_FrameResult):
    """There is no state yet, and so no output: nothing may go to the autopilot.

    Attributes:
        is_warm: whether the strategy begins from a given state, so that its world stays what it was.
    """

    state: ClassVar = VioState.INIT
    output: ClassVar[None] = None
    is_warm: bool = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tracking(_FrameResult):
    """The pose is as good as its covariance says."""

    state: ClassVar = VioState.TRACKING
    output: VioOutput


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Degraded(_FrameResult):
    """The pose deserves less weight; the covariance of the output is already inflated."""

    state: ClassVar = VioState.DEGRADED
    output: VioOutput


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lost(_FrameResult):
    """There is no pose, and there will be none before a warm start or ``auto_reinit_s``."""

    state: ClassVar = VioState.LOST
    output: ClassVar[None] = None


Result = Tracking | Degraded | Initializing | Lost
