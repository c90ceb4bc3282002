# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of velocity, position and height, with their gates (AP_NavEKF3_PosVelFusion.cpp, SelectVelPosFusion)."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ap_core.cint import u32
from ekf_stub.aiding import Aiding, AidingMode
from ekf_stub.error_state import POS, STATES, VEL, ErrorState
from ekf_stub.ext_nav_ingest import ExtNavIngest
from ekf_stub.inertial import Array, limited
from ekf_stub.measurements import BaroSample, Delayed
from ekf_stub.obs_ring import ObsRing
from ekf_stub.resets import NORTH_EAST, POS_NE, Resets
from ekf_stub.sources import EkfSources, SourceXY, SourceZ

EXT_NAV_FRESH_MS: Final = 500
HEIGHT_RETRY_MS: Final = 5000
HEIGHT_RETRY_WITH_VELOCITY_MS: Final = 10_000
NO_HEIGHT_PERIOD_MS: Final = 70
DISARMED_NOISE: Final = 0.5
MAX_RATIO_ON_GROUND: Final = 3.0
NOISE_OF_ACCELERATION: Final = 0.05
_OFFSET_GAIN: Final = 0.1
_OFFSET_STEP_LIMIT: Final = 5.0

BARO: Final = "baro"
EXT_NAV: Final = "ext_nav"
NO_SOURCE: Final = "none"


@dataclass(slots=True)
class Innovations:
    """Prediction less measurement, shape (3,) m/s NED and m NED, and ratios of their squares to the gates."""

    vel: Array = field(default_factory=lambda: np.zeros(3))
    pos: Array = field(default_factory=lambda: np.zeros(3))
    vel_ratio: float = 0.0
    pos_ratio: float = 0.0
    height_ratio: float = 0.0


@dataclass(frozen=True, slots=True)
class Vehicle:
    """What the filter knows of the vehicle in a step: whether it is armed, surely on the ground, surely in flight."""

    armed: bool
    on_ground: bool
    in_flight: bool


