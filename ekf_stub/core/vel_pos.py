# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of velocity, position and height, with their gates (AP_NavEKF3_PosVelFusion.cpp, SelectVelPosFusion)."""

import math
from typing import Final, final

from ekf_stub.core import events as ev
from ekf_stub.core.aiding import ABSOLUTE, NO_AIDING, Aiding, Vehicle
from ekf_stub.core.covariance import POS, POS_D, VEL
from ekf_stub.core.events import Events
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.gps import Gps, GpsFix
from ekf_stub.core.height import FRESH_MS, HeightSource
from ekf_stub.core.params import BARO, EXTNAV, GPS, NONE, EkfSources, Params, gate
from ekf_stub.core.resets import Resets
from ekf_stub.core.samples import PoseSample, VelocitySample
from ekf_stub.core.state import State
from ekf_stub.core.vectors import ZERO, Vec3, length2, limited, since_ms, smaller, square
from ekf_stub.release import FilterRelease

_DISARMED_NOISE: Final = 0.5
_BAD_IMU_HOLD_MS: Final = 10_000
_BAD_IMU_TIMEOUT_MS: Final = 1000
_MAX_RATIO_ON_GROUND: Final = 3.0
_NOISE_OF_ACCELERATION: Final = 0.05
_GROUND_EFFECT_FLOOR: Final = -0.5
_GROUND_EFFECT_DEAD_ZONE: Final = 4.0
_POS_NE_MIN_NOISE: Final = 0.01
_POS_NE_MAX_NOISE: Final = 100.0
_POS_NE_MAX_NOISE_AT_REST: Final = 10.0
_REST_NOISE: Final = 1.0
_REST_AFTER_MS: Final = 1000
_VEL_MIN_NOISE: Final = 0.05
_VEL_MAX_NOISE: Final = 50.0
_VEL_MAX_GATE_NOISE: Final = 5.0


@final
class Observed:
    """What is measured in a step.

    Of a vehicle at rest the velocity is held to be zero, whatever else says of it.

    Attributes:
        has_pos, has_vel: whether a horizontal position and a velocity are.
        north, east, pos_var: the position, m and m^2.
        vel, vel_axes: the velocity, m/s, NED, of which so many axes are measured.
        tested_axes: on how many axes it is tested.
        is_rest: the velocity is that of a vehicle at rest.
        vel_ne_var, vel_d_var: variances of the velocity, (m/s)^2.
        vel_gate_var: what counts for its gate, (m/s)^2.
    """

    def __init__(self) -> None:
        self.has_pos = False
        self.north = 0.0
        self.east = 0.0
        self.pos_var = 0.0
        self.has_vel = False
        self.vel: Vec3 = ZERO
        self.vel_axes = 2
        self.tested_axes = 2
        self.is_rest = False
        self.vel_ne_var = 0.0
        self.vel_d_var = 0.0
        self.vel_gate_var = 0.0

    def measure_axes(self, axes: int) -> None:
        """Note how many axes of the velocity are measured, all of which are tested."""
        self.vel_axes = self.tested_axes = axes


