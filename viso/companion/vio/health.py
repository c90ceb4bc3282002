# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The health of a strategy, from the facts about each frame: INIT, TRACKING, DEGRADED or LOST."""

import math
import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from viso.companion.vio.config import VioConfig
from viso.companion.vio.imu import IMU_EMPTY
from viso.companion.vio.types import VioHealth, VioState

MIN_COVERAGE: Final = 0.25
MAX_MRE_PX: Final = 3.0
MAX_GROWTH: Final = 4.0  # of a variance
WELL_KNOWN_M_S: Final = 0.1  # a sigma below this, per second since the keyframe, is never too large
GROWTH_FRAMES: Final = 50
MAX_INNOVATION_RATIO: Final = 4.0
LOST_INLIERS: Final = 8
GOOD_FRAMES: Final = 2
CLEAR_FRAMES: Final = 3

NON_FINITE: Final = "non_finite"
NO_MODEL: Final = "no_model"
INNOVATION_REFUSED: Final = "innovation_refused"
TOO_FEW_INLIERS: Final = "too_few_inliers"
FEW_INLIERS: Final = "few_inliers"
LOW_COVERAGE: Final = "low_coverage"
HIGH_MRE: Final = "high_mre"
COVARIANCE_GROWTH: Final = "covariance_growth"
UNSURE_POSITION: Final = "unsure_position"
UNSURE_VELOCITY: Final = "unsure_velocity"
INNOVATION_RATIO: Final = "innovation_ratio"
SCALE_UNOBSERVED: Final = "scale_unobserved"

CONSTRUCTION: Final = "construction"
WAITING: Final = "waiting for stillness or a warm start"
WARM_START: Final = "warm_start"
GOOD: Final = "good frames after the warm start"
STATIC: Final = "static initialisation"
CLEAR: Final = "all clear"
AUTO_REINIT: Final = "auto_reinit"

OnTransition = Callable[[VioState, VioState, str], None]


@dataclass(frozen=True, slots=True)
class Growth:
    """The uncertainty of the translation since the keyframe, for each frame in motion.

    Attributes:
        trace_m2: of its covariance, before inflation.
        age_s: since the keyframe, above 0.
        depth_m: of the scene; 1 where it is not known.
    """

    trace_m2: float
    age_s: float
    depth_m: float = 1.0


@dataclass(frozen=True, slots=True)
class FrameFacts:
    """The facts about a frame, by which its health is judged.

    Attributes:
        inliers: features that agree with the geometric model.
        coverage: share of grid cells with an inlier, 0 to 1.
        mre_px: mean reprojection error of the inliers.
        growth: how well the translation since the keyframe is known; None where that shows nothing, as in a keyframe
            or while standing still.
        innovation_ratio: running mean of the inliers' normalised innovation squared per degree of freedom.
        bias_norm: of the estimated bias.
        imu_fault: what is wrong with the inertial data, or None.
        has_model: whether a geometric model was found.
        innovation_refused: whether the gates refused all that the frame measured.
        is_finite: whether the result of the frame is finite and its covariance sound.
        position_sigma_m: of the horizontal position since the start; None where it is not known.
        velocity_sigma_m_s: of the axis of the velocity that is known worst; None where it is not known.
        scale_unobserved: whether neither a height nor the accelerometer has fixed the scale yet.
        initialised: whether the strategy found its state by itself with this frame (standing still).
    """

    inliers: int
    coverage: float
    mre_px: float
    growth: Growth | None = None
    innovation_ratio: float = 1.0
    bias_norm: float = 0.0
    imu_fault: str | None = None
    has_model: bool = True
    innovation_refused: bool = False
    is_finite: bool = True
    position_sigma_m: float | None = None
    velocity_sigma_m_s: float | None = None
    scale_unobserved: bool = False
    initialised: bool = False


