# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One core of EKF3: inertial data in, estimates out (AP_NavEKF3/AP_NavEKF3_core.cpp, UpdateFilter).

Range beacons, airspeed and wind are not fused; external navigation, optical flow, range finders, barometer, compass and
GPS are.

The filter lives at the fusion horizon, as far in the past as the most delayed sensor needs. Inertial data go two ways:
summed up to steps of about 10 ms they wait until the horizon reaches them, and at the full rate they carry an output
from the horizon to the present, which each step draws towards the filter. A step predicts, takes out of the buffers
what has come due, and fuses it in the firmware's order: yaw, then velocity, position and height, then optical flow,
then body odometry.
"""

import math
from typing import Final, final

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.core import events as ev
from ekf_stub.core.aiding import ABSOLUTE, NO_AIDING, RELATIVE, Aiding, Ready, Vehicle
from ekf_stub.core.compass import CompassReader
from ekf_stub.core.covariance import GYRO, POS
from ekf_stub.core.events import Events, Text
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.flags import FilterState, filter_flags
from ekf_stub.core.flow import FlowFusion, FlowReading
from ekf_stub.core.gps import CENTI, Gps, GpsSurroundings, distance_ned
from ekf_stub.core.gps_yaw import GpsYaw
from ekf_stub.core.height import IN_MEASUREMENTS, HeightSource, OriginHeight
from ekf_stub.core.imus import Imus, InactiveBiases
from ekf_stub.core.inertial import GRAVITY_MSS, LOOP_DT, MIN_DT, DownSampler, Inertial, Stillness
from ekf_stub.core.inputs import CoreInputs
from ekf_stub.core.odometry import BodyOdometry
from ekf_stub.core.output import OutputPredictor
from ekf_stub.core.params import (
    COMPASS,
    EXTNAV,
    GPS,
    GPS_COMPASS_FALLBACK,
    GPS_YAW,
    NONE,
    RANGEFINDER,
    EkfSources,
    Params,
)
from ekf_stub.core.ranges import RangeFinders
from ekf_stub.core.resets import Resets
from ekf_stub.core.samples import HALF_FILTER_STEP_MS, SENSOR_INTERVAL_MIN_MS, BaroSample, RingSizes
from ekf_stub.core.state import EARTH_RATE, State
from ekf_stub.core.terrain import Terrain
from ekf_stub.core.vectors import (
    U32,
    ZERO,
    Vec2,
    Vec3,
    larger,
    later_ms,
    length,
    length2,
    limited,
    quat_of_euler,
    scaled,
    signed_since_ms,
    since_ms,
    single,
    smaller,
    square,
    sub,
    to_body,
)
from ekf_stub.core.vel_pos import VelPosFusion
from ekf_stub.core.yaw_fusion import IN_USE_MS as YAW_IN_USE_MS
from ekf_stub.core.yaw_fusion import YawFusion
from ekf_stub.release import FilterRelease

AFFINITY_GPS: Final = 1 << 0  # of EK3_AFFINITY
AFFINITY_BARO: Final = 1 << 1
AFFINITY_MAG: Final = 1 << 2
_BOOTSTRAP_MS: Final = 1000
_FORCED_RESET_MS: Final = 5000
_DEAD_RECKONING_MS: Final = 1000
_MAX_PLACE_AGE_MS: Final = 5000
_LONG_AGO_MS: Final = 1 << 30
_MIN_STEP: Final = 0.1  # of the average step
_MOST_PASSES_OF_STEP: Final = 8  # 12 ms in passes of 2.5 ms, and three more
_COMPASS_SHARE: Final = 0.30000001192092896
_FIX_2D: Final = 2

_HEALTHY_AFTER_MS: Final = 1000
_TILT_ALIGNED_VAR: Final = math.radians(5.0) ** 2
_IN_FLIGHT_CLIMB_M: Final = 1.5
_IN_FLIGHT_RANGE_M: Final = 0.5
_TAKEOFF_AFTER_MS: Final = 1000
_TAKEOFF_RATE: Final = 0.1
_TAKEOFF_RANGE_M: Final = 0.1
_FLOW_FRESH_MS: Final = 200
_FLYING_MS: Final = 5000
_MAX_STILL_INNOVATION_M: Final = 1.0
_GYRO_BIAS_LEARNED: Final = math.radians(0.15)
_ODOMETRY_FRESH_MS: Final = 200
_ODOMETRY_IN_USE_MS: Final = 5000
_MAX_ODOMETRY_ERR: Final = 1.0
_NO_DRAG_MS: Final = 5000
_ORIGIN_MOVES_MS: Final = 1000
_USING_POSITION_MS: Final = 4000
_HORIZ_VEL: Final = 1 << 1
_TAKEOFF_DETECTED: Final = 1 << 10
_TAKEOFF: Final = 1 << 11
_TOUCHDOWN: Final = 1 << 12
_USING_POSITION: Final = 1 << 13
_GLITCHING: Final = 1 << 14
_QUALITY_GOOD: Final = 1 << 15
_INITIALISED: Final = 1 << 16

_STILLNESS_INTERVAL_MS: Final = 200  # of records
_TILT_INTERVAL_MS: Final = 500


@final
class CommonOrigin:
    """Where positions are told from: the first origin that any core has set, None before (common_EKF_origin)."""

    def __init__(self) -> None:
        self.place: Location | None = None


@final
class Core:
    """The filter, from its first inertial data on.

    Args:
        common: the origin that it shares with other cores.
        number: the core's.
        imu: whose data it uses.
        texts: where its texts are put.

    Attributes:
        inputs: what it is given beside inertial data.
        ext_nav: where external navigation is handed in.
        events: what it has said.
        initialised: it has a state.
        stepped: whether the last pass has made a step.
        refused: in how many passes inertial data could not be used; those before stood in.
        delta: the inertial data of the last pass, as it used them.
        origin: where its own positions count from, None until it is set.
        stillness: the test for standing still.
        logs_stillness, logs_tilt: the last pass has brought what is to be logged (XKFM, XKTV).
        flags: bits of nav_filter_status.
        vehicle: what is known of the vehicle.
        tilt_aligned: roll and pitch are known.
    """

    def __init__(
        self,
        params: Params,
        sources: EkfSources,
        sizes: RingSizes,
        release: FilterRelease,
        common: CommonOrigin,
        number: int,
        imu: int,
        texts: list[Text],
    ) -> None:
        self._params = params
        self.sources = sources
        self._sizes = sizes
        self._release = release
        self._fuses_rest = release.fuses_rest
        self._common = common
        self.number = number
        self.imu = imu
        self.inputs = CoreInputs()
        self.events = Events(number, texts)
        self.ext_nav = ExtNav(self.events, sizes if sources.ext_nav_enabled() else None, True)
        self.ranges = RangeFinders(sizes.ranges)
        self.flow_reading = FlowReading(sizes.flow)
        self.gps = Gps(params, sizes.slow)
        self.stillness = Stillness()
        self._sampler = DownSampler()
        self.origin: Location | None = None
        self._origin_height = OriginHeight()
        self.delta = Inertial((0.0, 0.0, -GRAVITY_MSS * LOOP_DT), ZERO, LOOP_DT, LOOP_DT)  # at rest
        self.has_delta = False
        self.refused = 0
        self.initialised = False
        self.stepped = False
        self.logs_stillness = False
        self.logs_tilt = False
        self._first_ms = -1
        self._now_ms = 0
        self._was_still = False
        self._stillness_logged_ms = 0
        self._tilt_logged_ms = 0
        self._passes_of_step = 0
        self._restart(quat_of_euler(0.0, 0.0, 0.0), 0)

    # Starting up

    def _bootstrap(self, now_ms: int) -> None:
        if self._first_ms < 0:
            self._first_ms = now_ms
        elif now_ms - self._first_ms >= _BOOTSTRAP_MS:
            self._common.place = None
            self._initialise(now_ms)
            self._has_begun = True

    def _initialise(self, now_ms: int) -> None:
        """Begin with the attitude that the accelerometers show, at rest and facing north, and without an origin."""
        self.origin = None
        accel = self.stillness.accel
        size = length(accel)
        x, y, z = scaled(accel, 1.0 / size) if size > 1e-3 else (0.0, 0.0, -1.0)
        self._restart(quat_of_euler(math.atan2(-y, -z), math.asin(limited(x, -1.0, 1.0)), 0.0), now_ms)
        self.ext_nav.initialised = True
        self.initialised = True
        self.events.say(ev.INITIALISED)

    def _restart(self, quat: tuple[float, float, float, float], now_ms: int) -> None:
        """Begin from an attitude, and forget all measurements (InitialiseVariables)."""
        params, sources, sizes, events = self._params, self.sources, self._sizes, self.events
        ext_nav, gps = self.ext_nav, self.gps
        vel_ne, pos_ne = square(params.VELNE_M_NSE), square(params.POSNE_M_NSE)
        vel_vars, pos_vars = (
            (vel_ne, vel_ne, square(params.VELD_M_NSE)),
            (pos_ne, pos_ne, square(params.ALT_M_NSE)),
        )
        state = State(params, quat, vel_vars, pos_vars, self._release.forgets_frozen)
        self._set_earth_rate(state, self.inputs.home_lat)
        self.state = state
        output = OutputPredictor(state, sizes.imu)
        self.output = output
        aiding = Aiding(now_ms)
        self.aiding = aiding
        self._sampler.restart()
        self.stillness.reset()
        self._gyro_bias_rate: Vec3 = ZERO
        self._accel_bias_rate: Vec3 = ZERO
        self._inactive = InactiveBiases(self.imu)
        self.ranges.reset(now_ms)
        self.flow_reading.reset(now_ms)
        gps.reset()
        # In the firmware always 0, which after half of 2^32 ms is in the future.
        long_ago_ms = max(0, now_ms - _LONG_AGO_MS)
        self._steps = [Inertial(ZERO, ZERO, 0.0, 0.0, long_ago_ms) for _ in range(sizes.imu)]
        for step in self._steps:
            step.gyro = step.accel = self.imu
        ext_nav.reset()
        ext_nav.horizon_ms = long_ago_ms & U32
        self.resets = Resets(params, state, output, aiding, sources, ext_nav, gps)
        terrain = Terrain(params, state, aiding, gps, self.ranges, now_ms)
        self.height = HeightSource(
            params, state, aiding, sources, ext_nav, gps, self._origin_height, terrain, sizes.slow
        )
        self.vel_pos = VelPosFusion(
            params, state, aiding, sources, ext_nav, gps, events, self.resets, self.height, self._release
        )
        self.flow = FlowFusion(params, state, aiding, sources, events, self.flow_reading, terrain)
        compass = CompassReader(state, events, self.inputs, sizes.slow, now_ms, self._release.keeps_compass)
        by_gps = GpsYaw(params, state, aiding, sources, gps, self._release.gsf_asks_load, self.number)
        self.yaw = YawFusion(
            params,
            state,
            output,
            aiding,
            sources,
            ext_nav,
            gps,
            events,
            self.resets,
            self.vel_pos,
            compass,
            by_gps,
            self._release.learns_field_on_ground,
        )
        self.odometry = BodyOdometry(state, aiding, sources, ext_nav, events)
        self.vehicle = Vehicle()
        self.tilt_aligned = False
        self.flags = 0
        self._initialised_ms = -1
        self._baro_ms = now_ms
        self._had_flags_ms = 0
        self._has_begun = False
        self._fusion_waits = False
        self._tests_stillness = False
        self._no_yaw_on_ground = False
        self._learns_biases = False
        self._last_pass_ms = 0
        self._down_on_ground = 0.0
        self._range_on_ground = 0.0
        self._armed_ms = 0
        self._origin_moved_ms = 0

    def _set_earth_rate(self, state: State, latitude_e7: int) -> None:
        latitude = math.radians(1e-7 * latitude_e7)
        state.earth_rate_ned = EARTH_RATE * math.cos(latitude), 0.0, -EARTH_RATE * math.sin(latitude)

    # Every pass

    def run(self, imus: Imus, now_ms: int, flying_ms: int, is_late: bool) -> None:
        """Run a pass of the main loop.

        The filter's own times, in ms, do not wrap; stamps of samples and the horizon do, at 2^32.

        Args:
            imus: what they say in this pass.
            now_ms: since boot.
            flying_ms: for how long the vehicle has been flying, 0 on the ground.
            is_late: there is no time left for a step.
        """
        self._now_ms = now_ms
        self._take(imus.inertial_of(self.imu))
        self.stepped = False
        if self.initialised:
            self._update(imus, now_ms, flying_ms, is_late)
        else:
            self.stillness.sense(self.delta)
            self._sampler.add(self.delta, now_ms, False)
            self._bootstrap(now_ms)
        if self.initialised:
            self._note_records(now_ms)

    def _take(self, delta: Inertial) -> None:
        """Take the inertial data of a pass; those that are unsound give way to the last that were not."""
        self.has_delta = True
        if delta.is_sound():
            self.delta = delta.at_least(MIN_DT)
        else:
            self.refused += 1

    def _update(self, imus: Imus, now_ms: int, flying_ms: int, is_late: bool) -> None:
        self.yaw.compass.select(now_ms)
        self._control(now_ms, flying_ms)
        delta, sampler = self.delta, self._sampler
        if self._has_begun:
            # The firmware reads the pass's data once to see that its buffer is full, and once more to run.
            self._has_begun = False
            if self._tests_stillness:
                self._test_stillness()
            sampler.add(delta, now_ms, True)
        if imus.are_several():
            self._inactive.update(imus, self.imu, self.state, sampler.dt_ekf_avg)
        self.stillness.sense(delta)
        if self._tests_stillness:
            self._test_stillness()
        else:
            self.stillness.skip()
        step = sampler.add(delta, now_ms, not is_late or self._passes_of_step >= _MOST_PASSES_OF_STEP)
        if step is None:
            state = self.state
            self.output.integrate(delta, state.gyro_bias, state.accel_bias, sampler.dt_ekf_avg, self._params.HRT_FILT)
            self._passes_of_step += 1
        else:
            self.stepped = True
            self._passes_of_step = 0
            step.gyro, step.accel = self._inactive.gyro, self._inactive.accel
            self._steps.pop(0)
            self._steps.append(step)
            self._step(now_ms)
        if self.flags:
            self._had_flags_ms = now_ms
        elif self._had_flags_ms and now_ms - self._had_flags_ms > _FORCED_RESET_MS and not self.inputs.armed:
            # Nothing has been right for a while, on the ground.
            self.events.say(ev.FORCED_RESET)
            sampler.add(delta, now_ms, False)  # the firmware reads the pass's data once more
            self._initialise(now_ms)

    def _test_stillness(self) -> None:
        self.stillness.test(
            self._gyro_bias_rate, self._accel_bias_rate, self._sampler.dt_ekf_avg, self._params.OGNM_TEST_SF
        )

    def _note_records(self, now_ms: int) -> None:
        """Find out what is to be logged: stillness as it changes or after 200 ms, tilt in a step after 500 ms."""
        stillness = self.stillness
        self.logs_stillness = False
        if not stillness.is_tested:
            self._was_still = False
        elif (
            stillness.is_still != self._was_still
            or since_ms(now_ms, self._stillness_logged_ms) > _STILLNESS_INTERVAL_MS
        ):
            self.logs_stillness = True
            self._was_still, self._stillness_logged_ms = stillness.is_still, now_ms
        self.logs_tilt = self.stepped and since_ms(now_ms, self._tilt_logged_ms) > _TILT_INTERVAL_MS
        if self.logs_tilt:
            self._tilt_logged_ms = now_ms

    # Flight, alignment, aiding (AP_NavEKF3/AP_NavEKF3_Control.cpp, controlFilterModes, setAidingMode)

    def _control(self, now_ms: int, flying_ms: int) -> None:
        """Find out what the vehicle is about, and choose how to navigate."""
        inputs, aiding, yaw = self.inputs, self.aiding, self.yaw
        if self._initialised_ms < 0:
            self._initialised_ms = now_ms
            self._last_pass_ms = now_ms
        # The pass's inertial data are read after this, so that the time is still that of the last.
        last_ms, dt_ekf_avg = self._last_pass_ms, self._sampler.dt_ekf_avg
        if self.tilt_aligned and not self._learns_biases:
            # FIRMWARE PARITY: a pass late. Until then their variances are 0, so that they count as known.
            self._learns_biases = True
            self.state.learn_biases(dt_ekf_avg)
        if not self.tilt_aligned and self.state.predicted_tilt_var < _TILT_ALIGNED_VAR:
            self.tilt_aligned = True
            self.events.say(ev.TILT_ALIGNED)
        self._detect_flight(last_ms, flying_ms, dt_ekf_avg)
        yaw.control(self.vehicle)
        self._no_yaw_on_ground = yaw.source == NONE and not inputs.armed
        by_compass = yaw.source == COMPASS and yaw.uses_compass
        self._tests_stillness = self.vehicle.on_ground and (self._fuses_rest or not by_compass)
        no_yaw = self._no_yaw_on_ground and not (aiding.mode == RELATIVE and self._release.relative_needs_no_yaw)
        if no_yaw and aiding.mode != NO_AIDING:
            self._forget_flight(last_ms)
        ready = Ready(False, False, False, False)
        if aiding.mode != ABSOLUTE or no_yaw:
            ready = self._ready(last_ms, dt_ekf_avg)
        if aiding.update(last_ms, ready, no_yaw):
            self._enter_mode(last_ms, ready)
        if aiding.position_is_lost:
            self.gps.is_in_use = False
        self._last_pass_ms = now_ms

    def _forget_flight(self, now_ms: int) -> None:
        """Restart with what was known by a yaw that the vehicle has lost as it was disarmed."""
        aiding = self.aiding
        mode, aiding.mode = aiding.mode, NO_AIDING
        self.yaw.aligned = False
        self.yaw.by_gps.forget_course()
        self.resets.velocity(now_ms, False, False)
        self.resets.position(now_ms, False)
        self.vel_pos.reset_height(now_ms, self.vehicle)
        self.state.cov.forget_correlations()
        aiding.mode = mode

    def _detect_flight(self, now_ms: int, flying_ms: int, dt_ekf_avg: float) -> None:
        inputs, vehicle = self.inputs, self.vehicle
        if not inputs.armed:
            self._down_on_ground, self._range_on_ground = self.state.pos[2], self.ranges.newest
        elif not vehicle.armed:
            self._armed_ms = now_ms
        vehicle.in_flight = inputs.armed and (
            vehicle.in_flight
            or self._climbed_m() > _IN_FLIGHT_CLIMB_M
            or self.ranges.newest - self._range_on_ground > _IN_FLIGHT_RANGE_M
            or flying_ms > _FLYING_MS
        )
        vehicle.armed = inputs.armed
        vehicle.on_ground = not inputs.armed
        vehicle.near_ground = inputs.takeoff_expected or inputs.touchdown_expected
        vehicle.tilt_aligned = self.tilt_aligned
        self.yaw.by_gps.follow_flight(vehicle, inputs.takeoff_expected, dt_ekf_avg)

    def _climbed_m(self) -> float:
        """Return the height above where the vehicle was disarmed."""
        return self._down_on_ground - self.state.pos[2]

    def _ready(self, now_ms: int, dt_ekf_avg: float) -> Ready:
        """Return which measurements could start aiding."""
        if not self.tilt_aligned:
            return Ready(False, False, False, False)
        source = self.sources.pos_xy()
        knows_bias = self._knows_gyro_bias(dt_ekf_avg)
        gps = self.gps.checks.good and self.gps.is_due and self.origin is not None and self.yaw.aligned
        return Ready(
            source == GPS and gps and knows_bias,
            source == EXTNAV and self.ext_nav.has_pose,
            knows_bias and self._odometry_is_good(now_ms),
            knows_bias and self._flow_is_fresh(now_ms),
        )

    def _knows_gyro_bias(self, dt_ekf_avg: float) -> bool:
        """Return whether the gyro's bias is known, but for yaw where nothing measures that (checkGyroCalStatus)."""
        cov, yaw, limit = self.state.cov, self.yaw, square(_GYRO_BIAS_LEARNED * dt_ekf_avg)
        variances = cov.var(GYRO), cov.var(GYRO + 1), cov.var(GYRO + 2)
        by_others = yaw.source == GPS_YAW or yaw.source == GPS_COMPASS_FALLBACK or yaw.source == EXTNAV
        if yaw.uses_compass or by_others:
            return larger(larger(variances[0], variances[1]), variances[2]) <= limit
        x, y, _ = to_body(self.state.rotation, variances)
        return abs(x) < limit and abs(y) < limit

    def _flow_is_fresh(self, now_ms: int) -> bool:
        received_ms = self.flow_reading.received_ms
        return received_ms >= 0 and now_ms - received_ms < _FLOW_FRESH_MS and self.flow.is_used()

    def _odometry_is_good(self, now_ms: int) -> bool:
        ext_nav = self.ext_nav
        fresh = ext_nav.have_odometry and since_ms(now_ms, ext_nav.odometry_ms) < _ODOMETRY_FRESH_MS
        return fresh and ext_nav.odometry_err < _MAX_ODOMETRY_ERR and self.sources.uses_vel_xy(EXTNAV)

    def _enter_mode(self, now_ms: int, ready: Ready) -> None:
        aiding, events, state = self.aiding, self.events, self.state
        by_velocity, by_gps = False, False
        if aiding.mode == NO_AIDING:
            events.say(ev.STOPPED_AIDING)
            self.vel_pos.vel_ratio = 0.0
            self.vel_pos.pos_ratio = 0.0
            self.resets.last_known_ne = state.pos[0], state.pos[1]
            state.set_pos((state.pos[0], state.pos[1], -self.height.baro_height))
            self.resets.last_known_down = state.pos[2]
            self.odometry.is_fused = False
            self.flow.is_fused = False
        elif aiding.mode == RELATIVE:
            events.say(ev.STARTED_RELATIVE)
            if ready.flow:
                self.flow_reading.valid_ms = now_ms
        elif ready.gps:
            by_gps = True
            events.say(ev.USING_GPS)
        else:
            by_velocity = self.ext_nav.have_velocity
            self._start_by_ext_nav(now_ms)
        vel_timeout = aiding.vel_timeout
        self.resets.velocity(now_ms, by_velocity, by_gps)
        self.resets.position(now_ms, by_gps)
        aiding.vel_timeout = vel_timeout

    def _start_by_ext_nav(self, now_ms: int) -> None:
        pose, velocity = self.ext_nav.pose, self.ext_nav.velocity
        if pose is None:
            return
        self.events.say(ev.USING_EXT_NAV)
        self.events.say(ev.INITIAL_POS, pose.pos)
        if self.ext_nav.have_velocity:
            self.events.say(ev.INITIAL_VEL, ZERO if velocity is None else velocity.vel)
        if self.sources.pos_z() == EXTNAV or not self._release.resets_height_by_its_source:
            self.height.use_pose()
            self.vel_pos.reset_height(now_ms, self.vehicle)

    # Every step

    def _step(self, now_ms: int) -> None:
        """Make a step of the filter, and draw the output towards what comes of it."""
        dt_ekf_avg, state, ext_nav = self._sampler.dt_ekf_avg, self.state, self.ext_nav
        measured = self._steps[0].at_least(_MIN_STEP * dt_ekf_avg)
        step = self._inactive.corrected(measured, state, dt_ekf_avg)
        gyro_bias, accel_bias = state.gyro_bias, state.accel_bias
        ext_nav.horizon_ms = step.time_ms & U32
        self._predict(step, measured, dt_ekf_avg)
        self._read_sensors(now_ms)
        self._fuse(now_ms, step)
        self._update_flags(now_ms)
        self._gyro_bias_rate = scaled(state.gyro_bias, 1.0 / dt_ekf_avg)
        self._accel_bias_rate = scaled(state.accel_bias, 1.0 / dt_ekf_avg)
        delay_s = 1e-3 * since_ms(now_ms, ext_nav.horizon_ms)
        tau_s = limited(0.01 * self._params.TAU_OUTPUT, 0.1, 0.5)
        self.output.integrate(self.delta, gyro_bias, accel_bias, dt_ekf_avg, self._params.HRT_FILT)
        self.output.follow(state, delay_s, tau_s, dt_ekf_avg)

    def _predict(self, step: Inertial, measured: Inertial, dt_ekf_avg: float) -> None:
        state = self.state
        self.yaw.begin_step()
        if self.flow_reading.received_ms >= 0:
            self.flow_reading.note_turn(state.turn_of(step, dt_ekf_avg), step.del_ang_dt)
        is_moved = self._fuses_rest and not self.stillness.is_still
        state.predict(step, measured, dt_ekf_avg, self.aiding.mode != NO_AIDING, self.vehicle.on_ground, is_moved)
        self.gps.note_motion(state.rotation, step)
        self.height.terrain.constrain()
        self.yaw.by_gps.predict(step)

    def _read_sensors(self, now_ms: int) -> None:
        inputs, field = self.inputs, self.yaw.field
        if inputs.baro_ms >= 0 and since_ms(inputs.baro_ms, self._baro_ms) > SENSOR_INTERVAL_MIN_MS:
            self._baro_ms = inputs.baro_ms
            time_ms = (self._baro_ms - int(self._params.HGT_DELAY) - HALF_FILTER_STEP_MS) & U32
            self.height.baro.push(BaroSample(later_ms(time_ms, self.ext_nav.horizon_ms), inputs.baro_height))
        field.compass_declination = inputs.declination if self.yaw.uses_compass else 0.0

    def _fuse(self, now_ms: int, step: Inertial) -> None:
        """Fuse what came due."""
        inputs, ext_nav, vehicle, horizon_ms = self.inputs, self.ext_nav, self.vehicle, self.ext_nav.horizon_ms
        is_still = self.stillness.is_still
        self.yaw.step(now_ms, vehicle, step, is_still, self._climbed_m())
        # Three axes of a compass take so long that the firmware leaves the rest to the next step, once.
        self._fusion_waits = self.yaw.field_was_fused and not self._fusion_waits
        if not self._fusion_waits:
            ext_nav.recall(self.state.rotation, step, inputs.lever_arm, self._away_from_common())
            if inputs.gps is not None:
                self._read_gps(now_ms)
            self.gps.recall(horizon_ms)
            if inputs.ranges is not None:
                self.ranges.read(inputs.ranges, now_ms, vehicle.on_ground)
            self.ranges.recall(horizon_ms, self.state.rotation)
            self.vel_pos.step(now_ms, vehicle, self._fuses_rest and (is_still or inputs.takeoff_expected))
            self.flow.step(now_ms, horizon_ms, self.height.active == RANGEFINDER)
            self.odometry.step(now_ms, step)
        self.yaw.correct_by_gps(now_ms, vehicle)

    def _read_gps(self, now_ms: int) -> None:
        sample, vel_pos, gps = self.inputs.gps, self.vel_pos, self.gps
        if sample is None:
            return
        around = GpsSurroundings()
        around.on_ground = self.vehicle.on_ground
        around.mag_x, around.mag_y, _ = self.yaw.field.ratios
        around.yaw = self.yaw.ratio
        ratios = vel_pos.vel_ratio, vel_pos.pos_ratio
        absolute = self.aiding.mode == ABSOLUTE
        if not gps.read(sample, now_ms, absolute, self.sources.uses_vel_z(GPS), ratios, around):
            return
        self.yaw.check_compass(now_ms, self.vehicle)
        if gps.checks.good and self.origin is None:
            self._set_origin_by_gps(sample.location)
        if gps.checks.good and not self.yaw.field.has_table and self._may_use_table():
            self.yaw.field.use_table(sample.location)
        if self.origin is not None:
            height = self._origin_height
            reference_m = CENTI * height.alt_cm if self._corrects_measurements() else height.reference_m
            gps.push(sample, self.origin, reference_m, self.ext_nav.horizon_ms, now_ms)

    def _set_origin_by_gps(self, place: Location) -> None:
        """Put the origin where the vehicle is, in flight at the height from which it has climbed."""
        climbed_cm = int(100.0 * self.state.pos[2]) if self.vehicle.in_flight else 0
        self.set_origin(Location(place.lat, place.lng, place.alt_cm + climbed_cm))
        self.yaw.field.align_declination()
        self._origin_height.reference_m = CENTI * place.alt_cm + self.output.now.pos[2]
        self._origin_height.variance = square(self.gps.height_accuracy)

    def _corrects_measurements(self) -> bool:
        return int(self._params.OGN_HGT_MASK) & IN_MEASUREMENTS != 0

    # What it says of itself (AP_NavEKF3/AP_NavEKF3_Control.cpp, updateFilterStatus)

    def healthy(self, now_ms: int) -> bool:
        """Return whether nothing is wrong (NavEKF3_core::healthy)."""
        vel_pos = self.vel_pos
        if self._initialised_ms < 0 or now_ms - self._initialised_ms < _HEALTHY_AFTER_MS:
            return False
        if smaller(smaller(vel_pos.vel_ratio, vel_pos.pos_ratio), vel_pos.height_ratio) > 1:
            return False
        if self.aiding.mode != NO_AIDING or not self.vehicle.on_ground:
            return True
        horizontal = length2(vel_pos.pos_innovation[0], vel_pos.pos_innovation[1])
        return not larger(horizontal, abs(vel_pos.still_height)) > _MAX_STILL_INNOVATION_M

    def _update_flags(self, now_ms: int) -> None:
        """Work out the status flags, those of EKF_STATUS_REPORT and beyond."""
        aiding, inputs, flow = self.aiding, self.inputs, self.flow
        healthy, absolute = self.healthy(now_ms), aiding.mode == ABSOLUTE
        state = FilterState()
        state.healthy = healthy
        state.tilt_aligned = self.tilt_aligned
        state.yaw_aligned = self.yaw.aligned
        state.uses_compass = self.yaw.uses_compass
        state.mode = aiding.mode
        state.pos_timeout = aiding.pos_timeout
        state.vel_timeout = aiding.vel_timeout
        state.height_timeout = self.height.is_lost
        state.has_vertical_velocity = self.ext_nav.have_velocity or self.gps.tells_climb
        state.odometry_in_use = now_ms - aiding.odometry_ms < _ODOMETRY_IN_USE_MS
        state.flow_is_valid = flow.is_valid
        state.ground_is_valid = flow.ground_is_valid
        state.height_needs_origin = self.origin is None and self.sources.pos_z() == GPS
        flags = filter_flags(state)
        self.height.velocity_is_valid = flags & _HORIZ_VEL != 0
        is_using_position = absolute and now_ms - aiding.pos_ms < _USING_POSITION_MS
        if flow.takeoff_detected:
            flags |= _TAKEOFF_DETECTED
        if inputs.takeoff_expected:
            flags |= _TAKEOFF
        if inputs.touchdown_expected:
            flags |= _TOUCHDOWN
        if is_using_position:
            flags |= _USING_POSITION
        if absolute and self.sources.pos_xy() == GPS and not self.gps.accuracy_good:
            flags |= _GLITCHING
        if self.gps.checks.good:
            flags |= _QUALITY_GOOD
        if healthy:
            flags |= _INITIALISED
        self.flags = flags
        if now_ms - self._origin_moved_ms >= _ORIGIN_MOVES_MS:
            self._origin_moved_ms = now_ms
            if self.origin is not None and is_using_position:
                self.height.terrain.move_origin()
                if self.yaw.field.has_table:
                    north, east, _ = self.state.pos
                    self.yaw.field.look_up(self.origin.offset(Vector3f(north, east, 0.0)))

    def timeouts(self, now_ms: int) -> int:
        """Return the bits of XKF4.TS; airspeed and drag are always lost, the latter 5 s after boot."""
        lost = 1 << 4
        if self.aiding.pos_timeout:
            lost |= 1 << 0
        if self.aiding.vel_timeout:
            lost |= 1 << 1
        if self.height.is_lost:
            lost |= 1 << 2
        if self.yaw.compass.is_lost:
            lost |= 1 << 3
        if now_ms > _NO_DRAG_MS:
            lost |= 1 << 5
        return lost

    @property
    def dt_ekf_avg(self) -> float:
        """The average interval of the steps, s."""
        return self._sampler.dt_ekf_avg

    @property
    def yaw_resets(self) -> int:
        """How often yaw has been set since the filter began."""
        return self.yaw.resets if self.initialised else 0

    @property
    def is_aligned(self) -> bool:
        """Whether tilt and yaw are aligned; they are not before there is a state."""
        return self.initialised and self.tilt_aligned and self.yaw.aligned

    def uses_ext_nav_for_yaw(self, now_ms: int) -> bool:
        """Return whether yaw comes from external navigation, or is assumed while it waits for that."""
        if self.initialised:
            return self.yaw.uses_ext_nav(now_ms)
        return self.sources.yaw() == EXTNAV and now_ms < YAW_IN_USE_MS

    def error_score(self) -> float:
        """Return how far the innovations are off, 1 at their gates; 0 until tilt and yaw are aligned (errorScore)."""
        if not self.is_aligned:
            return 0.0
        vel_pos = self.vel_pos
        score = larger(0.5 * (vel_pos.vel_ratio + vel_pos.pos_ratio), vel_pos.height_ratio)
        if int(self._params.AFFINITY) & AFFINITY_MAG:
            x, y, z = self.yaw.field.ratios
            score = larger(score, _COMPASS_SHARE * (x + y + z))
        return score

    # What is handed in between passes

    def write_flow(self, quality: int, flow: Vec2, gyro: Vec2, offset: Vec3) -> None:
        """Take what a flow sensor has measured (writeOptFlowMeas); see ``FlowReading.write``."""
        if not self.initialised or not self.has_delta:
            return
        delay_ms = int(self._params.FLOW_DELAY)
        horizon_ms = self.ext_nav.horizon_ms
        if self.flow_reading.write(quality, flow, gyro, offset, self.delta, self._now_ms, horizon_ms, delay_ms):
            self._detect_takeoff()

    def _detect_takeoff(self) -> None:
        """Find out by filtered body rates as flow comes in whether the vehicle flies (detectOptFlowTakeoff)."""
        flow = self.flow
        if self.vehicle.on_ground:
            flow.takeoff_detected = False
        elif not flow.takeoff_detected and self._last_pass_ms - self._armed_ms > _TAKEOFF_AFTER_MS:
            bias = scaled(self.state.gyro_bias, 1.0 / self._sampler.dt_ekf_avg)
            has_climbed = self.ranges.newest > self._range_on_ground + _TAKEOFF_RANGE_M
            flow.takeoff_detected = length(sub(self.stillness.gyro, bias)) > _TAKEOFF_RATE or has_climbed

    def set_terrain_stable(self, is_stable: bool) -> None:
        """Set whether heights may count from the ground (setTerrainHgtStable)."""
        if self.initialised:
            self.height.terrain_is_stable = is_stable

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once; say whether it was set (setOrigin)."""
        if self.origin is not None or (self._release.refuses_early_origin and not self.initialised):
            return False
        self.origin = origin
        if self._common.place is None:
            self._common.place = origin
        self._origin_height.put(origin.alt_cm)
        if self.initialised:
            self._set_earth_rate(self.state, origin.lat)
            self.yaw.field.align_declination()
            if self._may_use_table():
                self.yaw.field.use_table(origin)
        self.events.say(ev.ORIGIN_SET)
        return True

    def _may_use_table(self) -> bool:
        """Return whether the earth's field may come from the table: of a compass with a scale (COMPASS_AUTODEC)."""
        compass = self.yaw.compass
        compasses, number = self.inputs.compasses, compass.number
        has_scale = number < len(compasses.readings) and compasses.readings[number].has_scale
        return has_scale and compasses.finds_declination

    def set_place(self, place: Location, accuracy_m: float, time_ms: int) -> bool:
        """Put the vehicle somewhere while it navigates without a position; say whether it was (setLatLng).

        Args:
            place: its height counts for nothing.
            accuracy_m: NaN when unknown.
            time_ms: when it was there, since boot; up to 5 s ago.
        """
        if not self.initialised:
            return False
        origin, state = self.origin, self.state
        age_ms = self._now_ms - self.aiding.pos_ms
        if origin is None or self.aiding.mode == NO_AIDING or age_ms < _DEAD_RECKONING_MS:
            return False
        age_of_place_ms = min(max(signed_since_ms(self._now_ms, time_ms), 0), _MAX_PLACE_AGE_MS)
        ahead_s = 1e-3 * (age_of_place_ms - since_ms(self._now_ms, self.ext_nav.horizon_ms))
        north, east, _ = distance_ned(origin, place)
        noise = self._params.POSNE_M_NSE
        accuracy = noise if math.isnan(accuracy_m) else larger(accuracy_m, noise)
        state.clear(POS, POS + 2, square(accuracy))
        self.resets.shift_to((north + ahead_s * state.vel[0], east + ahead_s * state.vel[1], 0.0), False)
        return True

    def reset_height_datum(self) -> bool:
        """Count heights from the present one, on the ground; the barometer does so too (resetHeightDatum).

        The origin takes up the difference, so that the height above the sea stays what it was; it is the GPS's where
        that is good.
        """
        if not self.initialised or not self.vehicle.on_ground or self.height.active == RANGEFINDER:
            return False
        state, fix = self.state, self.inputs.gps
        if self.origin is not None:
            above_cm = self._origin_height.alt_cm + int(-100.0 * state.pos[2])
            is_by_gps = fix is not None and self.gps.checks.good
            self._origin_height.put(fix.location.alt_cm if fix is not None and is_by_gps else above_cm)
        state.set_pos((state.pos[0], state.pos[1], 0.0))
        self.height.terrain.down = 0.0
        return True

    def request_yaw_reset(self) -> None:
        """Ask for yaw to be reset by the velocity of GPS, within 5 s (EKFGSF_requestYawReset)."""
        if self.initialised:
            self.yaw.by_gps.request(self._now_ms)

    # Positions

    def _away_from_common(self) -> Vec2:
        """Return where the common origin is, m north and east from the core's own.

        FIRMWARE PARITY: as long as the core has no origin of its own, that is where 0 N, 0 E is.
        """
        common = self._common.place
        if common is None or common is self.origin:
            return 0.0, 0.0
        return (self.origin or Location(0, 0, 0)).distance_ne(common)

    def origin_alt_cm(self) -> int:
        """Return the height of the origin above mean sea level as it is told, 0 without one (getOriginLLH).

        It has been through metres and single precision, and may so have lost a centimetre.
        """
        common = self._common.place
        if self.origin is None or common is None:
            return 0
        if self._corrects_measurements():
            return common.alt_cm
        return int(single(100.0 * single(self._origin_height.reference_m)))

    def last_place(self) -> Location | None:
        """Return the place that is told though nothing vouches for it; None without an origin (getLLH)."""
        if self.origin is None:
            return None
        if self.aiding.mode == NO_AIDING:
            (north, east), down = self.resets.last_known_ne, self.resets.last_known_down
        else:
            north, east, down = self.output.now.pos
        return self.origin.offset(Vector3f(north, east, down))

    def position(self) -> Vec3:
        """Return the present position, metres NED from the common origin as it was set (getPosNE, getPosD).

        Without aiding it is the GPS's, if that has a fix, else the last one known; nothing without an origin.
        """
        north, east, down = self.output.now.pos
        common, is_unknown, fix = self._common.place, self.aiding.mode == NO_AIDING, self.inputs.gps
        if common is not None and self.origin is not None:
            down += CENTI * (common.alt_cm - self.origin_alt_cm())
        if is_unknown and self.origin is None:
            return 0.0, 0.0, down
        if is_unknown and common is not None and fix is not None and fix.fix_type >= _FIX_2D:
            north, east, _ = distance_ned(common, fix.location)
        elif not is_unknown:
            away_north, away_east = self._away_from_common()
            north, east = north - away_north, east - away_east
        return north, east, down
