# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimator's door for external navigation: which samples are taken, and with what time.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (writeExtNavData, writeExtNavVelData, writeBodyFrameOdom). Times are ms
since boot, unsigned 32 bit: a stamp that steps backwards is a long way off, and therefore taken.
"""

import math
from collections import Counter, deque
from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar

import numpy as np

from ap_core.cint import i32, later_ms, u32
from ap_core.fmath import f32, ieee754
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Rule
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.obs_ring import NOTHING_DUE, RECALL_WINDOW_MS, ObsRing, RingSizes, Timed

EXT_NAV_INTERVAL_MIN_MS: Final = 20
SENSOR_INTERVAL_MIN_MS: Final = 50
HALF_FILTER_STEP_MS: Final = 6  # of a main loop of 400 Hz
DT_EKF_AVG: Final = f32(0.0125)  # where the firmware's average settles at that rate
MIN_YAW_ERR: Final = f32(math.radians(5))
_U32: Final = 0xFFFFFFFF  # as of u32, which takes a call

_SIGN: Final = 1 << 31

T = TypeVar("T", bound=Timed)


@ieee754
def _yaw_of(quat: Quaternion) -> np.float32:
    return quat.get_euler_yaw()


class PoseSample(NamedTuple):
    """A position (m, NED) and its error; ``pos_reset`` after the camera's frame has jumped."""

    time_ms: int
    pos: Vector3f
    pos_err: np.float32
    pos_reset: bool


class YawSample(NamedTuple):
    """A yaw and its error in rad."""

    time_ms: int
    yaw: np.float32
    yaw_err: np.float32


class VelocitySample(NamedTuple):
    """A velocity (m/s, NED) and its error."""

    time_ms: int
    vel: Vector3f
    err: np.float32


class OdometrySample(NamedTuple):
    """A velocity (m/s, FRD) and its error, at a place on the vehicle (m, FRD)."""

    time_ms: int
    vel: Vector3f
    vel_err: np.float32
    pos_offset: Vector3f


class FilterOutcome(NamedTuple):
    """What the estimator did with a sample: took or refused it at the door and, by the model, what came of it later.

    Attributes:
        kind: ``pose`` (its north and east), ``height`` (its down), ``yaw``, ``velocity`` or ``odometry``.
        rule: what decided it, one of ``ingest_rules.RULES``.
        time_ms: when it was observed, in ms since boot.
        ratio: of its innovation to the gate, where it was tested.
    """

    kind: str
    rule: Rule
    time_ms: int
    ratio: float | None