class VelPosFusion:
    """Chooses what to fuse in a step, tests it, and fuses it or resets to it.

    Args:
        state: the filter.
        resets: what resets it.
        aiding: the mode and the timeouts.
        sources: the source sets.
        delayed: the measurements at the horizon.
        ingest: where external navigation waits.
        get_float: returns a parameter by its name after ``EK3_``.
        baro_ring_size: how many heights wait.

    Attributes:
        innovations: as they were at the last test, velocities as they were when last fused.
        height_timeout: height is lost.
        baro: heights that wait for the horizon.
        baro_height: the last height that came due.
    """

    def __init__(
        self,
        state: ErrorState,
        resets: Resets,
        aiding: Aiding,
        sources: EkfSources,
        delayed: Delayed,
        ingest: ExtNavIngest,
        get_float: Callable[[str], float],
        baro_ring_size: int,
    ) -> None:
        self._state = state
        self._resets = resets
        self._aiding = aiding
        self._sources = sources
        self._delayed = delayed
        self._ingest = ingest
        self._get_float = get_float
        self.innovations = Innovations()
        self.height_timeout = True
        self.baro: ObsRing[BaroSample] = ObsRing(baro_ring_size)
        self.baro_height = 0.0
        self._baro_offset = 0.0
        self._height_source = self._height_source_fused = BARO
        self._measured_down = 0.0
        self._down_variance = 1.0
        self._pos_source = sources.pos_xy()
        self._pos_source_changed = False
        self._velocity_was_reset = False

    def step(self, now_ms: int, vehicle: Vehicle) -> None:
        """Fuse what came due in a step."""
        self._note_change_of_source()
        absolute = self._aiding.mode is AidingMode.ABSOLUTE
        by_ext_nav = absolute and self._delayed.has_pose and self._sources.pos_xy() == SourceXY.EXTNAV
        fuse_pos = by_ext_nav
        fuse_vel = self._delayed.has_velocity and self._sources.uses_vel_xy(SourceXY.EXTNAV)
        fuse_height = self._select_height(now_ms)
        pose = self._delayed.pose
        if by_ext_nav and pose is not None and (pose.is_reset or self._pos_source_changed):
            self._pos_source_changed = False
            self._resets.shift_to_pose(with_height=self._height_source == EXT_NAV)
        if fuse_height and self._aiding.mode is AidingMode.NONE:
            fuse_pos, fuse_vel = True, False
        self._fuse(now_ms, vehicle, fuse_pos=fuse_pos, fuse_vel=fuse_vel, fuse_height=fuse_height)

    def _note_change_of_source(self) -> None:
        source = self._sources.pos_xy()
        if source != self._pos_source:
            self._pos_source = source
            self._pos_source_changed = source != SourceXY.NONE

    # Height

    def _select_height(self, now_ms: int) -> bool:
        """Choose the source of height and measure it; tell whether that is possible now (selectHeightForFusion)."""
        baro = self.baro.recall(self._ingest.horizon_ms).sample
        if baro is not None:
            self.baro_height = baro.height
        self._choose_height_source(now_ms)
        if baro is not None and self._height_source != BARO:
            error = baro.height + float(self._state.pos[2]) - self._baro_offset
            self._baro_offset += _OFFSET_GAIN * limited(error, -_OFFSET_STEP_LIMIT, _OFFSET_STEP_LIMIT)
        is_there = self._measure_height(now_ms, baro)
        if is_there and self._height_source != self._height_source_fused:
            self._height_source_fused = self._height_source
            self._resets.shift_height(self._measured_down)
        with_velocity = self._ingest.have_velocity and not self._aiding.vel_timeout
        retry_ms = HEIGHT_RETRY_WITH_VELOCITY_MS if with_velocity else HEIGHT_RETRY_MS
        self.height_timeout = u32(now_ms - self._aiding.times.height) > retry_ms
        return is_there

    def _choose_height_source(self, now_ms: int) -> None:
        source = self._sources.pos_z()
        if source == SourceZ.NONE:
            self._height_source = NO_SOURCE
        elif source == SourceZ.EXTNAV and u32(now_ms - self._ingest.pose_stamp_ms) < EXT_NAV_FRESH_MS:
            self._height_source = EXT_NAV
        elif self._height_source != BARO:
            self._height_source = BARO

    def _measure_height(self, now_ms: int, baro: BaroSample | None) -> bool:
        pose = self._delayed.pose
        if self._height_source == EXT_NAV:
            if not self._delayed.has_pose or pose is None:
                return False
            self._measured_down = float(pose.pos[2])
            self._down_variance = limited(pose.err, 0.1, 10.0) ** 2
        elif self._height_source == BARO:
            if baro is None:
                return False
            self._measured_down = self._baro_offset - baro.height
            self._down_variance = limited(self._get_float("ALT_M_NSE"), 0.1, 100.0) ** 2
        else:
            if u32(now_ms - self._aiding.times.height) <= NO_HEIGHT_PERIOD_MS:
                return False
            self._measured_down = 0.0
            self._down_variance = limited(self._get_float("ALT_M_NSE"), 0.1, 100.0) ** 2
        return True

    def reset_height_to_pose(self, now_ms: int, vehicle: Vehicle) -> None:
        """Put height where the pose is, as aiding begins, whatever the source of height."""
        pose = self._delayed.pose
        if pose is not None:
            self._measured_down = float(pose.pos[2])
            self._down_variance = limited(pose.err, 0.1, 10.0) ** 2
            self._reset_height(now_ms, vehicle)

    def _reset_height(self, now_ms: int, vehicle: Vehicle) -> None:
        self.height_timeout = False
        measured = self._delayed.velocity
        vertical_velocity: float | None = 0.0 if vehicle.on_ground else None
        if vehicle.in_flight and measured is not None and self._height_source == EXT_NAV:
            vertical_velocity = float(measured.vel[2])
        self._resets.height(now_ms, self._measured_down, self._down_variance, vertical_velocity=vertical_velocity)

    # Gates and fusion

    def _fuse(self, now_ms: int, vehicle: Vehicle, *, fuse_pos: bool, fuse_vel: bool, fuse_height: bool) -> None:
        """Test all with the covariance as it was before the step, then fuse what passed (FuseVelPosNED)."""
        aided = self._aiding.mode is not AidingMode.NONE
        constant = DISARMED_NOISE if not vehicle.armed else limited(self._get_float("NOAID_M_NSE"), 0.5, 50.0)
        pose, velocity = self._delayed.pose, self._delayed.velocity
        pos_variance = vel_variance = constant**2
        target_ne = self._resets.last_known_ne
        if aided and pose is not None:
            pos_variance, target_ne = limited(pose.err, 0.01, 100.0) ** 2, pose.pos[NORTH_EAST]
        if aided and velocity is not None:
            vel_variance = limited(velocity.err, 0.05, 50.0) ** 2
        self._velocity_was_reset = False
        pos_ok = fuse_pos and self._test_position(now_ms, target_ne, pos_variance)
        fuse_vel = fuse_vel and not self._velocity_was_reset
        vel_ok = fuse_vel and velocity is not None and self._test_velocity(now_ms)
        height_ok = fuse_height and self._test_height(now_ms, vehicle)
        innovations = self.innovations
        if vel_ok and velocity is not None:
            for axis in range(3 if self._sources.uses_vel_z(SourceZ.EXTNAV) else 2):
                innovations.vel[axis] = self._state.vel[axis] - velocity.vel[axis]
                self._update(VEL.start + axis, innovations.vel[axis], vel_variance)
        if pos_ok:
            for axis in range(2):
                innovations.pos[axis] = self._state.pos[axis] - target_ne[axis]
                self._update(POS.start + axis, innovations.pos[axis], pos_variance)
        if height_ok:
            innovations.pos[2] = self._state.pos[2] - self._measured_down
            self._update(POS.start + 2, innovations.pos[2], self._down_variance)

    def _update(self, index: int, innovation: float, variance: float) -> None:
        row = np.zeros(STATES)
        row[index] = 1.0
        self._state.update(row, float(innovation), variance)

    def _gate(self, name: str) -> float:
        return max(0.01 * self._get_float(name), 1.0) ** 2

    def _variances(self, first: int, count: int) -> float:
        return float(sum(self._state.cov[index, index] for index in range(first, first + count)))

    def _limits_glitches(self) -> bool:
        return self._get_float("GLITCH_RAD") > 0

    def _test_position(self, now_ms: int, target_ne: Array, variance: float) -> bool:
        """Tell whether to fuse a position; False as well when the filter was reset to it instead."""
        innovation = self._state.pos[NORTH_EAST] - target_ne
        self.innovations.pos[NORTH_EAST] = innovation
        spread = self._variances(POS.start, 2)
        ratio = float(innovation @ innovation) / (self._gate("POS_I_GATE") * (spread + 2 * variance))
        self.innovations.pos_ratio = ratio
        aiding = self._aiding
        passed = ratio < 1 or aiding.mode is AidingMode.NONE or not self._limits_glitches()
        if passed:
            aiding.times.pos = now_ms
        if not passed and not aiding.pos_timeout:
            return False
        radius = self._get_float("GLITCH_RAD")
        is_wide = self._limits_glitches() and spread > radius**2
        if not (aiding.pos_timeout or is_wide) or aiding.vel_aiding:
            return True
        self._velocity_was_reset = aiding.vel_timeout
        self._resets.position(now_ms)
        self._state.clear(POS_NE, (0.5 * radius) ** 2)
        self.innovations.pos_ratio = 0.0
        if self._velocity_was_reset:
            self._resets.velocity(now_ms)
            self.innovations.vel_ratio = 0.0
        return False

    def _test_velocity(self, now_ms: int) -> bool:
        velocity = self._delayed.velocity
        if velocity is None:
            return False
        axes = 3 if self._sources.uses_vel_z(SourceZ.EXTNAV) and self._ingest.have_velocity else 2
        innovation = (self._state.vel - velocity.vel)[:axes]
        accel = float(np.linalg.norm(self._state.accel_filtered))
        variance = limited(velocity.err, 0.05, 5.0) ** 2 + (NOISE_OF_ACCELERATION * accel) ** 2
        spread = self._variances(VEL.start, axes) + axes * variance
        self.innovations.vel_ratio = float(innovation @ innovation) / (self._gate("VEL_I_GATE") * spread)
        aiding = self._aiding
        passed = self.innovations.vel_ratio < 1 or not self._limits_glitches()
        if passed:
            aiding.times.vel = now_ms
        if not passed and not aiding.vel_timeout:
            return False
        if aiding.mode is AidingMode.ABSOLUTE and aiding.vel_timeout:
            self._resets.velocity(now_ms)
            self.innovations.vel_ratio = 0.0
            return False
        return True

    def _test_height(self, now_ms: int, vehicle: Vehicle) -> bool:
        innovation = float(self._state.pos[2]) - self._measured_down
        self.innovations.pos[2] = innovation
        spread = self._variances(POS.start + 2, 1) + self._down_variance
        self.innovations.height_ratio = innovation**2 / (self._gate("HGT_I_GATE") * spread)
        standing = self._aiding.mode is AidingMode.NONE and vehicle.on_ground
        passed = self.innovations.height_ratio < (MAX_RATIO_ON_GROUND if standing else 1.0)
        if passed:
            self._aiding.times.height = now_ms
        if self.height_timeout:
            self._reset_height(now_ms, vehicle)
            return False
        return passed
