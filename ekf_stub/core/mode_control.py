# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter is about: flight, alignment, the aiding mode and the status flags.

Source: AP_NavEKF3/AP_NavEKF3_Control.cpp (controlFilterModes, setAidingMode, updateFilterStatus).
"""

import math
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from ap_core.cint import u32
from ap_core.fmath import f32
from ap_core.location import Location
from ekf_stub.core.frame import Frame
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.nominal_state import down_of
from ekf_stub.filter.release import FilterRelease
from ekf_stub.filter.states import GYRO
from ekf_stub.fusion.aiding import ABSOLUTE, NO_AIDING, RELATIVE, Aiding, Ready
from ekf_stub.fusion.body_odometry import BodyOdometry
from ekf_stub.fusion.filter_flags import FilterState, filter_flags
from ekf_stub.fusion.flow_fusion import FlowFusion
from ekf_stub.fusion.height_source import HeightSource, Vehicle
from ekf_stub.fusion.measurements import Delayed
from ekf_stub.fusion.resets import Resets
from ekf_stub.fusion.vel_pos_fusion import VelPosFusion
from ekf_stub.fusion.yaw_fusion import YawFusion
from ekf_stub.inputs.ext_nav_ingest import ExtNavIngest
from ekf_stub.inputs.flow_ingest import FlowIngest
from ekf_stub.inputs.gps_reading import GpsReading
from ekf_stub.inputs.range_reading import RangeReading
from ekf_stub.inputs.sources import XY_EXTNAV, XY_GPS, YAW_COMPASS, YAW_NONE, Z_EXTNAV, Z_GPS, EkfSources
from ekf_stub.reports.core_report import Three
from ekf_stub.reports.core_texts import MAV_SEVERITY_WARNING, CoreTexts
from ekf_stub.reports.filter_status import FilterFlag

HEALTHY_AFTER_MS: Final = 1000
TILT_ALIGNED_VAR: Final = math.radians(5.0) ** 2
IN_FLIGHT_CLIMB_M: Final = 1.5
IN_FLIGHT_RANGE_M: Final = 0.5
TAKEOFF_AFTER_MS: Final = 1000
TAKEOFF_RATE: Final = 0.1
TAKEOFF_RANGE_M: Final = 0.1
FLOW_FRESH_MS: Final = 200
FLYING_MS: Final = 5000
USING_POSITION_MS: Final = 4000
MAX_STILL_INNOVATION_M: Final = 1.0
GYRO_BIAS_LEARNED_DEG: Final = 0.15
ODOMETRY_FRESH_MS: Final = 200
ODOMETRY_IN_USE_MS: Final = 5000
MAX_ODOMETRY_ERR: Final = f32(1)
NO_DRAG_MS: Final = 5000
ORIGIN_MOVES_MS: Final = 1000
_HORIZ_VEL, _TAKEOFF_DETECTED = 1, 10
_TAKEOFF, _TOUCHDOWN, _USING_POSITION, _GLITCHING, _QUALITY_GOOD, _INITIALISED = 11, 12, 13, 14, 15, 16


class ControlledCore(Protocol):
    """The core as its modes see it: whether the last frame has made a step, and the parts that they look at."""

    stepped: bool
    origin: Location | None
    release: FilterRelease
    sources: EkfSources
    ingest: ExtNavIngest
    gps: GpsReading
    ranges: RangeReading
    flow_ingest: FlowIngest
    state: ErrorState
    aiding: Aiding
    delayed: Delayed
    resets: Resets
    height: HeightSource
    fusion: VelPosFusion
    yaw: YawFusion
    flow: FlowFusion
    odometry: BodyOdometry


class ModeControl:
    """Decides, once a frame, how the core navigates; and, once a step, what it says of itself.

    Flight and yaw sources it looks at in frames in which they can have changed.

    Attributes:
        vehicle: what is known of the vehicle.
        tilt_aligned: roll and pitch are known.
        tests_stillness: it is to be found out whether the vehicle stands still.
        flags: bits of nav_filter_status.
    """

    def __init__(self, core: ControlledCore) -> None:
        self._core = core
        self._initialised_ms: int | None = None
        self.vehicle = Vehicle(armed=False, on_ground=True, in_flight=False, tilt_aligned=False)
        self._known = (False, False, False, False)
        self._states_on_ground = core.state.states
        self._range_on_ground = 0.0
        self._armed_ms = self._origin_moved_ms = 0
        self._states: Array | None = None
        self._sources: dict[str, int] | None = None
        self._situation: tuple[object, ...] = ()
        self.tests_stillness = self._no_yaw_on_ground = False
        self.tilt_aligned = self._learns_biases = False
        self.flags = self._state_flags = self._now_ms = 0
        self._dt_ekf_avg = 0.0
        self._state: tuple[object, ...] = ()

    # Every frame

    def update(
        self, frame: Frame, now_ms: int, dt_ekf_avg: float, get_float: Callable[[str], float], texts: CoreTexts
    ) -> None:
        """Find out what the vehicle is about, and choose how to navigate."""
        core = self._core
        if self._initialised_ms is None:
            self._initialised_ms = self._now_ms = now_ms
        if self.tilt_aligned and not self._learns_biases:
            # FIRMWARE PARITY: a frame late. Until then their variances are 0, so that they count as known.
            self._learns_biases = True
            core.state.learn_biases(get_float("ACC_BIAS_LIM"), dt_ekf_avg)
        if core.stepped or self._is_news(frame):
            if not self.tilt_aligned and core.state.predicted_tilt_variance < TILT_ALIGNED_VAR:
                self.tilt_aligned = True
                texts.add("tilt alignment complete")
            self._detect_flight(frame, dt_ekf_avg)
            core.yaw.control(self.vehicle)
            source = core.yaw.source
            self._no_yaw_on_ground = source == YAW_NONE and not frame.armed
            by_compass = source == YAW_COMPASS and core.yaw.uses_compass
            self.tests_stillness = self.vehicle.on_ground and (core.release.fuses_rest or not by_compass)
        no_yaw = self._no_yaw_on_ground
        if core.aiding.mode is RELATIVE and core.release.relative_needs_no_yaw:
            no_yaw = False
        if no_yaw and core.aiding.mode is not NO_AIDING:
            self._forget_flight(self._now_ms)
        self._dt_ekf_avg = dt_ekf_avg
        # The frame's inertial data are read after this, so that the time is still that of the last.
        if core.aiding.update(self._now_ms, self._ready, no_yaw_on_ground=no_yaw):
            self._enter_mode(self._now_ms, self._ready(), texts)
        if core.aiding.position_is_lost:
            core.gps.is_in_use = False
        self._now_ms = now_ms

    def quiet_until_ms(self) -> int | None:
        """Return until when, included, frames without a step bring about nothing here; None if the next one may."""
        core = self._core
        awaits_motion = core.ingest.have_odometry or core.flow_ingest.received_ms is not None
        if not self._learns_biases or (self._no_yaw_on_ground and core.aiding.mode is not NO_AIDING):
            return None
        if awaits_motion and core.aiding.mode is NO_AIDING:  # which counts from the frame after it on
            return None
        return core.aiding.quiet_until_ms(self._ready)

    def pass_quietly(self, now_ms: int) -> None:
        """Go on to the time of a frame that brings about nothing here."""
        self._now_ms = now_ms

    def _forget_flight(self, now_ms: int) -> None:
        """Restart with what was known by a yaw that the vehicle has lost as it was disarmed."""
        core = self._core
        mode, core.aiding.mode = core.aiding.mode, NO_AIDING
        core.yaw.aligned = False
        core.yaw.by_gps.forget_course()
        core.resets.velocity(now_ms)
        core.resets.position(now_ms)
        core.fusion.reset_height(now_ms, self.vehicle)
        core.state.forget_correlations()
        core.aiding.mode = mode

    def _is_news(self, frame: Frame) -> bool:
        """Return whether anything may have changed since the last frame, in which there was no step."""
        states, sources = self._core.state.states, self._core.sources.active()
        expected = frame.takeoff_expected, frame.touchdown_expected
        situation = frame.armed, frame.flying_ms > FLYING_MS, expected, self._core.yaw.compass.is_used()
        if states is self._states and sources is self._sources and situation == self._situation:
            return False
        self._states, self._sources, self._situation = states, sources, situation
        return True

    def _detect_flight(self, frame: Frame, dt_ekf_avg: float) -> None:
        if not frame.armed:
            self._states_on_ground, self._range_on_ground = self._core.state.states, self._core.ranges.newest
        elif not self.vehicle.armed:
            self._armed_ms = self._now_ms
        in_flight = frame.armed and (
            self.vehicle.in_flight
            or self.climbed_m() > IN_FLIGHT_CLIMB_M
            or self._core.ranges.newest - self._range_on_ground > IN_FLIGHT_RANGE_M
            or frame.flying_ms > FLYING_MS
        )
        near_ground = frame.takeoff_expected or frame.touchdown_expected
        known = frame.armed, in_flight, near_ground, self.tilt_aligned
        if known != self._known:
            self._known = known
            self.vehicle = Vehicle(frame.armed, not frame.armed, in_flight, near_ground, self.tilt_aligned)
        gsf = self._core.yaw.by_gps
        gsf.follow_flight(self.vehicle, takeoff_expected=frame.takeoff_expected, dt_ekf_avg=dt_ekf_avg)

    def detect_takeoff(self, gyro: Three, dt_ekf_avg: float) -> None:
        """Find out by filtered body rates as flow comes in whether the vehicle flies (detectOptFlowTakeoff)."""
        core = self._core
        if self.vehicle.on_ground:
            core.flow.takeoff_detected = False
        elif not core.flow.takeoff_detected and self._now_ms - self._armed_ms > TAKEOFF_AFTER_MS:
            bias, _ = core.state.bias_rates(dt_ekf_avg)
            has_climbed = core.ranges.newest > self._range_on_ground + TAKEOFF_RANGE_M
            core.flow.takeoff_detected = math.dist(gyro, bias) > TAKEOFF_RATE or has_climbed

    def climbed_m(self) -> float:
        """Return the height above where the vehicle was disarmed."""
        return down_of(self._states_on_ground) - self._core.state.down

    def _ready(self) -> Ready:
        core, now_ms, dt_ekf_avg = self._core, self._now_ms, self._dt_ekf_avg
        source = core.sources.pos_xy()
        if not self.tilt_aligned:
            return Ready(gps=False, ext_nav=False, odometry=False)
        gps = core.gps.checks.good and core.gps.is_due and core.origin is not None and core.yaw.aligned
        return Ready(
            gps=source == XY_GPS and gps and self._knows_gyro_bias(dt_ekf_avg),
            ext_nav=source == XY_EXTNAV and core.delayed.has_pose,
            odometry=self._odometry_is_good(now_ms) and self._knows_gyro_bias(dt_ekf_avg),
            flow=self._flow_is_fresh(now_ms) and self._knows_gyro_bias(dt_ekf_avg),
        )

    def _knows_gyro_bias(self, dt_ekf_avg: float) -> bool:
        variances = self._core.state.cov.diagonal()[GYRO]
        return bool(variances.max() <= math.radians(GYRO_BIAS_LEARNED_DEG * dt_ekf_avg) ** 2)

    def _flow_is_fresh(self, now_ms: int) -> bool:
        received_ms = self._core.flow_ingest.received_ms
        return received_ms is not None and now_ms - received_ms < FLOW_FRESH_MS and self._core.flow.is_used()

    def _odometry_is_good(self, now_ms: int) -> bool:
        ingest = self._core.ingest
        fresh = ingest.have_odometry and u32(now_ms - ingest.odometry_ms) < ODOMETRY_FRESH_MS
        exact = bool(ingest.odometry_err < MAX_ODOMETRY_ERR)
        return fresh and exact and self._core.sources.uses_vel_xy(XY_EXTNAV)

    def _enter_mode(self, now_ms: int, ready: Ready, texts: CoreTexts) -> None:
        core = self._core
        mode = core.aiding.mode
        by_velocity = by_gps = False
        if mode is NO_AIDING:
            texts.add("stopped aiding", MAV_SEVERITY_WARNING)
            core.fusion.innovations.vel_ratio = core.fusion.innovations.pos_ratio = 0.0
            core.resets.last_known_ne = core.state.pos[:2].copy()
            core.state.pos = np.array([*core.state.pos[:2], -core.height.baro_height])
            core.odometry.is_fused = core.flow.is_fused = False
        elif mode is RELATIVE:
            texts.add("started relative aiding")
            if ready.flow:
                core.flow_ingest.valid_ms = now_ms
        elif ready.gps:
            by_gps = True
            texts.add("is using GPS")
        else:
            by_velocity = core.ingest.have_velocity
            self._start_by_ext_nav(now_ms, texts)
        vel_timeout = core.aiding.vel_timeout
        core.resets.velocity(now_ms, by_ext_nav=by_velocity, by_gps=by_gps)
        core.resets.position(now_ms, by_gps=by_gps)
        core.aiding.vel_timeout = vel_timeout

    def _start_by_ext_nav(self, now_ms: int, texts: CoreTexts) -> None:
        core = self._core
        pose, velocity = core.delayed.pose, core.delayed.velocity
        if pose is None:
            return
        texts.add("is using external nav data")
        texts.add("initial pos NED = {:3.1f},{:3.1f},{:3.1f} (m)".format(*pose.pos))
        if core.ingest.have_velocity:
            vel = np.zeros(3) if velocity is None else velocity.vel
            texts.add("initial vel NED = {:3.1f},{:3.1f},{:3.1f} (m/s)".format(*vel))
        if core.sources.pos_z() == Z_EXTNAV or not core.release.resets_height_by_its_source:
            core.height.use_pose()
            core.fusion.reset_height(now_ms, self.vehicle)

    # Every step

    def healthy(self, now_ms: int) -> bool:
        """Return whether nothing is wrong (NavEKF3_core::healthy)."""
        innovations = self._core.fusion.innovations
        if self._initialised_ms is None or now_ms - self._initialised_ms < HEALTHY_AFTER_MS:
            return False
        if min(innovations.vel_ratio, innovations.pos_ratio, innovations.height_ratio) > 1:
            return False
        if self._core.aiding.mode is not NO_AIDING or not self.vehicle.on_ground:
            return True
        still = math.hypot(*innovations.pos[:2].tolist()), abs(innovations.still_height)
        return not max(still) > MAX_STILL_INNOVATION_M

    def update_flags(self, frame: Frame, now_ms: int) -> None:
        """Work out the status flags, those of EKF_STATUS_REPORT and beyond."""
        core = self._core
        aiding = core.aiding
        healthy = self.healthy(now_ms)
        state = (
            healthy,
            self.tilt_aligned,
            core.yaw.aligned,
            core.yaw.uses_compass,
            aiding.mode,
            aiding.pos_timeout,
            aiding.vel_timeout,
            core.height.is_lost,
            core.ingest.have_velocity or core.gps.tells_climb,
            core.odometry.is_fused and now_ms - aiding.times.odometry < ODOMETRY_IN_USE_MS,
            core.flow.is_valid,
            core.flow.ground_is_valid,
            core.origin is None and core.sources.pos_z() == Z_GPS,
        )
        if state != self._state:  # from one step to the next it seldom changes
            self._state = state
            self._state_flags = int(filter_flags(FilterState(*state)) & ~FilterFlag.UNINITIALISED)
        value = self._state_flags
        absolute = aiding.mode is ABSOLUTE
        by_gps = absolute and core.sources.pos_xy() == XY_GPS
        core.height.velocity_is_valid = value >> _HORIZ_VEL & 1 == 1
        value |= core.flow.takeoff_detected << _TAKEOFF_DETECTED
        value |= frame.takeoff_expected << _TAKEOFF | frame.touchdown_expected << _TOUCHDOWN
        value |= (absolute and now_ms - aiding.times.pos < USING_POSITION_MS) << _USING_POSITION
        value |= (by_gps and not core.gps.accuracy_good) << _GLITCHING
        self.flags = value | core.gps.checks.good << _QUALITY_GOOD | healthy << _INITIALISED
        if now_ms - self._origin_moved_ms >= ORIGIN_MOVES_MS:
            self._origin_moved_ms = now_ms
            if core.origin is not None and value >> _USING_POSITION & 1:
                core.height.terrain.move_origin()

    def timeouts(self, now_ms: int) -> int:
        """Return the bits of XKF4.TS; airspeed and drag are always lost, the latter 5 s after boot."""
        aiding, mag = self._core.aiding, self._core.yaw.compass.is_lost
        drag = now_ms > NO_DRAG_MS
        lost = aiding.pos_timeout | aiding.vel_timeout << 1 | self._core.height.is_lost << 2 | mag << 3
        return lost | 1 << 4 | drag << 5
