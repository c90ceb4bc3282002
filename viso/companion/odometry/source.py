# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ODOMETRY message of any instant, from the results of frames and the inertial data so far."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Final

import numpy as np

from mav_handlers.wire.messages import ODOMETRY
from viso.companion.odometry.composer import JUMP_M, LocalPose, OdometryComposer
from viso.companion.odometry.message import odometry_message
from viso.companion.odometry.propagation import MotionState, OdometryPropagator
from viso.companion.vio.config import LocalAlignment, VioConfig
from viso.companion.vio.result import Degraded, Initializing, Lost, Result, Tracking
from viso.companion.vio.types import FeatureQuality, ImuSample, VioState
from viso.geometry.rotation import Array

QUALITY_LOST: Final = -1
FULL_INLIERS: Final = 100
FULL_COVERAGE: Final = 0.6
JUMP_SIGMAS: Final = 3.0
DEGRADED_AFTER_NS: Final = 1_000_000_000
LOST_AFTER_NS: Final = 3_000_000_000


@dataclass(frozen=True, slots=True)
class _Loss:
    since_us: int
    state: MotionState


class ResetCounter:
    """Counts resets of the pose modulo 256, for the message; starts at 0."""

    def __init__(self) -> None:
        self.value = 0
        self._started = False

    def start(self) -> None:
        """Note an initialisation, static or by warm start; the first one is no reset."""
        if self._started:
            self.jump()
        self._started = True

    def correct(self, moved_m: Array, covariance: Array) -> None:
        """Note a correction: it counts if it moves the pose by more than 3 sigma and 0.5 m at once.

        Args:
            moved_m: from where the pose was to where it is now, at the same instant.
            covariance: [3, 3] of the position as it was stated before, in m^2, in the same axes.
        """
        distance_m = math.sqrt(moved_m.dot(moved_m))
        if distance_m <= JUMP_M:
            return
        along = moved_m / distance_m
        if distance_m > JUMP_SIGMAS * math.sqrt(along.dot(covariance).dot(along)):
            self.jump()

    def jump(self) -> None:
        """Note a jump of the pose without motion of the vehicle."""
        self.value = (self.value + 1) % 256