class HealthMachine:
    """The health of a strategy: fed by one thread, read by any.

    Args:
        config: min_tracked, lost_frames_fatal, auto_reinit_s and the bounds of sigmas decide.
        on_transition: called with the old state, the new one and the reason, after each change.
    """

    def __init__(self, config: VioConfig, on_transition: OnTransition = lambda old, new, reason: None) -> None:
        self._config = config
        self._on_transition = on_transition
        self._usual: deque[Growth] = deque(maxlen=GROWTH_FRAMES)  # of the last frames in TRACKING
        self._warm = False
        self._streak = 0  # of good frames in INIT, of clear ones in DEGRADED
        self._bias_norm = 0.0
        self._lost_since_ns = 0
        self._times_left_init = 0
        self._health = VioHealth(VioState.INIT, 0, 0.0, CONSTRUCTION)

    @property
    def state(self) -> VioState:
        """The state."""
        return self._health.state

    @property
    def is_warm(self) -> bool:
        """Whether the state to begin from was given."""
        return self._warm

    @property
    def resets(self) -> int:
        """The number of exits from INIT after the first; each is a jump of the pose."""
        return max(self._times_left_init - 1, 0)

    def snapshot(self) -> VioHealth:
        """Return the health; never blocks, from any thread."""
        return self._health

    def feed(self, facts: FrameFacts, t_ns: int) -> tuple[VioState, str]:
        """Judge a frame; return the state after it, and the reason.

        A frame that leaves INIT is judged like any other, so it may end in DEGRADED at once. In LOST nothing changes.
        """
        self._bias_norm = facts.bias_norm
        if self.state is VioState.INIT:
            self._leave_init(facts)
        if self.state in (VioState.TRACKING, VioState.DEGRADED):
            self._judge(facts, t_ns)
        return self._health.state, self._health.reason

    def fail(self, reason: str, t_ns: int) -> None:
        """Go to LOST at once, as for a state that is no longer finite; no effect when already there."""
        if self.state is not VioState.LOST:
            self._lost_since_ns = t_ns
            self._set(VioState.LOST, reason, lost=self._health.consecutive_lost + 1)

    def warm_start(self) -> None:
        """Go to INIT, because a state was given."""
        self._restart(WARM_START, warm=True)

    def start_over(self) -> None:
        """Go to INIT, because the state is gone."""
        self._restart(AUTO_REINIT, warm=False)

    def auto_reinit(self, t_ns: int) -> bool:
        """Go from LOST to INIT if that is due; return whether it was."""
        after_s = self._config.auto_reinit_s
        due = self.state is VioState.LOST and after_s > 0 and t_ns - self._lost_since_ns >= round(after_s * 1e9)
        if due:
            self.start_over()
        return due

    def _restart(self, reason: str, *, warm: bool) -> None:
        self._warm = warm
        self._usual.clear()
        self._set(VioState.INIT, reason, lost=0, streak=0)

    def _leave_init(self, facts: FrameFacts) -> None:
        good = facts.inliers >= self._config.min_tracked and self._lost_reason(facts) is None
        self._streak = self._streak + 1 if good else 0
        if facts.initialised or (self._warm and self._streak >= GOOD_FRAMES):
            self._times_left_init += 1
            self._set(VioState.TRACKING, STATIC if facts.initialised else GOOD)
        else:
            self._set(VioState.INIT, WARM_START if self._warm else WAITING, streak=self._streak)

    def _judge(self, facts: FrameFacts, t_ns: int) -> None:
        lost = self._lost_reason(facts)
        problem = lost or self._degraded_reason(facts)
        count = self._health.consecutive_lost + 1 if lost else 0
        was_degraded = self.state is VioState.DEGRADED
        if lost and count >= self._config.lost_frames_fatal:
            self._lost_since_ns = t_ns
            self._set(VioState.LOST, lost, lost=count)
        elif problem:
            self._set(VioState.DEGRADED, problem, lost=count)
        elif was_degraded and self._streak + 1 < CLEAR_FRAMES:
            self._set(VioState.DEGRADED, self._health.reason, streak=self._streak + 1)
        else:
            self._set(VioState.TRACKING, CLEAR if was_degraded else self._health.reason)
            if facts.growth is not None:
                self._usual.append(facts.growth)

    def _lost_reason(self, facts: FrameFacts) -> str | None:
        if not facts.is_finite:
            return NON_FINITE
        if facts.imu_fault == IMU_EMPTY:
            return IMU_EMPTY
        if facts.inliers < LOST_INLIERS:
            return TOO_FEW_INLIERS
        if not facts.has_model:
            return NO_MODEL
        return INNOVATION_REFUSED if facts.innovation_refused else None

    def _degraded_reason(self, facts: FrameFacts) -> str | None:
        # Each check states the good case, so that a NaN is a problem too.
        if facts.inliers < self._config.min_tracked:
            return FEW_INLIERS
        if not facts.coverage >= MIN_COVERAGE:
            return LOW_COVERAGE
        if not facts.mre_px <= MAX_MRE_PX:
            return HIGH_MRE
        if facts.growth is not None and not self._is_usual(facts.growth):
            return COVARIANCE_GROWTH
        if not facts.innovation_ratio <= MAX_INNOVATION_RATIO:
            return INNOVATION_RATIO
        if facts.position_sigma_m is not None and not facts.position_sigma_m <= self._config.max_position_sigma_m:
            return UNSURE_POSITION
        if facts.velocity_sigma_m_s is not None and not facts.velocity_sigma_m_s <= self._config.max_velocity_sigma_m_s:
            return UNSURE_VELOCITY
        return facts.imu_fault or (SCALE_UNOBSERVED if facts.scale_unobserved else None)

    def _is_usual(self, growth: Growth) -> bool:
        """Return whether a translation's uncertainty is like that of earlier ones, or small enough.

        The allowed sigma doubles at twice the depth, and grows with a keyframe older than the earlier ones. A younger
        keyframe does not lower it, because the noise of the points is a floor.
        """
        if len(self._usual) < GROWTH_FRAMES:  # nothing to compare with yet
            return math.isfinite(growth.trace_m2)
        if math.sqrt(max(growth.trace_m2, 0.0)) <= WELL_KNOWN_M_S * growth.age_s:
            return True
        usual = (usual.trace_m2 / usual.depth_m**2 * max(1.0, growth.age_s / usual.age_s) for usual in self._usual)
        return growth.trace_m2 / growth.depth_m**2 <= MAX_GROWTH * statistics.median(usual)

    def _set(self, state: VioState, reason: str, *, lost: int = 0, streak: int = 0) -> None:
        old = self._health
        self._streak = streak
        # One assignment of a frozen record: a reader sees the old one or the new one.
        self._health = VioHealth(state, lost, self._bias_norm, reason)
        if state is not old.state:
            self._on_transition(old.state, state, reason)