@final
class VelPosFusion:
    """Chooses what to fuse in a step, tests it, and fuses it or resets to it.

    Innovations are prediction less measurement, as they were at the last test, those of velocity as they were when
    last fused; ratios are of their squares to the gates.

    Attributes:
        vel_innovation, pos_innovation: m/s and m, NED.
        vel_ratio, pos_ratio, height_ratio: of velocity, horizontal position and height.
        still_height: the innovation of height on the ground, smoothed; m.
    """

    def __init__(
        self,
        params: Params,
        state: State,
        aiding: Aiding,
        sources: EkfSources,
        ext_nav: ExtNav,
        gps: Gps,
        events: Events,
        resets: Resets,
        height: HeightSource,
        release: FilterRelease,
    ) -> None:
        self._weighs_as_gps = release.weighs_as_gps
        self._scales_all_noise = release.scales_all_noise
        self._fuses_any_climb = release.fuses_any_climb
        self._params = params
        self._state = state
        self._aiding = aiding
        self._sources = sources
        self._ext_nav = ext_nav
        self._gps = gps
        self._events = events
        self._resets = resets
        self._height = height
        self.vel_innovation: Vec3 = ZERO
        self.pos_innovation: Vec3 = ZERO
        self.vel_ratio = 0.0
        self.pos_ratio = 0.0
        self.height_ratio = 0.0
        self.still_height = 0.0
        self._pos_source = sources.pos_xy()
        self._pos_source_changed = False
        self._velocity_was_reset = False
        self._bad_imu_ms = 0
        self._good_imu_ms = 0

    def step(self, now_ms: int, vehicle: Vehicle, rests: bool) -> None:
        """Fuse what came due in a step; ``rests`` tells that the vehicle stands still, where a release heeds that."""
        absolute, source = self._aiding.mode == ABSOLUTE, self._sources.pos_xy()
        if source != self._pos_source:
            self._pos_source, self._pos_source_changed = source, source != NONE
        by_gps = absolute and self._gps.is_due and source == GPS
        by_ext_nav = absolute and self._ext_nav.has_pose and source == EXTNAV
        height = self._height
        if height.select(now_ms, vehicle):
            self._resets.shift_height(height.down)
        height.check_timeout(now_ms, self._state.accel_is_bad and now_ms - self._good_imu_ms > _BAD_IMU_TIMEOUT_MS)
        if not (self._gps.is_due or self._ext_nav.has_pose or self._ext_nav.has_velocity or height.is_new):
            return
        self._follow_jump(by_gps, by_ext_nav)
        observed = self._observe(vehicle, by_gps, by_ext_nav)
        if rests and height.is_new:
            self._observe_rest(now_ms, vehicle, observed, by_ext_nav)
        fix = self._gps.delayed
        if fix is not None and not observed.is_rest and (by_gps or self._fuses_any_climb):
            self._check_imu(now_ms, observed, fix)
        self._fuse(now_ms, vehicle, observed)
        self._tell_unused(not by_ext_nav, not observed.has_vel or observed.is_rest)

    def _follow_jump(self, by_gps: bool, by_ext_nav: bool) -> None:
        """Follow a camera's frame that has jumped, or the position of another source."""
        pose, fix = self._ext_nav.pose, self._gps.delayed
        if by_ext_nav and pose is not None and (pose.is_reset or self._pos_source_changed):
            self._pos_source_changed = False
            self._resets.shift_to(pose.pos, self._height.active == EXTNAV)
        elif by_gps and fix is not None and self._pos_source_changed:
            self._pos_source_changed = False
            self._resets.shift_to(fix.pos, False)

    # What is measured

    def _observe(self, vehicle: Vehicle, by_gps: bool, by_ext_nav: bool) -> Observed:
        observed = Observed()
        if self._aiding.mode == NO_AIDING:
            self._observe_standstill(vehicle, observed)
            if self._fuses_any_climb:
                self._observe_any_climb(observed)
            return observed
        pose, fix = self._ext_nav.pose, self._gps.delayed
        if by_ext_nav and pose is not None:
            observed.has_pos = True
            observed.north, observed.east = pose.pos[0], pose.pos[1]
            observed.pos_var = square(limited(pose.err, _POS_NE_MIN_NOISE, _POS_NE_MAX_NOISE))
        elif by_gps and fix is not None:
            self._observe_by_gps(observed, fix)
        velocity = self._used_velocity()
        if velocity is not None:
            self._observe_velocity(observed, velocity)
        if self._fuses_any_climb:
            self._observe_any_climb(observed)
        if self._weighs_as_gps:
            self._weigh_as_gps(observed, pose if by_ext_nav else None)
        return observed

    def _observe_any_climb(self, observed: Observed) -> None:
        """Measure the vertical velocity whatever its source is, and test it by other rules than those for fusion."""
        fix, by_ext_nav = self._gps.delayed, self._ext_nav.have_velocity
        by_gps = fix is not None and fix.has_vertical_velocity and self._sources.has_vel_z()
        observed.vel_axes = 3 if by_ext_nav or self._gps.tells_climb else 2
        observed.tested_axes = 3 if by_ext_nav or (by_gps and self._aiding.mode == ABSOLUTE) else 2

    def _weigh_as_gps(self, observed: Observed, pose: PoseSample | None) -> None:
        """Replace variances by those of GPS while that tells them, else by those of what external navigation gave."""
        gps, params, ext_nav = self._gps, self._params, self._ext_nav
        by_accel = square(_NOISE_OF_ACCELERATION * self._state.acceleration())
        velocity = ext_nav.velocity if ext_nav.has_velocity else None
        vel_ne_var = square(limited(params.VELNE_M_NSE, _VEL_MIN_NOISE, _VEL_MAX_GATE_NOISE)) + by_accel
        observed.vel_gate_var = vel_ne_var
        vel_d_var = square(limited(params.VELD_M_NSE, _VEL_MIN_NOISE, _VEL_MAX_GATE_NOISE)) + by_accel
        if velocity is not None:
            vel_ne_var = vel_d_var = square(limited(velocity.err, _VEL_MIN_NOISE, _VEL_MAX_GATE_NOISE))
            observed.vel_gate_var = vel_ne_var + by_accel
        if gps.speed_accuracy > 0:
            vel_ne_var = square(limited(gps.speed_accuracy, params.VELNE_M_NSE, _VEL_MAX_NOISE))
            vel_d_var = square(limited(gps.speed_accuracy, params.VELD_M_NSE, _VEL_MAX_NOISE))
        observed.vel_ne_var, observed.vel_d_var = vel_ne_var, vel_d_var
        if gps.pos_accuracy > 0:
            observed.pos_var = square(limited(gps.pos_accuracy, params.POSNE_M_NSE, _POS_NE_MAX_NOISE))
        elif pose is not None:
            observed.pos_var = square(limited(pose.err, _POS_NE_MIN_NOISE, _POS_NE_MAX_NOISE_AT_REST))

    def _used_velocity(self) -> VelocitySample | None:
        is_used = self._ext_nav.has_velocity and self._sources.uses_vel_xy(EXTNAV)
        return self._ext_nav.velocity if is_used else None

    def _observe_standstill(self, vehicle: Vehicle, observed: Observed) -> None:
        """Without aiding the vehicle counts as being where it was, whenever a height is fused."""
        known = vehicle.armed and vehicle.tilt_aligned
        noise = limited(self._params.NOAID_M_NSE, 0.5, 50.0) if known else _DISARMED_NOISE
        observed.pos_var = square(noise)
        velocity = self._used_velocity()
        if self._height.is_new:
            observed.has_pos = True
            observed.north, observed.east = self._resets.last_known_ne
        elif velocity is not None:
            self._observe_velocity(observed, velocity)
            observed.vel_ne_var = square(noise)
            observed.vel_d_var = square(noise)
            observed.vel_gate_var = square(noise)

    def _observe_velocity(self, observed: Observed, velocity: VelocitySample) -> None:
        accel = self._state.acceleration()
        observed.has_vel = True
        observed.vel = velocity.vel
        observed.measure_axes(3 if self._sources.uses_vel_z(EXTNAV) else 2)
        observed.vel_ne_var = square(limited(velocity.err, _VEL_MIN_NOISE, _VEL_MAX_NOISE))
        observed.vel_d_var = observed.vel_ne_var
        observed.vel_gate_var = square(limited(velocity.err, _VEL_MIN_NOISE, _VEL_MAX_GATE_NOISE)) + square(
            _NOISE_OF_ACCELERATION * accel
        )

    def _observe_by_gps(self, observed: Observed, fix: GpsFix) -> None:
        gps, params = self._gps, self._params
        by_accel = square(_NOISE_OF_ACCELERATION * self._state.acceleration())
        observed.has_pos = True
        observed.north, observed.east = fix.pos[0], fix.pos[1]
        own = square(limited(params.POSNE_M_NSE, 0.1, 10.0)) + by_accel
        observed.pos_var = square(gps.pos_accuracy) if gps.pos_accuracy > 0 else own
        if not self._sources.uses_vel_xy(GPS):
            return
        observed.has_vel = True
        observed.vel = fix.vel
        observed.measure_axes(3 if fix.has_vertical_velocity and self._sources.uses_vel_z(GPS) else 2)
        observed.vel_gate_var = square(limited(params.VELNE_M_NSE, 0.05, 5.0)) + by_accel
        if gps.speed_accuracy > 0:
            observed.vel_ne_var = square(limited(gps.speed_accuracy, params.VELNE_M_NSE, 50.0))
            observed.vel_d_var = square(limited(gps.speed_accuracy, params.VELD_M_NSE, 50.0))
        else:
            observed.vel_ne_var = observed.vel_gate_var
            observed.vel_d_var = square(limited(params.VELD_M_NSE, 0.05, 5.0)) + by_accel

    def _observe_rest(self, now_ms: int, vehicle: Vehicle, observed: Observed, by_ext_nav: bool) -> None:
        """Hold the vehicle to have no velocity; while it aids, only where nothing has told its velocity of late."""
        if self._aiding.mode == NO_AIDING:
            if not vehicle.tilt_aligned:
                return
            variance = square(smaller(self._params.NOAID_M_NSE, _REST_NOISE))
            observed.pos_var = variance
        else:
            aiding = self._aiding
            if now_ms - max(aiding.vel_ms, aiding.flow_ms, aiding.odometry_ms) < _REST_AFTER_MS:
                return
            variance = square(_REST_NOISE)
            observed.pos_var = self._pos_var_at_rest(by_ext_nav)
        observed.is_rest = True
        observed.has_vel = True
        observed.vel = ZERO
        observed.vel_axes = 3
        observed.tested_axes = self._tested_at_rest()
        observed.vel_ne_var = variance
        observed.vel_d_var = variance
        observed.vel_gate_var = variance

    def _pos_var_at_rest(self, by_ext_nav: bool) -> float:
        pose = self._ext_nav.pose
        if by_ext_nav and pose is not None:
            return square(limited(pose.err, _POS_NE_MIN_NOISE, _POS_NE_MAX_NOISE_AT_REST))
        if self._gps.pos_accuracy > 0:
            return square(self._gps.pos_accuracy)
        return square(limited(self._params.POSNE_M_NSE, 0.1, 10.0))

    def _tested_at_rest(self) -> int:
        """Return on how many axes rest is tested: the vertical one counts if there is a source of its velocity."""
        fix = self._gps.delayed
        by_gps = fix is not None and fix.has_vertical_velocity and self._sources.uses_vel_z(GPS)
        by_ext_nav = self._ext_nav.have_velocity and self._sources.uses_vel_z(EXTNAV)
        return 3 if by_ext_nav or (by_gps and self._aiding.mode == ABSOLUTE) else 2

    def _check_imu(self, now_ms: int, observed: Observed, fix: GpsFix) -> None:
        """Find out whether the accelerometers are bad: height and vertical velocity are off alike (FuseVelPosNED)."""
        has_climb = fix.has_vertical_velocity if self._fuses_any_climb else observed.vel_axes == 3
        if not has_climb or not observed.has_vel or self._sources.pos_z() == GPS:
            return
        state = self._state
        height_error, climb_error = state.pos[2] - self._height.down, state.vel[2] - observed.vel[2]
        since_bad_ms = now_ms - self._bad_imu_ms
        if since_bad_ms > 2 * _BAD_IMU_HOLD_MS:
            sigmas_squared = 9.0
        else:
            sigmas_squared = 4.0 if since_bad_ms > 1.5 * _BAD_IMU_HOLD_MS else 1.0
        is_off = (
            height_error * climb_error > 0
            and square(height_error) > sigmas_squared * self._height.variance
            and square(climb_error) > sigmas_squared * observed.vel_d_var
        )
        if is_off:
            self._bad_imu_ms = now_ms
        else:
            self._good_imu_ms = now_ms
        is_bad = since_bad_ms < _BAD_IMU_HOLD_MS
        state.doubt_accel(is_bad, square(self._params.VELD_M_NSE), square(self._params.ALT_M_NSE))
        if is_bad:
            state.set_vel((state.vel[0], state.vel[1], fix.vel[2]))

    # Gates and fusion

    def _fuse(self, now_ms: int, vehicle: Vehicle, observed: Observed) -> None:
        """Test all with the covariance as it was before the step, then fuse what passed (FuseVelPosNED)."""
        height = self._height
        self._velocity_was_reset = False
        pos_ok = observed.has_pos and self._test_position(now_ms, observed)
        vel_ok = observed.has_vel and not self._velocity_was_reset and self._test_velocity(now_ms, observed)
        height_ok = height.is_new and self._test_height(now_ms, vehicle)
        by_ground_effect = height_ok and vehicle.near_ground and height.active == BARO
        # With few satellites whatever GPS is the source of counts for less, even if it is assumed for want of GPS.
        scale = square(self._gps.noise_scaler)
        if vel_ok:
            scales_vel = self._scales_all_noise or self._sources.uses_vel_xy(GPS)
            self._fuse_velocity(observed, scale if scales_vel else 1.0)
        if pos_ok:
            scales_pos = self._scales_all_noise or self._sources.pos_xy() == GPS
            variance = observed.pos_var * (scale if scales_pos else 1.0)
            north = self._update(POS, observed.north, variance)
            east = self._update(POS + 1, observed.east, variance)
            self.pos_innovation = north, east, self.pos_innovation[2]
        if height_ok:
            down = (
                self._fuse_height_near_ground()
                if by_ground_effect
                else self._update(POS_D, height.down, height.variance)
            )
            self.pos_innovation = self.pos_innovation[0], self.pos_innovation[1], down

    def _update(self, index: int, measured: float, variance: float) -> float:
        """Fuse a measurement of a state; return its innovation."""
        innovation = self._state.component(index) - measured
        self._state.update_state(index, innovation, variance)
        return innovation

    def _fuse_velocity(self, observed: Observed, scale: float) -> None:
        ne_var, vel = scale * observed.vel_ne_var, observed.vel
        north = self._update(VEL, vel[0], ne_var)
        east = self._update(VEL + 1, vel[1], ne_var)
        down = self.vel_innovation[2]
        if observed.vel_axes == 3:
            down = self._update(VEL + 2, vel[2], scale * observed.vel_d_var)
        self.vel_innovation = north, east, down

    def _fuse_height_near_ground(self) -> float:
        innovation = self._state.pos[2] - self._height.down
        innovation += limited(_GROUND_EFFECT_FLOOR - innovation, 0.0, _GROUND_EFFECT_FLOOR + _GROUND_EFFECT_DEAD_ZONE)
        self._state.update_state(POS_D, innovation, self._height.variance)
        return innovation

    def _limits_glitches(self) -> bool:
        return self._params.GLITCH_RAD > 0

    def _test_position(self, now_ms: int, observed: Observed) -> bool:
        """Return whether to fuse a position; False as well when the filter was reset to it instead."""
        state, aiding = self._state, self._aiding
        north, east = state.pos[0] - observed.north, state.pos[1] - observed.east
        self.pos_innovation = north, east, self.pos_innovation[2]
        spread = state.cov.var(POS) + state.cov.var(POS + 1)
        ratio = (north * north + east * east) / (gate(self._params.POS_I_GATE) * (spread + 2 * observed.pos_var))
        self.pos_ratio = ratio
        passed = ratio < 1 or aiding.mode == NO_AIDING or not self._limits_glitches()
        if passed:
            aiding.pos_ms = now_ms
        if not (passed or aiding.pos_timeout or state.accel_is_bad):
            self._tell_pose(ev.GATE_POSITION, ratio)
            return False
        is_wide = self._limits_glitches() and spread > square(self._params.GLITCH_RAD)
        if not (aiding.pos_timeout or is_wide) or (aiding.vel_aiding and not self._gps.checks.good):
            self._tell_pose(ev.FUSED, ratio)
            return True
        self._reset_position(now_ms)
        return False

    def _reset_position(self, now_ms: int) -> None:
        self._velocity_was_reset = self._aiding.vel_timeout
        self._resets.position(now_ms, False)
        self._state.clear(POS, POS + 2, square(0.5 * self._params.GLITCH_RAD))
        self.pos_ratio = 0.0
        self._tell_pose(ev.RESET_TO, ev.UNTESTED)
        if self._velocity_was_reset:
            self._resets.velocity(now_ms, False, False)
            self.vel_ratio = 0.0

    def _test_velocity(self, now_ms: int, observed: Observed) -> bool:
        state, aiding = self._state, self._aiding
        axes = observed.tested_axes
        x, y, z = state.vel[0] - observed.vel[0], state.vel[1] - observed.vel[1], state.vel[2] - observed.vel[2]
        innovations = x * x + y * y
        spread = state.cov.var(VEL) + state.cov.var(VEL + 1) + axes * observed.vel_gate_var
        if axes == 3:
            innovations += z * z
            spread += state.cov.var(VEL + 2)
        ratio = innovations / (gate(self._params.VEL_I_GATE) * spread)
        self.vel_ratio = ratio
        passed = ratio < 1 or not self._limits_glitches()
        if passed:
            aiding.vel_ms = now_ms
            if ratio >= 1:
                aiding.pos_ms = now_ms
        if not (passed or aiding.vel_timeout or state.accel_is_bad):
            self._tell_velocity(observed, ev.GATE_VELOCITY, ratio)
            return False
        if aiding.mode == ABSOLUTE and aiding.vel_timeout:
            self._resets.velocity(now_ms, False, False)
            self.vel_ratio = 0.0
            self._tell_velocity(observed, ev.RESET_TO, ev.UNTESTED)
            return False
        self._tell_velocity(observed, ev.FUSED, ratio)
        return True

    def _test_height(self, now_ms: int, vehicle: Vehicle) -> bool:
        height, state, aiding = self._height, self._state, self._aiding
        innovation = state.pos[2] - height.down
        self.pos_innovation = self.pos_innovation[0], self.pos_innovation[1], innovation
        spread = state.cov.var(POS_D) + height.variance
        ratio = square(innovation) / (gate(self._params.HGT_I_GATE) * spread)
        self.height_ratio = ratio
        standing = aiding.mode == NO_AIDING and vehicle.on_ground
        passed = ratio < (_MAX_RATIO_ON_GROUND if standing else 1.0)
        if not (passed or standing or self._limits_glitches()) and height.active == GPS:
            passed, aiding.pos_ms = True, now_ms
        if passed:
            aiding.height_ms = now_ms
        if passed or height.is_lost or state.accel_is_bad:
            self._follow_innovation(now_ms, vehicle, innovation)
        if height.is_lost:
            self.reset_height(now_ms, vehicle)
            self._tell_height(ev.RESET_TO, ev.UNTESTED)
            return False
        passed = passed or state.accel_is_bad
        self._tell_height(ev.FUSED if passed else ev.GATE_HEIGHT, ratio)
        return passed

    def _follow_innovation(self, now_ms: int, vehicle: Vehicle, innovation: float) -> None:
        """Smooth the innovation of height on the ground."""
        if vehicle.on_ground:
            dt = 0.001 * (now_ms - self._aiding.height_ms)
            self.still_height += (innovation - self.still_height) * dt / (dt + 2.0)
        else:
            self.still_height = 0.0

    def reset_height(self, now_ms: int, vehicle: Vehicle) -> None:
        """Put height where it was measured last."""
        height, velocity, fix = self._height, self._ext_nav.velocity, self._gps.newest
        height.is_lost = False
        sets_climb, vel_down = vehicle.on_ground, 0.0
        if vehicle.in_flight and fix is not None and self._gps_tells_climb(now_ms, fix):
            sets_climb, vel_down = True, fix.vel[2]
        elif vehicle.in_flight and velocity is not None and height.active == EXTNAV:
            sets_climb, vel_down = True, velocity.vel[2]
        self._resets.height(now_ms, height.down, height.variance, sets_climb, vel_down)
        height.terrain.follow_height(vehicle.on_ground)

    def _gps_tells_climb(self, now_ms: int, newest: GpsFix) -> bool:
        delayed = self._gps.delayed
        is_fresh = delayed is not None and since_ms(now_ms, delayed.time_ms) < FRESH_MS
        is_used = self._sources.uses_vel_z(GPS) and (self._gps.is_in_use or self._state.accel_is_bad)
        return is_fresh and is_used and newest.has_vertical_velocity

    # What became of samples of external navigation

    def _tell_unused(self, pose: bool, velocity: bool) -> None:
        ext_nav = self._ext_nav
        if pose and ext_nav.has_pose and ext_nav.pose is not None:
            self._events.tell(ev.POSE, ev.UNUSED, ext_nav.pose.time_ms)
        unused = ext_nav.velocity if ext_nav.has_velocity else None
        if unused is not None and (velocity or self._used_velocity() is None):
            self._events.tell(ev.VELOCITY, ev.UNUSED, unused.time_ms)

    def _tell_pose(self, rule: int, ratio: float) -> None:
        pose = self._ext_nav.pose
        by_ext_nav = self._aiding.mode == ABSOLUTE and self._sources.pos_xy() == EXTNAV
        if by_ext_nav and self._ext_nav.has_pose and pose is not None:
            length = length2(self.pos_innovation[0], self.pos_innovation[1])
            self._events.tell(ev.POSE, rule, pose.time_ms, _root(ratio), length)

    def _tell_velocity(self, observed: Observed, rule: int, ratio: float) -> None:
        velocity = self._used_velocity()
        if velocity is None or observed.is_rest:
            return
        # The filter keeps the innovations of velocities that it fuses; they are wanted of those that it rejects, too.
        x, y, z = self._state.vel[0] - velocity.vel[0], self._state.vel[1] - velocity.vel[1], 0.0
        if observed.tested_axes == 3:
            z = self._state.vel[2] - velocity.vel[2]
        self._events.tell(ev.VELOCITY, rule, velocity.time_ms, _root(ratio), math.sqrt(x * x + y * y + z * z))

    def _tell_height(self, rule: int, ratio: float) -> None:
        pose = self._ext_nav.pose
        if self._height.active == EXTNAV and self._ext_nav.has_pose and pose is not None:
            self._events.tell(ev.HEIGHT, rule, pose.time_ms, _root(ratio), abs(self.pos_innovation[2]))


def _root(ratio: float) -> float:
    return math.sqrt(ratio) if ratio >= 0.0 else ev.UNTESTED