class OdometrySource:
    """Makes the ODOMETRY message of any instant; one thread may process frames while another serves the link.

    A strategy that restarts goes on from the last pose, or, with a warm start, from that one in the world that it
    had. A camera without frames loses the pose just as one that sees nothing: after 1 s without an output
    the state counts as degraded, after 3 s as lost. It counts as degraded too while the sigma of the position that is
    sent is above ``max_position_sigma_m``, which a strategy with only its last keyframe cannot judge.

    Args:
        config: of the odometry.
        local_alignment: of the local frame; None for north if known at the first pose, else the first heading.
        world_is_north: whether the strategy's world has an absolute yaw.
        yaw_at: returns the autopilot's ENU yaw in rad at a time, None while unknown; asked until there is a pose.

    Attributes:
        counters: numbers of frames used, and of frames not used by reason.
    """

    def __init__(
        self,
        config: VioConfig,
        *,
        local_alignment: LocalAlignment | None = None,
        world_is_north: bool = False,
        yaw_at: Callable[[int], float | None] = lambda _t_ns: None,
    ) -> None:
        self._composer = OdometryComposer(
            local_alignment, world_is_north=world_is_north, agl_scale_sigma=config.scale_sigma
        )
        self._propagator = OdometryPropagator(config.imu_noise)
        self._max_sigma_m = config.max_position_sigma_m
        self._encoding = config.odometry.covariance_encoding
        self._lost_send_us = round(config.odometry.lost_policy.send_s * 1e6)
        self._yaw_at = yaw_at
        self._resets = ResetCounter()
        self._lock = Lock()
        self.counters: Counter[str] = Counter()
        self._health = VioState.INIT
        self._frame: Tracking | Degraded | None = None  # the last one with an output that was used
        self._loss: _Loss | None = None
        self._initialising = True
        self._warm = False
        self._jumps = 0  # of the composer, at the last output

    def take_imu(self, sample: ImuSample) -> None:
        """Propagate the state to an inertial sample."""
        with self._lock:
            if not self._propagator.add_imu(sample):
                self.counters["imu_refused_not_later"] += 1

    def take_result(self, result: Result) -> None:
        """Take the result of a frame (a listener of the pipeline)."""
        with self._lock:
            self._health = result.state
            if isinstance(result, Initializing):
                self._initialising, self._warm = True, result.is_warm
            if isinstance(result, Initializing | Lost):
                self.counters[f"frames_{result.state.value.lower()}"] += 1
            elif self._frame is not None and result.t_ns <= self._frame.t_ns:
                self.counters["frames_refused_not_later"] += 1
            else:
                self.counters[self._take_output(result)] += 1

    def message(self, now_us: int) -> ODOMETRY | None:
        """Return the message to send at a time, or None."""
        with self._lock:
            frame, alignment, newest = self._frame, self._composer.alignment, self._propagator.state()
            if frame is None or alignment is None or newest is None:
                return None
            health = self._health_at(now_us * 1000, frame, newest.pose)
            quality = quality_of(health, frame.output.feature_quality, frame.innovation_ratio)
            state = self._state_to_send(health, newest, now_us)
            if quality is None or state is None:
                return None
            return odometry_message(
                state,
                alignment,
                reset_counter=self._resets.value,
                quality=quality,
                encoding=self._encoding,
                # The stamp of a lost pose advances: a constant one would disturb the autopilot's jitter correction.
                time_us=now_us if health is VioState.LOST else None,
            )

    def _take_output(self, frame: Tracking | Degraded) -> str:
        output = frame.output
        if not self._prepare(frame):
            return "frames_waiting_for_north"
        pose = self._composer.compose(output)
        if pose is None:
            return "frames_refused_covariance"
        correction = self._propagator.correct(frame.t_ns, pose, output.velocity_b, output.imu_bias, self._composer.up)
        if self._initialising:
            self._resets.start()
        elif self._composer.jumps > self._jumps:
            self._resets.jump()
        elif correction is not None:
            self._resets.correct(*correction)
        self._frame, self._initialising, self._jumps = frame, False, self._composer.jumps
        return "frames"

    def _prepare(self, frame: Tracking | Degraded) -> bool:
        """Place the output's keyframe in the local frame; return whether that was possible."""
        composer, output, last = self._composer, frame.output, self._propagator.state()
        if last is None:
            return composer.anchor(output, self._yaw_at(frame.t_ns))
        if self._initialising and not self._warm:  # in a world of its own, at the place where it stood still
            composer.restart(output, last.pose)
        elif self._initialising or not composer.knows(output.keyframe_id):
            composer.restart(output, LocalPose(composer.place_in_world(output), last.pose.covariance_6x6))
        return True

    def _health_at(self, now_ns: int, frame: Tracking | Degraded, pose: LocalPose) -> VioState:
        if self._health not in (VioState.TRACKING, VioState.DEGRADED):
            return self._health
        age_ns = now_ns - frame.t_ns
        if age_ns > LOST_AFTER_NS:
            return VioState.LOST
        variance_m2 = float(np.linalg.eigvalsh(pose.covariance_6x6[3:, 3:])[-1])
        is_worse = age_ns > DEGRADED_AFTER_NS or not variance_m2 <= self._max_sigma_m**2
        return VioState.DEGRADED if is_worse else self._health

    def _state_to_send(self, health: VioState, newest: MotionState, now_us: int) -> MotionState | None:
        if health is not VioState.LOST:
            self._loss = None
            return newest
        self._loss = self._loss or _Loss(now_us, newest)
        return None if now_us - self._loss.since_us > self._lost_send_us else self._loss.state


def quality_of(state: VioState, features: FeatureQuality, innovation_ratio: float) -> int | None:
    """Return the message's quality: 50..100 tracking, 1..49 degraded, -1 lost; None if no message may be sent.

    Never 0, which the message defines as unknown.

    Args:
        innovation_ratio: running mean of NIS per degree of freedom; anything but a number from 0 counts as the worst.
    """
    if state is VioState.INIT:
        return None
    if state is VioState.LOST:
        return QUALITY_LOST
    share = _share(features, innovation_ratio)
    return 50 + round(50 * share) if state is VioState.TRACKING else 1 + round(48 * share)


def _share(features: FeatureQuality, innovation_ratio: float) -> float:
    if not innovation_ratio >= 0:
        return 0.0
    consistency = 1.0 / max(innovation_ratio, 1.0)
    return min(1.0, features.inliers / FULL_INLIERS) * min(1.0, features.coverage / FULL_COVERAGE) * consistency
