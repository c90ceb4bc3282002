# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of velocity, position and height, with their gates (AP_NavEKF3_PosVelFusion.cpp, SelectVelPosFusion)."""

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ap_core.cint import u32
from ap_core.verdict import Rule
from ekf_stub.filter.inertial import Array, limited
from ekf_stub.filter.states import POS, VEL
from ekf_stub.fusion.aiding import ABSOLUTE, NO_AIDING
from ekf_stub.fusion.height_source import BARO, EXT_NAV, FRESH_MS, GPS, HeightSource, Vehicle
from ekf_stub.fusion.measurements import Velocity
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.fusion.resets import NORTH_EAST, POS_NE, Resets
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.gps_reading import GpsFix
from ekf_stub.inputs.sources import XY_EXTNAV, XY_GPS, XY_NONE, Z_EXTNAV, Z_GPS

DISARMED_NOISE: Final = 0.5
BAD_IMU_HOLD_MS: Final = 10_000
BAD_IMU_TIMEOUT_MS: Final = 1000
MAX_RATIO_ON_GROUND: Final = 3.0
NOISE_OF_ACCELERATION: Final = 0.05
GROUND_EFFECT_FLOOR: Final = -0.5
GROUND_EFFECT_DEAD_ZONE: Final = 4.0
POS_NE_MIN_NOISE, POS_NE_MAX_NOISE, POS_NE_MAX_NOISE_AT_REST = 0.01, 100.0, 10.0
REST_NOISE: Final = 1.0
REST_AFTER_MS: Final = 1000
VEL_MIN_NOISE, VEL_MAX_NOISE, VEL_MAX_GATE_NOISE = 0.05, 50.0, 5.0

_VEL: Final = tuple(range(VEL.start, VEL.stop))
_POS_NE: Final = (POS.start, POS.start + 1)
_POS_D: Final = POS.start + 2


@dataclass(slots=True)
class Innovations:
    """Prediction less measurement, shape (3,) m/s NED and m NED, and ratios of their squares to the gates.

    ``still_height`` is that of height on the ground, smoothed; m.
    """

    vel: Array = field(default_factory=lambda: np.zeros(3))
    pos: Array = field(default_factory=lambda: np.zeros(3))
    vel_ratio: float = 0.0
    pos_ratio: float = 0.0
    height_ratio: float = 0.0
    still_height: float = 0.0


@dataclass(slots=True)
class _Observed:
    """What is measured in a step; None where nothing is.

    Of a vehicle at rest the velocity is held to be zero, whatever else says of it.
    """

    pos_ne: Array | None = None
    pos_variance: float = 0.0
    vel: Array | None = None
    vel_axes: int = 2
    is_rest: bool = False
    vel_ne_variance: float = 0.0
    vel_d_variance: float = 0.0
    vel_gate_variance: float = 0.0