class ExtNavIngest:
    """Takes samples or refuses them, counts both, and keeps what waits for the horizon.

    Args:
        counts: what became of how many samples, by kind (``pose``, ``yaw``, ``velocity``, ``odometry``) and code of
            the rule.
        get_float: returns a parameter by its name after ``EK3_``.

    Attributes:
        initialised: whether the estimator has a state.
        horizon_ms: the time of the oldest inertial data, to which later measurements are compared.
        has_due: whether anything may have come due as the horizon moved last.
        have_pose, have_odometry: whether one has ever been taken.
        have_velocity: the same of a velocity (useExtNavVel).
        pose_stamp_ms: the stamp of the last pose taken, before any correction (extNavMeasTime_ms).
        velocity_stamp_ms: the same of the last velocity taken.
        odometry_ms: the time of the last odometry taken.
        odometry_err: its error in m/s.
        on_outcome: hears what becomes of each sample: at the door and, if it was taken, when it leaves the buffer.
    """

    def __init__(self, counts: Counter[tuple[str, str]], get_float: Callable[[str], float]) -> None:
        self.counts = counts
        self._get_float = get_float
        self.on_outcome: Callable[[FilterOutcome], None] | None = None
        self._is_set_up = False
        self._make_rings(0, 0)
        self.reset()

    def set_up(self, sizes: RingSizes | None) -> None:
        """Make the buffers, once a boot; None when no source set names external navigation."""
        self._is_set_up = True
        if sizes is not None:
            self._make_rings(sizes.ext_nav, sizes.slow)

    def _make_rings(self, ext_nav: int, slow: int) -> None:
        self._poses: ObsRing[PoseSample] = ObsRing(ext_nav)
        self._yaws: ObsRing[YawSample] = ObsRing(ext_nav)
        self._velocities: ObsRing[VelocitySample] = ObsRing(ext_nav)
        self._odometry: ObsRing[OdometrySample] = ObsRing(slow)
        self._waiting_ms: dict[str, deque[int]] = {kind: deque() for kind in ("pose", "yaw", "velocity", "odometry")}
        self._waiting = tuple(self._waiting_ms.values())

    def reset(self) -> None:
        """Forget everything, as the estimator restarts (NavEKF3_core::InitialiseVariables)."""
        self.initialised = False
        self.horizon_ms = 0
        self.has_due = True
        self.have_pose = self.have_velocity = self.have_odometry = False
        self.pose_stamp_ms = 0
        self.velocity_stamp_ms = 0
        self.odometry_ms = 0
        self.odometry_err = f32(0)
        self._reset_time_ms = 0
        for ring in (self._poses, self._yaws, self._velocities, self._odometry):
            ring.clear()
        for waiting_ms in self._waiting_ms.values():
            waiting_ms.clear()

    def write_pose(
        self,
        pos: Vector3f,
        quat: Quaternion,
        errors: tuple[np.float32, np.float32],
        stamp_ms: int,
        delay_ms: int,
        reset_ms: int,
    ) -> Rule:
        """Take a position and a yaw, or refuse them; errors in m and rad (writeExtNavData)."""
        time_ms = self._observed_ms(stamp_ms, delay_ms)
        refusal = self._refuse_pose(pos, errors[0], stamp_ms)
        if refusal is not None:
            return self.tell("pose", refusal, time_ms)
        self.pose_stamp_ms = stamp_ms
        self.have_pose = True
        pos_reset = reset_ms != self._reset_time_ms
        self._reset_time_ms = reset_ms
        # The tuples' own way of being made takes twice as long, here and below.
        sample = tuple.__new__(PoseSample, (time_ms, pos, errors[0], pos_reset))
        taken = self._push("pose", self._poses, sample)
        if quat.is_nan() or math.isnan(errors[1]):
            self.tell("yaw", rules.YAW_NOT_A_NUMBER, time_ms)
        else:
            error = errors[1]
            yaw_err = MIN_YAW_ERR if error < MIN_YAW_ERR else error
            self._push("yaw", self._yaws, tuple.__new__(YawSample, (time_ms, _yaw_of(quat), yaw_err)))
        return taken

    def _refuse_pose(self, pos: Vector3f, pos_err: np.float32, stamp_ms: int) -> Rule | None:
        if not self._is_set_up:
            return rules.NOT_STARTED
        if pos.is_nan() or math.isnan(pos_err):
            return rules.NOT_A_NUMBER
        if stamp_ms - self.pose_stamp_ms & _U32 < EXT_NAV_INTERVAL_MIN_MS:
            return rules.TOO_SOON
        return None if self.initialised else rules.NOT_INITIALISED

    def write_velocity(self, vel: Vector3f, err: np.float32, stamp_ms: int, delay_ms: int) -> Rule:
        """Take a velocity, even before there is a state, or refuse it (writeExtNavVelData)."""
        time_ms = self._observed_ms(stamp_ms, delay_ms)
        refusal = self._refuse_velocity(vel, err, stamp_ms)
        if refusal is not None:
            return self.tell("velocity", refusal, time_ms)
        self.velocity_stamp_ms = stamp_ms
        self.have_velocity = True
        return self._push("velocity", self._velocities, tuple.__new__(VelocitySample, (time_ms, vel, err)))

    def _refuse_velocity(self, vel: Vector3f, err: np.float32, stamp_ms: int) -> Rule | None:
        if not self._is_set_up:
            return rules.NOT_STARTED
        if vel.is_nan() or math.isnan(err):
            return rules.NOT_A_NUMBER
        too_soon = stamp_ms - self.velocity_stamp_ms & _U32 < EXT_NAV_INTERVAL_MIN_MS
        return rules.TOO_SOON if too_soon else None

    def write_odometry(
        self,
        quality: np.float32,
        deltas: tuple[Vector3f, Vector3f, np.float32],
        stamp_ms: int,
        delay_ms: int,
        pos_offset: Vector3f,
    ) -> Rule:
        """Take a body odometry, or refuse it; deltas are m, rad and s (writeBodyFrameOdom).

        The interval is measured from the last sample's time with the delay taken off, so it may be shorter than 50 ms
        by the delay.
        """
        time_ms = u32(stamp_ms - delay_ms)
        refusal = self._refuse_odometry(quality, deltas, stamp_ms, pos_offset)
        if refusal is not None:
            return self.tell("odometry", refusal, time_ms)
        self.odometry_ms = time_ms
        self.have_odometry = True
        best, worst = f32(self._get_float("VIS_VERR_MIN")), f32(self._get_float("VIS_VERR_MAX"))
        with np.errstate(over="ignore", invalid="ignore"):
            vel = deltas[0] * (f32(1) / deltas[2])
            self.odometry_err = best + (worst - best) * (f32(1) - f32(0.01) * quality)
        return self._push("odometry", self._odometry, OdometrySample(time_ms, vel, self.odometry_err, pos_offset))

    def _refuse_odometry(
        self, quality: np.float32, deltas: tuple[Vector3f, Vector3f, np.float32], stamp_ms: int, pos_offset: Vector3f
    ) -> Rule | None:
        del_pos, del_ang, del_time = deltas
        if not self._is_set_up:
            return rules.NOT_STARTED
        if math.isnan(quality) or math.isnan(del_time) or any(v.is_nan() for v in (del_pos, del_ang, pos_offset)):
            return rules.NOT_A_NUMBER
        if u32(stamp_ms - self.odometry_ms) < SENSOR_INTERVAL_MIN_MS:
            return rules.TOO_SOON
        if del_time < DT_EKF_AVG:
            return rules.TOO_SHORT
        return None if self.initialised else rules.NOT_INITIALISED

    def _observed_ms(self, stamp_ms: int, delay_ms: int) -> int:
        """Return the time of the observation, never before the horizon: what comes late is fused as if in time."""
        return later_ms(stamp_ms - delay_ms - HALF_FILTER_STEP_MS & _U32, self.horizon_ms)

    def _push(self, kind: str, ring: ObsRing[T], sample: T) -> Rule:
        if not ring.exists:
            return self.tell(kind, rules.NO_BUFFER, sample.time_ms)
        waiting_ms = self._waiting_ms[kind]
        if ring.push(sample):
            self.tell(kind, rules.OVERWRITTEN, waiting_ms.popleft())
        waiting_ms.append(sample.time_ms)
        return self.tell(kind, rules.TAKEN, sample.time_ms)

    def move_horizon(self, horizon_ms: int) -> None:
        """Move the horizon on, and see whether anything comes due; in most steps nothing does."""
        self.horizon_ms = horizon_ms
        self.has_due = False
        for waiting_ms in self._waiting:
            if waiting_ms and not (horizon_ms - waiting_ms[0]) & _SIGN:  # as i32(...) >= 0, without a call
                self.has_due = True
                return

    def _recall(self, kind: str, ring: ObsRing[T]) -> T | None:
        if not self.has_due:
            return None
        recalled = ring.recall(self.horizon_ms)
        if recalled is NOTHING_DUE:
            return None
        sample, superseded, too_old = recalled
        waiting_ms = self._waiting_ms[kind]
        if superseded or too_old:
            left = superseded + too_old + (sample is not None)
            self._tell_lost(kind, [waiting_ms.popleft() for _ in range(left)])
        else:
            waiting_ms.popleft()
        return sample

    def _tell_lost(self, kind: str, left_ms: list[int]) -> None:
        """Report all that left the buffer in a step but the one that is recalled, the last that is not too old."""
        fresh_ms = []
        for time_ms in left_ms:
            if i32(self.horizon_ms - time_ms) < RECALL_WINDOW_MS:
                fresh_ms.append(time_ms)
            else:
                self.tell(kind, rules.TOO_OLD, time_ms)
        for time_ms in fresh_ms[:-1]:
            self.tell(kind, rules.SUPERSEDED, time_ms)

    def recall_pose(self) -> PoseSample | None:
        """Take out the pose that has come due."""
        return self._recall("pose", self._poses)

    def recall_yaw(self) -> YawSample | None:
        """Take out the yaw that has come due."""
        return self._recall("yaw", self._yaws)

    def recall_velocity(self) -> VelocitySample | None:
        """Take out the velocity that has come due."""
        return self._recall("velocity", self._velocities)

    def recall_odometry(self) -> OdometrySample | None:
        """Take out the odometry that has come due."""
        return self._recall("odometry", self._odometry)

    def tell(self, kind: str, rule: Rule, time_ms: int, ratio: float | None = None) -> Rule:
        """Count and tell what became of a sample, as in a `FilterOutcome`; return the rule."""
        self.counts[kind, rule.code] += 1
        if self.on_outcome is not None:
            self.on_outcome(tuple.__new__(FilterOutcome, (kind, rule, time_ms, ratio)))
        return rule