class VelPosFusion(Fusion):
    """Chooses what to fuse in a step, tests it, and fuses it or resets to it.

    ``innovations`` are as they were at the last test, velocities as they were when last fused.
    """

    def __init__(self, parts: FilterParts, resets: Resets, height: HeightSource) -> None:
        super().__init__(parts)
        self._resets = resets
        self._height = height
        self.innovations = Innovations()
        self._pos_source = parts.sources.pos_xy()
        self._pos_source_changed = False
        self._velocity_was_reset = False
        self._bad_imu_ms = self._good_imu_ms = 0

    def step(self, now_ms: int, vehicle: Vehicle, *, rests: bool = False) -> None:
        """Fuse what came due in a step; ``rests`` tells that the vehicle stands still, where a release heeds that."""
        absolute, source = self._aiding.mode is ABSOLUTE, self._sources.pos_xy()
        if source != self._pos_source:
            self._pos_source, self._pos_source_changed = source, source != XY_NONE
        by_gps = absolute and self._gps.is_due and source == XY_GPS
        by_ext_nav = absolute and self._delayed.has_pose and source == XY_EXTNAV
        if self._height.select(now_ms, vehicle):
            self._resets.shift_height(self._height.down)
        imu_is_bad = self._state.accel_is_bad and now_ms - self._good_imu_ms > BAD_IMU_TIMEOUT_MS
        self._height.check_timeout(now_ms, imu_is_bad=imu_is_bad)
        if not (self._gps.is_due or self._delayed.has_pose or self._delayed.has_velocity or self._height.is_new):
            return
        self._follow_jump(by_gps=by_gps, by_ext_nav=by_ext_nav)
        observed = self._observe(vehicle, by_gps=by_gps, by_ext_nav=by_ext_nav)
        if rests and self._height.is_new:
            self._observe_rest(now_ms, vehicle, observed, by_ext_nav=by_ext_nav)
        if by_gps and self._gps.delayed is not None and not observed.is_rest:
            self._check_imu(now_ms, observed, self._gps.delayed)
        self._fuse(now_ms, vehicle, observed)
        self._tell_unused(pose=not by_ext_nav, velocity=observed.vel is None or observed.is_rest)

    def _follow_jump(self, *, by_gps: bool, by_ext_nav: bool) -> None:
        """Follow a camera's frame that has jumped, or the position of another source."""
        pose, fix = self._delayed.pose, self._gps.delayed
        if by_ext_nav and pose is not None and (pose.is_reset or self._pos_source_changed):
            self._pos_source_changed = False
            self._resets.shift_to(pose.pos, with_height=self._height.active == EXT_NAV)
        elif by_gps and fix is not None and self._pos_source_changed:
            self._pos_source_changed = False
            self._resets.shift_to(fix.pos, with_height=False)

    # What is measured

    def _observe(self, vehicle: Vehicle, *, by_gps: bool, by_ext_nav: bool) -> _Observed:
        if self._aiding.mode is NO_AIDING:
            return self._observe_standstill(vehicle)
        observed = _Observed()
        pose, fix = self._delayed.pose, self._gps.delayed
        if by_ext_nav and pose is not None:
            observed.pos_ne = pose.pos[NORTH_EAST]
            observed.pos_variance = limited(pose.err, POS_NE_MIN_NOISE, POS_NE_MAX_NOISE) ** 2
        elif by_gps and fix is not None:
            self._observe_by_gps(observed, fix)
        velocity = self._used_velocity()
        if velocity is not None:
            self._observe_velocity(observed, velocity)
        return observed

    def _used_velocity(self) -> Velocity | None:
        is_used = self._delayed.has_velocity and self._sources.uses_vel_xy(XY_EXTNAV)
        return self._delayed.velocity if is_used else None

    def _observe_standstill(self, vehicle: Vehicle) -> _Observed:
        """Without aiding the vehicle counts as being where it was, whenever a height is fused."""
        known = vehicle.armed and vehicle.tilt_aligned
        noise = limited(self._get_float("NOAID_M_NSE"), 0.5, 50.0) if known else DISARMED_NOISE
        observed = _Observed(pos_variance=noise**2)
        velocity = self._used_velocity()
        if self._height.is_new:
            observed.pos_ne = self._resets.last_known_ne
        elif velocity is not None:
            self._observe_velocity(observed, velocity)
            observed.vel_ne_variance = observed.vel_d_variance = observed.vel_gate_variance = noise**2
        return observed

    def _observe_velocity(self, observed: _Observed, velocity: Velocity) -> None:
        accel = self._state.acceleration()
        observed.vel = velocity.vel
        observed.vel_axes = 3 if self._sources.uses_vel_z(Z_EXTNAV) else 2
        observed.vel_ne_variance = observed.vel_d_variance = limited(velocity.err, VEL_MIN_NOISE, VEL_MAX_NOISE) ** 2
        observed.vel_gate_variance = (
            limited(velocity.err, VEL_MIN_NOISE, VEL_MAX_GATE_NOISE) ** 2 + (NOISE_OF_ACCELERATION * accel) ** 2
        )

    def _observe_by_gps(self, observed: _Observed, fix: GpsFix) -> None:
        gps, accel = self._gps, self._state.acceleration()
        pos_noise, vel_noise, down_noise = (
            self._get_float(name) for name in ("POSNE_M_NSE", "VELNE_M_NSE", "VELD_M_NSE")
        )
        by_accel = (NOISE_OF_ACCELERATION * accel) ** 2
        observed.pos_ne = fix.pos[NORTH_EAST]
        own = limited(pos_noise, 0.1, 10.0) ** 2 + by_accel
        observed.pos_variance = gps.pos_accuracy**2 if gps.pos_accuracy > 0 else own
        if not self._sources.uses_vel_xy(XY_GPS):
            return
        observed.vel = fix.vel
        observed.vel_axes = 3 if fix.has_vertical_velocity and self._sources.uses_vel_z(Z_GPS) else 2
        observed.vel_gate_variance = limited(vel_noise, 0.05, 5.0) ** 2 + by_accel
        if gps.speed_accuracy > 0:
            observed.vel_ne_variance = limited(gps.speed_accuracy, vel_noise, 50.0) ** 2
            observed.vel_d_variance = limited(gps.speed_accuracy, down_noise, 50.0) ** 2
        else:
            observed.vel_ne_variance = observed.vel_gate_variance
            observed.vel_d_variance = limited(down_noise, 0.05, 5.0) ** 2 + by_accel

    def _observe_rest(self, now_ms: int, vehicle: Vehicle, observed: _Observed, *, by_ext_nav: bool) -> None:
        """Hold the vehicle to have no velocity; while it aids, only where nothing has told its velocity of late."""
        if self._aiding.mode is NO_AIDING:
            if not vehicle.tilt_aligned:
                return
            variance = min(self._get_float("NOAID_M_NSE"), REST_NOISE) ** 2
            observed.pos_variance = variance
        else:
            times = self._aiding.times
            if now_ms - max(times.vel, times.flow, times.odometry) < REST_AFTER_MS:
                return
            variance = REST_NOISE**2
            observed.pos_variance = self._pos_variance_at_rest(by_ext_nav=by_ext_nav)
        observed.is_rest, observed.vel, observed.vel_axes = True, np.zeros(3), 3
        observed.vel_ne_variance = observed.vel_d_variance = observed.vel_gate_variance = variance

    def _pos_variance_at_rest(self, *, by_ext_nav: bool) -> float:
        pose = self._delayed.pose
        if by_ext_nav and pose is not None:
            return limited(pose.err, POS_NE_MIN_NOISE, POS_NE_MAX_NOISE_AT_REST) ** 2
        if self._gps.pos_accuracy > 0:
            return self._gps.pos_accuracy**2
        return limited(self._get_float("POSNE_M_NSE"), 0.1, 10.0) ** 2

    def _tested_at_rest(self) -> int:
        """Return on how many axes rest is tested: the vertical one counts if there is a source of its velocity."""
        fix = self._gps.delayed
        by_gps = fix is not None and fix.has_vertical_velocity and self._sources.uses_vel_z(Z_GPS)
        by_ext_nav = self._ingest.have_velocity and self._sources.uses_vel_z(Z_EXTNAV)
        return 3 if by_ext_nav or (by_gps and self._aiding.mode is ABSOLUTE) else 2

    def _check_imu(self, now_ms: int, observed: _Observed, fix: GpsFix) -> None:
        """Find out whether the accelerometers are bad: height and vertical velocity are off alike (FuseVelPosNED)."""
        if observed.vel_axes < 3 or observed.vel is None or self._sources.pos_z() == Z_GPS:
            return
        height_error, climb_error = (
            self._state.down - self._height.down,
            self._state.component(_VEL[2]) - observed.vel[2],
        )
        since_ms = now_ms - self._bad_imu_ms
        sigmas_squared = 9.0 if since_ms > 2 * BAD_IMU_HOLD_MS else 4.0 if since_ms > 1.5 * BAD_IMU_HOLD_MS else 1.0
        is_off = (
            height_error * climb_error > 0
            and height_error**2 > sigmas_squared * self._height.variance
            and climb_error**2 > sigmas_squared * observed.vel_d_variance
        )
        if is_off:
            self._bad_imu_ms = now_ms
        else:
            self._good_imu_ms = now_ms
        is_bad = since_ms < BAD_IMU_HOLD_MS
        self._state.doubt_accel(
            is_bad=is_bad,
            vel_down_variance=self._get_float("VELD_M_NSE") ** 2,
            height_variance=self._get_float("ALT_M_NSE") ** 2,
        )
        if is_bad:
            self._state.vel = np.array([*self._state.vel[NORTH_EAST], fix.vel[2]])

    # Gates and fusion

    def _fuse(self, now_ms: int, vehicle: Vehicle, observed: _Observed) -> None:
        """Test all with the covariance as it was before the step, then fuse what passed (FuseVelPosNED)."""
        self._velocity_was_reset = False
        pos_ok = observed.pos_ne is not None and self._test_position(now_ms, observed, observed.pos_ne)
        vel_ok = (
            observed.vel is not None
            and not self._velocity_was_reset
            and self._test_velocity(now_ms, observed, observed.vel)
        )
        height_ok = self._height.is_new and self._test_height(now_ms, vehicle)
        by_ground_effect = height_ok and vehicle.near_ground and self._height.active == BARO
        wanted: list[tuple[int, float, float]] = []
        # With few satellites whatever GPS is the source of counts for less, even if it is assumed for want of GPS.
        scale = self._gps.noise_scaler**2
        if vel_ok and observed.vel is not None:
            factor = scale if self._sources.uses_vel_xy(XY_GPS) else 1.0
            north_east, down = factor * observed.vel_ne_variance, factor * observed.vel_d_variance
            variances = north_east, north_east, down
            wanted += zip(_VEL[: observed.vel_axes], observed.vel.tolist(), variances, strict=False)
        if pos_ok and observed.pos_ne is not None:
            variance = (scale if self._sources.pos_xy() == XY_GPS else 1.0) * observed.pos_variance
            wanted += zip(_POS_NE, observed.pos_ne.tolist(), 2 * (variance,), strict=True)
        if height_ok and not by_ground_effect:
            wanted.append((_POS_D, self._height.down, self._height.variance))
        if wanted:
            self._update_states(wanted)
        if by_ground_effect:
            self._fuse_height_near_ground()

    def _update_states(self, wanted: list[tuple[int, float, float]]) -> None:
        for (index, _, _), innovation in zip(wanted, self._state.update_states(wanted), strict=True):
            if index < POS.start:
                self.innovations.vel[index - VEL.start] = innovation
            else:
                self.innovations.pos[index - POS.start] = innovation

    def _fuse_height_near_ground(self) -> None:
        innovation = self._state.down - self._height.down
        innovation += limited(GROUND_EFFECT_FLOOR - innovation, 0.0, GROUND_EFFECT_FLOOR + GROUND_EFFECT_DEAD_ZONE)
        self.innovations.pos[2] = innovation
        self._state.update_state(_POS_D, innovation, self._height.variance)

    def _gate(self, name: str) -> float:
        return max(0.01 * self._get_float(name), 1.0) ** 2

    def _variances(self, first: int, count: int) -> float:
        cov = self._state.cov
        return sum([cov.item(state, state) for state in range(first, first + count)])

    def _limits_glitches(self) -> bool:
        return self._get_float("GLITCH_RAD") > 0

    def _test_position(self, now_ms: int, observed: _Observed, pos_ne: Array) -> bool:
        """Return whether to fuse a position; False as well when the filter was reset to it instead."""
        square = 0.0
        for axis, measured in enumerate(pos_ne.tolist()):
            innovation = self.innovations.pos[axis] = self._state.component(POS.start + axis) - measured
            square += innovation * innovation
        spread = self._variances(POS.start, 2)
        ratio = square / (self._gate("POS_I_GATE") * (spread + 2 * observed.pos_variance))
        self.innovations.pos_ratio = ratio
        aiding = self._aiding
        passed = ratio < 1 or aiding.mode is NO_AIDING or not self._limits_glitches()
        if passed:
            aiding.times.pos = now_ms
        if not (passed or aiding.pos_timeout or self._state.accel_is_bad):
            self._tell_pose(rules.GATE_POSITION, ratio)
            return False
        is_wide = self._limits_glitches() and spread > self._get_float("GLITCH_RAD") ** 2
        if not (aiding.pos_timeout or is_wide) or (aiding.vel_aiding and not self._gps.checks.good):
            self._tell_pose(rules.FUSED, ratio)
            return True
        self._reset_position(now_ms)
        return False

    def _reset_position(self, now_ms: int) -> None:
        self._velocity_was_reset = self._aiding.vel_timeout
        self._resets.position(now_ms)
        self._state.clear(POS_NE, (0.5 * self._get_float("GLITCH_RAD")) ** 2)
        self.innovations.pos_ratio = 0.0
        self._tell_pose(rules.RESET_TO)
        if self._velocity_was_reset:
            self._resets.velocity(now_ms)
            self.innovations.vel_ratio = 0.0

    def _test_velocity(self, now_ms: int, observed: _Observed, vel: Array) -> bool:
        axes = self._tested_at_rest() if observed.is_rest else observed.vel_axes
        square = 0.0
        for axis, measured in enumerate(vel.tolist()[:axes]):
            innovation = self._state.component(VEL.start + axis) - measured
            square += innovation * innovation
        spread = self._variances(VEL.start, axes) + axes * observed.vel_gate_variance
        ratio = square / (self._gate("VEL_I_GATE") * spread)
        self.innovations.vel_ratio = ratio
        aiding = self._aiding
        passed = ratio < 1 or not self._limits_glitches()
        if passed:
            aiding.times.vel = now_ms
            if ratio >= 1:
                aiding.times.pos = now_ms
        if not (passed or aiding.vel_timeout or self._state.accel_is_bad):
            self._tell_velocity(observed, rules.GATE_VELOCITY, ratio)
            return False
        if aiding.mode is ABSOLUTE and aiding.vel_timeout:
            self._resets.velocity(now_ms)
            self.innovations.vel_ratio = 0.0
            self._tell_velocity(observed, rules.RESET_TO)
            return False
        self._tell_velocity(observed, rules.FUSED, ratio)
        return True

    def _test_height(self, now_ms: int, vehicle: Vehicle) -> bool:
        height = self._height
        innovation = self._state.down - height.down
        self.innovations.pos[2] = innovation
        spread = self._variances(POS.start + 2, 1) + height.variance
        ratio = innovation**2 / (self._gate("HGT_I_GATE") * spread)
        self.innovations.height_ratio = ratio
        standing = self._aiding.mode is NO_AIDING and vehicle.on_ground
        passed = ratio < (MAX_RATIO_ON_GROUND if standing else 1.0)
        if not (passed or standing or self._limits_glitches()) and height.active == GPS:
            passed, self._aiding.times.pos = True, now_ms
        if passed:
            self._aiding.times.height = now_ms
        if passed or height.is_lost or self._state.accel_is_bad:
            self._follow_innovation(now_ms, vehicle, innovation)
        if height.is_lost:
            self.reset_height(now_ms, vehicle)
            self._tell_height(rules.RESET_TO)
            return False
        passed = passed or self._state.accel_is_bad
        self._tell_height(rules.FUSED if passed else rules.GATE_HEIGHT, ratio)
        return passed

    def _follow_innovation(self, now_ms: int, vehicle: Vehicle, innovation: float) -> None:
        """Smooth the innovation of height on the ground."""
        if vehicle.on_ground:
            dt = 0.001 * (now_ms - self._aiding.times.height)
            self.innovations.still_height += (innovation - self.innovations.still_height) * dt / (dt + 2.0)
        else:
            self.innovations.still_height = 0.0

    def reset_height(self, now_ms: int, vehicle: Vehicle) -> None:
        """Put height where it was measured last."""
        self._height.is_lost = False
        velocity, fix = self._delayed.velocity, self._gps.newest
        vertical_velocity: float | None = 0.0 if vehicle.on_ground else None
        if vehicle.in_flight and fix is not None and self._gps_tells_climb(now_ms, fix):
            vertical_velocity = float(fix.vel[2])
        elif vehicle.in_flight and velocity is not None and self._height.active == EXT_NAV:
            vertical_velocity = float(velocity.vel[2])
        self._resets.height(now_ms, self._height.down, self._height.variance, vertical_velocity=vertical_velocity)
        self._height.terrain.follow_height(on_ground=vehicle.on_ground)

    def _gps_tells_climb(self, now_ms: int, newest: GpsFix) -> bool:
        delayed = self._gps.delayed
        is_fresh = delayed is not None and u32(now_ms - delayed.time_ms) < FRESH_MS
        is_used = self._sources.uses_vel_z(Z_GPS) and (self._gps.is_in_use or self._state.accel_is_bad)
        return is_fresh and is_used and newest.has_vertical_velocity

    # What became of samples of external navigation

    def _tell_unused(self, *, pose: bool, velocity: bool) -> None:
        if pose and self._delayed.has_pose and self._delayed.pose is not None:
            self._ingest.tell("pose", rules.UNUSED, self._delayed.pose.time_ms)
        unused = self._delayed.velocity if self._delayed.has_velocity else None
        if unused is not None and (velocity or self._used_velocity() is None):
            self._ingest.tell("velocity", rules.UNUSED, unused.time_ms)

    def _tell_pose(self, rule: Rule, ratio: float | None = None) -> None:
        pose = self._delayed.pose
        by_ext_nav = self._aiding.mode is ABSOLUTE and self._sources.pos_xy() == XY_EXTNAV
        if by_ext_nav and self._delayed.has_pose and pose is not None:
            self._ingest.tell("pose", rule, pose.time_ms, _root(ratio))

    def _tell_velocity(self, observed: _Observed, rule: Rule, ratio: float | None = None) -> None:
        velocity = self._used_velocity()
        if velocity is not None and not observed.is_rest:
            self._ingest.tell("velocity", rule, velocity.time_ms, _root(ratio))

    def _tell_height(self, rule: Rule, ratio: float | None = None) -> None:
        pose = self._delayed.pose
        if self._height.active == EXT_NAV and self._delayed.has_pose and pose is not None:
            self._ingest.tell("height", rule, pose.time_ms, _root(ratio))


def _root(ratio: float | None) -> float | None:
    return None if ratio is None else math.sqrt(ratio)
