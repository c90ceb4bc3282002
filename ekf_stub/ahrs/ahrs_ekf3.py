# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The AHRS of a vehicle that estimates its state by EKF3 (AP_AHRS/AP_AHRS.cpp).

All answers are those of the primary core, unless AHRS_EKF_TYPE chooses another estimator.

FIRMWARE PARITY: before the filter runs, the attitude is level with the sensors' true heading, where the firmware has
its simple estimate (DCM). Later that is the filter's attitude with the true heading.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from ap_core.cint import u32
from ap_core.clock import VirtualClock, count_before
from ap_core.fmath import f32, ieee754
from ap_core.location import Location
from ap_core.param import FromParams, ParamTable
from ap_core.quaternion import Quaternion
from ap_core.sinks import RecordSink, TextSink
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.ahrs.cores import Cores
from ekf_stub.ahrs.estimator import SIM_STATUS, Estimator, assumed_at_boot, configured
from ekf_stub.ahrs.sources import BARO, COMPASS, GPS, OPTICAL_FLOW, VISUAL_ODOM, SourceYaw, source_failure
from ekf_stub.ahrs.sources import RANGEFINDER as RANGEFINDER_SENSOR
from ekf_stub.ahrs.vehicle_state import compass_in_use, has_flow, imu_mask, imu_pos
from ekf_stub.core.aiding import ABSOLUTE, NO_AIDING, RELATIVE
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.core import Core
from ekf_stub.core.events import YAW, Events
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.params import OPTFLOW, RANGEFINDER, EkfSources
from ekf_stub.core.vectors import Quat, euler_of
from ekf_stub.inputs.ingest_rules import KINDS, RULES, FilterOutcome
from ekf_stub.inputs.measurements import (
    DOWNWARD,
    FIX_3D,
    MAX_GPS,
    AllGps,
    Array,
    BaroReading,
    FlowMeasurement,
    PlaceCache,
    RangeState,
    first_healthy,
    from_imu,
    gps_counted_from,
    numbers_of,
)
from ekf_stub.inputs.sensors import Sensors, SensorSource
from ekf_stub.log.replay_log import (
    CHECK_LANE_SWITCH,
    REQUEST_YAW_RESET,
    RESET_HEIGHT_DATUM,
    SOURCE_SET_1,
    TERRAIN_STABLE,
    TERRAIN_UNSTABLE,
    ReplayLog,
    VehicleFrame,
)
from ekf_stub.release import STABLE_4_7, FilterRelease
from ekf_stub.reports import (
    MAV_SEVERITY_INFO,
    NO_ESTIMATOR,
    NO_LIMITS,
    NUMBER_OF_IMUS,
    AidingMode,
    ControlLimits,
    CoreReport,
    FilterFlag,
    FilterStatus,
    Three,
    cores_of_mask,
)

_MODES: Final = {NO_AIDING: AidingMode.NONE, ABSOLUTE: AidingMode.ABSOLUTE, RELATIVE: AidingMode.RELATIVE}
_FIRST_IMU: Final = 0
_OLD_EXTERNAL_YAW: Final = (5, 6)  # of EK3_MAG_CAL
_HORIZ_POS: Final = FilterFlag.HORIZ_POS_ABS | FilterFlag.HORIZ_POS_REL
_REPORTED: Final = (1 << 10) - 1  # flags that EKF_STATUS_REPORT has as they are
_GLITCHING, _INITIALISED = 1 << 14, 1 << 16  # of nav_filter_status
_FLOW_RELIED_ON_MS: Final = 10_000
_ODOMETRY_GONE_MS: Final = 1_000
_TURNING_RAD_S: Final = 1.0
"""So much of the rates that flow may have is left to the vehicle's turning."""
_FULL_GAIN_M: Final = 4.0
_SHARE_OF_RANGE: Final = 0.7
_RANGE_MARGIN_M: Final = 1.0
_LEAST_LIMIT_M: Final = 1.0


def _floats(place: Vector3f) -> Three:
    x, y, z = map(float, place.to_tuple())
    return x, y, z


def baros_of(sensors: Sensors) -> Sequence[BaroReading]:
    """Return the readings of all barometers that differ, or that of all; none before any."""
    return sensors.baros or ([] if sensors.baro is None else [BaroReading(*sensors.baro)])


@ieee754
def yaw_of(quat: Quaternion) -> float:
    """Return the yaw of an attitude in rad, in single precision; NaN if anything in it is NaN."""
    return math.nan if quat.is_nan() else float(quat.get_euler_yaw())


def passes_through(times_us: range, time_us: int) -> range:
    """Return the passes up to and with the first one at or after a time."""
    return times_us[: count_before(times_us, time_us) + 1]


class Ekf3Ahrs(AhrsBase):
    """The AHRS with the cores in it.

    Args:
        source: where inertial data and other measurements come from.
        clock: time since boot, which an AHRS that runs several passes moves on from one to the next.
        sources: the EKF's source sets.
        replay_log: where inputs are logged.
        logger: where estimates are logged.
        params: all parameters.
        texts: where texts for ground stations go.
        release: which EKF3 it is.
        start_us: when the AHRS starts.
        buffer_ms: a delay for which the filter's buffers are long enough in any case.

    Attributes:
        cores: the cores, once they have been set up; None also when none is wanted.
        core: the filter of the primary one.
        on_filter_outcome: called with the outcome of each sample of external navigation in the primary core: when it
            comes and, if it was taken, when it leaves the buffer.
    """

    _log: ReplayLog

    def __init__(
        self,
        source: SensorSource,
        clock: VirtualClock,
        sources: EkfSources,
        replay_log: ReplayLog,
        logger: RecordSink,
        params: ParamTable,
        texts: TextSink,
        release: FilterRelease = STABLE_4_7,
        *,
        start_us: int = AHRS_START_US,
        buffer_ms: int = 0,
    ) -> None:
        super().__init__(clock, sources, replay_log, start_us=start_us)
        self.source = source
        self._logger = logger
        self._params = params
        self._texts = texts
        self._release = release
        self._has_compass = compass_in_use(params)
        self._place_of_imu = FromParams(params, lambda: imu_pos(params))
        self._buffer_ms = buffer_ms
        self._camera_pos: Vector3f | None = None
        self._imu_pos: Vector3f | None = None
        self._lever = (0.0, 0.0, 0.0)
        self._has_flow = FromParams(params, lambda: has_flow(params))
        self._imu_frd = FromParams(params, lambda: _floats(imu_pos(params)))
        self._gps_from_imu = [PlaceCache(gps_counted_from) for _ in range(MAX_GPS)]
        self._ranges_from_imu = PlaceCache(RangeState.counted_from)
        self._terrain_is_stable: bool | None = None
        self._sensors: Sensors | None = None
        self._measured: list[float] = []  # by the first IMU, and further ones, in the last pass
        self._gps_lag_s = 0.0
        self._baro_zeros_m: tuple[float, ...] = ()
        self._is_set_up = self._active = self._has_camera = self._is_stopped = False
        self._configured = FromParams(params, lambda: configured(params.get_int("AHRS_EKF_TYPE")))
        self._estimator = assumed_at_boot(params.get_int("AHRS_EKF_TYPE"))
        self._truth: tuple[Three, Three, Quat] | None = None
        self._source_set = sources.active_set
        self._quat: Quaternion | None = None
        self._reset_ms = 0
        self.cores: Cores | None = None
        self.core: Core | None = None
        self._refusals = Events(0, [])
        self._refusing = ExtNav(self._refusals, None, False)
        self.on_filter_outcome: Callable[[FilterOutcome], None] | None = None

    # Passes

    def stop(self) -> None:
        """Stop the filter: it keeps its last estimate, and gets no more samples."""
        self._is_stopped = True
        self.on_filter_outcome = None

    @property
    def runs_ahead(self) -> bool:
        """Whether several passes may be run at once: the filter runs and no frame is logged, or it was stopped."""
        is_logged = self._log.is_wanted or self._sources.active_set != self._source_set
        by_filter = self._active and self._configured() is Estimator.EKF3
        return self._is_stopped or (by_filter and not is_logged)

    def update(self) -> None:
        """Run one frame of the estimator."""
        if self._is_stopped:
            return
        now_us = self._clock.micros64()
        self.source.set_armed(self.state.armed)
        sensors = self.source.sense(now_us)
        if sensors is not None:
            self._take(sensors)
            if self._is_set_up or self.estimator_started():
                self._run_pass(sensors, now_us)
        self._quat = None

    def advance(self, times_us: range, due_us: Callable[[], int]) -> int:
        """Run the frames of passes, up to one at which other tasks are due, and return how many."""
        if self._is_stopped:
            left = passes_through(times_us, due_us())
            self._clock.set_us(left[-1])
            return len(left)
        cores = self.cores
        if cores is None or not self.runs_ahead:
            self.update()
            return 1
        self.source.set_armed(self.state.armed)
        self._set_inputs(cores, self._gps(), self._range_finders())
        done, next_us = 0, due_us()
        while True:
            done += self._run_ahead(cores, passes_through(times_us[done:], next_us))
            next_us = due_us()
            if done == len(times_us) or next_us <= times_us[done - 1]:
                return done

    def _take(self, sensors: Sensors) -> None:
        self._sensors = sensors
        self._measured = numbers_of(sensors.delta)

    def _run_pass(self, sensors: Sensors, now_us: int) -> None:
        if not self._is_set_up:
            self._set_up(sensors)
        gps, ranges = self._gps(), self._range_finders()
        self._log_frame(sensors, gps, now_us)
        cores, core = self.cores, self.core
        self._choose_estimator(now_us)
        if cores is None or core is None:
            return
        was_initialised = core.initialised
        cores.set_sensors(self._with_zeroed_baro(sensors))
        self._set_inputs(cores, gps, ranges)
        row = [float(now_us), float(self._flying_ms(now_us)), 0.0]
        for delta in [reading.delta for reading in sensors.imus] or [sensors.delta]:
            row += numbers_of(delta)
        cores.lanes.advance(row, 0, 1)
        self._log.note_run(was_initialised=was_initialised)
        self._finish_run(cores, now_us)

    def _choose_estimator(self, now_us: int) -> None:
        """Choose the estimator of this pass; a change is announced."""
        wanted, before = self._configured(), self._estimator
        self._truth = self.source.truth(now_us) if wanted is Estimator.SIM else None
        runs = {
            Estimator.EKF3: self.core is not None and self.core.initialised,
            Estimator.SIM: self._truth is not None,
            Estimator.EXTERNAL: True,
        }
        self._estimator = wanted if runs.get(wanted, False) else Estimator.DCM
        self._active = self._estimator is Estimator.EKF3
        if self._estimator is not before:
            self._texts.send_text(MAV_SEVERITY_INFO, f"AHRS: {self._estimator.title} active")

    def _flying_ms(self, now_us: int) -> int:
        since_us = self.state.flying_since_us
        return 0 if since_us is None else (now_us - since_us) // 1000

    def _set_inputs(self, cores: Cores, gps: AllGps, ranges: RangeState | None) -> None:
        cores.set_vehicle(self.state, self._expected(), lever_arm=self._lever_arm(), gps=gps, ranges=ranges)

    def _expected(self) -> tuple[bool, bool]:
        return self.source.expected() or self.state.expected

    def _all_gps(self) -> AllGps:
        of_source = self.source.gps()
        return self.state.gps if of_source is None else AllGps((of_source,))

    def _run_ahead(self, cores: Cores, times_us: range) -> int:
        """Run frames until one has texts or outcomes, or the sensors have more than inertial data; return how many."""
        ahead = self.source.ahead(times_us)
        if not len(ahead):
            self._clock.set_us(times_us[0])
            self.update()
            return 1
        cores.lanes.tells_outcomes = self.on_filter_outcome is not None
        count = cores.lanes.advance(self._rows(times_us[: len(ahead)], ahead), 0, len(ahead))
        now_us = times_us[count - 1]
        self.source.pass_over(times_us[:count])
        self._measured = ahead[count - 1].tolist()
        self._clock.set_us(now_us)
        self._log.start_frame(now_us, 0)
        self._log.frame(self.state.camera)
        self._log.note_run(was_initialised=True)
        self._finish_run(cores, now_us)
        self._quat = None
        return count

    def _rows(self, times_us: range, inertial: Array) -> list[float]:
        """Return rows for the filter of the inertial data of passes, shape (n, 8) or wider."""
        rows = np.zeros((len(times_us), 3 + inertial.shape[1]))
        rows[:, 0] = times_us
        since_us = self.state.flying_since_us
        if since_us is not None:
            rows[:, 1] = (np.array(times_us) - since_us) // 1000
        rows[:, 3:] = inertial
        numbers: list[float] = rows.reshape(-1).tolist()
        return numbers

    def _finish_run(self, cores: Cores, now_us: int) -> None:
        """Send and log the texts, outcomes and records of the filters after a pass."""
        cores.send_texts()
        self._report_outcomes()
        cores.log_pass(now_us)
        self._follow_primary(cores)
        origin = cores.lanes.origin
        if origin is None:
            self._origin = None
        elif self._origin is None:
            self._note_origin(origin)

    def _report_outcomes(self) -> None:
        """Count and report the outcomes of samples; of several cores those of the primary one."""
        self._report_outcomes_of(self._refusals)
        for core in () if self.cores is None else self.cores.lanes.cores:
            if core is self.core:
                self._report_outcomes_of(core.events)
            else:
                core.events.outcomes.clear()

    def _report_outcomes_of(self, events: Events) -> None:
        if not events.outcomes:
            return
        outcomes, events.outcomes = events.outcomes, []
        for outcome in outcomes:
            kind, rule = KINDS[outcome.kind], RULES[outcome.rule]
            self.ext_nav_counts[kind, rule.code] += 1
            if self.on_filter_outcome is not None:
                is_tested = outcome.ratio >= 0.0
                innovation = math.degrees(outcome.innovation) if outcome.kind == YAW else outcome.innovation
                ratio_and_innovation = (outcome.ratio, innovation) if is_tested else (None, None)
                self.on_filter_outcome(FilterOutcome(kind, rule, outcome.time_ms, *ratio_and_innovation))

    def _follow_primary(self, cores: Cores) -> None:
        """Note which core is primary, and when its yaw jumped."""
        lanes = cores.lanes
        self.core = lanes.primary_filter
        self.yaw_reset_ms = lanes.yaw_reset_ms
        if self._active:
            self.primary = lanes.primary

    def _set_up(self, sensors: Sensors) -> None:
        # NavEKF3_core::setup_core: what later changes of parameters do not change until the next boot.
        self._is_set_up = True
        params = self._params
        sample = self._all_gps().used
        self._has_camera = self.state.camera.enabled
        self._gps_lag_s = self.state.gps_lag_s if sample is None else sample.lag_s
        differing_imus = len(sensors.imus)
        imus = cores_of_mask(imu_mask(params), differing_imus or NUMBER_OF_IMUS)
        if not imus:
            return
        buffers = partial(
            buffer_sizes,
            params.get_int,
            has_camera=self._has_camera,
            has_flow=self._has_flow(),
            gps_lag_s=self._gps_lag_s,
            least_ms=self._buffer_ms,
        )
        self.cores = Cores(
            params,
            self._sources,
            self._logger,
            self._texts,
            self._release,
            buffers,
            imus,
            differ=differing_imus,
            baros_differ=bool(sensors.baros),
            has_camera=self._has_camera,
        )
        self.core = self.cores.lanes.primary_filter

    def _log_frame(self, sensors: Sensors, gps: AllGps, now_us: int) -> None:
        log, state = self._log, self.state
        if self._sources.active_set != self._source_set:
            self._source_set = self._sources.active_set
            log.event(SOURCE_SET_1 + self._source_set)
        if log.start_frame(now_us, self._flying_ms(now_us)):
            log.vehicle(VehicleFrame(state.armed, *self._expected(), self._has_flow(), state.home))
            log.sensors(self._with_zeroed_baro(sensors), gps, self._gps_lag_s)
            log.ranges(state.ranges)
        log.frame(state.camera)

    def _with_zeroed_baro(self, sensors: Sensors) -> Sensors:
        if not any(self._baro_zeros_m) or sensors.baro is None:
            return sensors
        zeroed = [one.lowered(zero_m) for one, zero_m in zip(baros_of(sensors), self._baro_zeros_m, strict=True)]
        baro = zeroed[first_healthy(zeroed)].timed_height
        return replace(sensors, baro=baro, baros=tuple(zeroed) if sensors.baros else ())

    def _gps(self) -> AllGps:
        """Return the newest solutions with antennas' places from the IMU: the same objects until either changes."""
        given = self._all_gps()
        counted = zip(self._gps_from_imu, given.solutions, strict=False)
        solutions = (None if one is None else move(_FIRST_IMU, one, self._imu_frd()) for move, one in counted)
        return given._replace(solutions=tuple(solutions))

    def _range_finders(self) -> RangeState | None:
        """Return the ranges with places from the IMU: the same object until they change."""
        given = self.state.ranges
        return None if given is None else self._ranges_from_imu(_FIRST_IMU, given, self._imu_frd())

    def _lever_arm(self) -> Three:
        """Return the camera's place from the IMU, m, body (FRD)."""
        if not self._has_camera:
            return (0.0, 0.0, 0.0)
        place, imu_pos = self.state.camera.pos_offset, self._place_of_imu()
        if place is not self._camera_pos or imu_pos is not self._imu_pos:
            self._camera_pos, self._imu_pos = place, imu_pos
            self._lever = _floats(place - imu_pos)
        return self._lever

    # Estimates

    def log_estimates(self) -> None:
        """Log the present estimates of the filters."""
        if self.cores is not None:
            self.cores.log_estimates(self._clock.micros64())
            self._log.note_logged()

    def report(self) -> CoreReport | None:
        """Return the report of the primary core; None before it has a state."""
        if self.cores is None or self.core is None or not self.core.initialised:
            return None
        return self.cores.report(self.core)

    def aiding_mode(self) -> AidingMode:
        """Return how the primary core navigates."""
        core = self.core
        return _MODES[core.aiding.mode] if core is not None and core.initialised else AidingMode.NONE

    def _attitude(self) -> Quaternion:
        if self._active and self.core is not None:
            return Quaternion(*self.core.output.now.quat)
        if self._truth is not None:
            return Quaternion(*self._truth[2])
        roll = pitch = 0.0
        if self.core is not None and self.core.initialised:
            roll, pitch, _ = euler_of(self.core.output.now.quat)
        return Quaternion.from_euler(f32(roll), f32(pitch), f32(self.source.yaw_rad()))

    def _flags(self) -> FilterFlag:
        if self.core is None or not self.core.initialised:
            return FilterFlag.UNINITIALISED
        flags = self.core.flags
        reported = FilterFlag(flags & _REPORTED)
        if flags & _GLITCHING:
            reported |= FilterFlag.GPS_GLITCHING
        return reported if flags & _INITIALISED else reported | FilterFlag.UNINITIALISED

    def dcm_yaw_initialised(self) -> bool:
        """Return whether there has been a compass heading."""
        return self.started() and self._has_compass()

    def using_extnav_for_yaw(self) -> bool:
        """Return whether yaw comes from external navigation (NavEKF3_core::using_extnav_for_yaw)."""
        if self._estimator in (Estimator.SIM, Estimator.EXTERNAL):
            return False
        return self.core is not None and self.core.uses_ext_nav_for_yaw(self._now_ms())

    def uses_gps(self) -> bool:
        """Return whether the estimator uses a GPS; every other one than EKF3 is taken for one that does."""
        return self._configured() is not Estimator.EKF3 or super().uses_gps()

    def initialised(self) -> bool:
        """Return whether the chosen estimator has settled (AP_AHRS::initialised)."""
        if self._configured() is Estimator.EKF3:
            return super().initialised()
        return self._configured() is Estimator.SIM

    def get_yaw_rad(self) -> np.float32:
        """Return the yaw, -pi..pi."""
        if self._active and self.core is not None:
            return f32(euler_of(self.core.output.now.quat)[2])
        return f32(self.source.yaw_rad())

    def get_quaternion(self) -> Quaternion | None:
        """Return the attitude as of the last frame; None before the AHRS runs."""
        if self._quat is None and self.started():
            self._quat = self._attitude()
        return self._quat

    def get_imu(self) -> tuple[Vector3f, Vector3f] | None:
        """Return what the first IMU measures."""
        *deltas, vel_dt, ang_dt = self._measured[:8] or (0.0, 0.0)
        if not (vel_dt > 0 and ang_dt > 0):
            return None
        return Vector3f(*(delta / vel_dt for delta in deltas[:3])), Vector3f(*(delta / ang_dt for delta in deltas[3:]))

    def get_gyro(self) -> Vector3f:
        """Return the body rates in rad/s, without bias."""
        if self._sensors is None:
            return Vector3f()
        if self.core is not None and self.core.has_delta:
            delta = self.core.delta
            x, y, z = (angle / delta.del_ang_dt for angle in delta.del_ang)
        else:
            x, y, z = (self._sensors.delta.del_ang / self._sensors.delta.del_ang_dt).tolist()
        return Vector3f(x, y, z) + self.get_gyro_drift()

    def get_gyro_drift(self) -> Vector3f:
        """Return what is added to the gyros' rates against their bias, rad/s."""
        if not self._active or self.core is None:
            return Vector3f()
        dt_ekf_avg = self.core.dt_ekf_avg
        return Vector3f(*(-bias / dt_ekf_avg for bias in self.core.state.gyro_bias))

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the position while the filter navigates; it needs no origin for that."""
        if self._truth is not None:
            return Vector3f(*self._truth[0])
        core = self.core
        navigates = self._active and core is not None and core.aiding.mode != NO_AIDING
        if not navigates or core is None or not self._flags() & FilterFlag.VERT_POS:
            return None
        return Vector3f(*core.position())

    def get_velocity_NED(self) -> Vector3f | None:
        """Return the velocity, as soon as the filter runs."""
        if self._truth is not None:
            return Vector3f(*self._truth[1])
        return Vector3f(*self.core.output.now.vel) if self._active and self.core is not None else None

    def get_location(self) -> Location | None:
        """Return the filter's place while it has one, else that of the GPS (NavEKF3_core::getLLH)."""
        origin = self.origin()
        position = None if origin is None else self.get_relative_position_NED_origin_float()
        if origin is not None and position is not None and (self._truth is not None or self._flags() & _HORIZ_POS):
            return origin.offset(position)
        fix = self._all_gps().used
        has_fix = self._active and fix is not None and fix.fix_type >= FIX_3D
        return fix.location if has_fix and fix is not None else None

    def last_location(self) -> Location | None:
        """Return where the vehicle is, else the last place of the filter that runs, for which it does not vouch."""
        place = self.get_location()
        if place is not None or not self._active or self.core is None or not self._has_origin():
            return place
        return self.core.last_place()

    def get_filter_status(self) -> FilterStatus | None:
        """Return flags and test ratios, once there are cores; no flag is set of an estimator that does not run."""
        if self._configured() is not Estimator.EKF3:
            return NO_ESTIMATOR if self._truth is None else SIM_STATUS
        core = self.core
        if core is None:
            return None
        if not core.initialised:
            return FilterStatus(FilterFlag.UNINITIALISED)
        ratios = core.vel_pos.vel_ratio, core.vel_pos.pos_ratio, core.vel_pos.height_ratio
        compass = max(core.yaw.ratio, *core.yaw.field.ratios)
        terrain = core.height.terrain.range_ratio if self._needs_terrain(core) else 0.0
        return FilterStatus(self._flags(), *map(math.sqrt, (*ratios, compass, terrain)))

    def _needs_terrain(self, core: Core) -> bool:
        is_height = core.height.active == RANGEFINDER and self._params.get_int("EK3_RNG_USE_HGT") > 0
        return is_height or (core.aiding.mode == RELATIVE and core.flow.is_valid)

    def height_above_ground(self) -> float | None:
        """Return the height above the ground in m, or None while it is unknown (NavEKF3_core::getHAGL)."""
        core = self.core
        if core is None or not self.healthy() or core.height.is_lost or not core.flow.ground_is_valid:
            return None
        return core.height.terrain.down - core.output.now.pos[2]

    def baro_height_m(self) -> float:
        """Return the barometer's height above where it was calibrated, m; 0 before the first reading."""
        read = None if self._sensors is None else self._with_zeroed_baro(self._sensors).baro
        return 0.0 if read is None else read[1]

    def control_limits(self) -> ControlLimits:
        """Return what keeps flow and ranges within what their sensors measure, while they are navigated by.

        Source: NavEKF3_core::getEkfControlLimits, NavEKF3_core::getHeightControlLimit.
        """
        core = self.core
        if self._truth is not None or not self._active or core is None or core.aiding.mode != RELATIVE:
            return NO_LIMITS
        now_ms, terrain = self._now_ms(), core.height.terrain
        speed_m_s, gain, up_m = NO_LIMITS
        relies_on_flow = now_ms - core.flow_reading.valid_ms <= _FLOW_RELIED_ON_MS
        if relies_on_flow and now_ms - core.aiding.odometry_ms > _ODOMETRY_GONE_MS:
            flow_max = self._params.get_number(f"EK3_{self._release.flow_limit}")
            speed_m_s = max(flow_max - _TURNING_RAD_S, 0.0) * max(terrain.above, terrain.ranges.on_ground)
            gain = _FULL_GAIN_M / max(terrain.above, _FULL_GAIN_M)
        if core.sources.uses_vel_xy(OPTFLOW) and core.flow.is_valid:
            up_m = max(terrain.ranges.max_distance * _SHARE_OF_RANGE - _RANGE_MARGIN_M, _LEAST_LIMIT_M)
            if core.sources.pos_z() != RANGEFINDER:
                up_m -= terrain.down
        return ControlLimits(speed_m_s, gain, up_m)

    def healthy(self) -> bool:
        """Return whether the estimator runs well."""
        return self._truth is not None or (self._active and self.core is not None and self.core.healthy(self._now_ms()))

    # Requests of the vehicle

    def _note_origin(self, origin: Location) -> None:
        self._origin = origin
        self.source.stand_at(origin)

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once, and not before the estimator runs; return whether that of the one in use was set.

        FIRMWARE PARITY: until March 2026 the filter loses an origin that it gets before it has begun.
        """
        core = self.core
        is_early = core is None or (self._release.refuses_early_origin and not core.initialised)
        if self._origin is not None or self.cores is None or is_early:
            return False
        self._log.origin(origin)
        self._note_origin(origin)
        self.cores.lanes.set_origin(origin)
        self.cores.send_texts()
        return self._has_origin() and (self._active or self._truth is not None)

    def _has_origin(self) -> bool:
        return self._configured() is Estimator.EKF3 or self._truth is not None

    def origin(self) -> Location | None:
        """Return the origin of the chosen estimator."""
        return self._origin if self._has_origin() else None

    def set_terrain_stable(self, *, is_stable: bool) -> None:
        """Set whether heights may be measured from the ground; only a change reaches the filter and the log."""
        if is_stable is self._terrain_is_stable:
            return
        self._terrain_is_stable = is_stable
        self._log.event(TERRAIN_STABLE if is_stable else TERRAIN_UNSTABLE)
        for core in () if self.cores is None else self.cores.lanes.cores:
            core.set_terrain_stable(is_stable)

    def reset_height_datum(self) -> bool:
        """Make the present height zero, on the ground (NavEKF3::resetHeightDatum)."""
        if self.cores is None:
            return False
        self._log.event(RESET_HEIGHT_DATUM)
        was_reset = self.cores.lanes.reset_height_datum()
        is_zeroed_here = was_reset and not self.source.has_recorded_heights
        if is_zeroed_here and self._sensors is not None:
            self._baro_zeros_m = tuple(one.height for one in baros_of(self._sensors))
        return was_reset

    def request_yaw_reset(self) -> None:
        """Ask all cores to reset yaw by the velocity of GPS (NavEKF3::requestYawReset)."""
        if self.cores is not None:
            self._log.event(REQUEST_YAW_RESET)
            self.cores.lanes.request_yaw_reset()

    def check_lane_switch(self) -> None:
        """Switch to a core that is much better, if there is one (NavEKF3::checkLaneSwitch)."""
        if self.cores is not None:
            self._log.event(CHECK_LANE_SWITCH)
            self.cores.lanes.check_lane_switch()
            self.cores.send_texts()
            self._follow_primary(self.cores)

    def handle_external_position_estimate(self, location: Location, accuracy_m: np.float32, time_ms: int) -> bool:
        """Set the position while the filter navigates without one; return whether it was set."""
        return self.cores is not None and self.cores.lanes.set_place(location, float(accuracy_m), time_ms)

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        """Return what keeps the vehicle from arming, the text after ``AHRS: ``, or None (AP_AHRS::pre_arm_check)."""
        wanted = self._configured()
        if wanted is Estimator.EXTERNAL:
            return "ExternalAHRS: Invalid backend"
        is_another = self._release.checks_estimator_number and self._params.get_int("AHRS_EKF_TYPE") != wanted
        if is_another or (self._estimator is not wanted and self._has_compass()):
            return "not using configured AHRS type"
        if wanted is Estimator.SIM and self._truth is not None:
            return None
        if not self._active or self.cores is None or self.core is None:
            return f"{wanted.title} not started"
        failure = self.cores.disagreement(checks_yaw=self._has_compass()) or source_failure(
            self._sources, self._is_fitted, requires_position=requires_position
        )
        if failure is not None:
            return failure
        by_others = any(core.yaw.source != SourceYaw.GPS for core in self.cores.lanes.cores)
        if self._params.get_int("EK3_MAG_CAL") in _OLD_EXTERNAL_YAW and by_others:
            return "EK3_MAG_CAL and EK3_SRC1_YAW inconsistent"
        return self.cores.lanes.unhealthy_reason(self._now_ms())

    def _is_fitted(self, sensor: str) -> bool:
        """Return whether there is a sensor that EKF sources may need."""
        ranges = self.state.ranges
        fitted = {
            BARO: True,
            COMPASS: self._has_compass(),
            GPS: self._params.get_int("GPS1_TYPE") != 0,
            OPTICAL_FLOW: self._has_flow(),
            RANGEFINDER_SENSOR: ranges is not None and any(finder.orientation == DOWNWARD for finder in ranges.finders),
            VISUAL_ODOM: self.state.camera.enabled,
        }
        return fitted.get(sensor, False)

    # Calls of the drivers

    def write_flow(self, measured: FlowMeasurement, time_ms: int) -> None:
        """Log what a flow sensor measured, then hand it to the filter."""
        super().write_flow(measured, time_ms)
        if self.cores is not None and not self._is_stopped:
            place = from_imu(measured.offset, self._imu_frd())
            for lane, core in enumerate(self.cores.lanes.cores):
                offset = from_imu(place, self.cores.place_of_imu(lane))
                core.write_flow(measured.quality, measured.flow, measured.gyro, offset)

    def _ext_navs(self) -> list[ExtNav]:
        """Return the inputs of external navigation; one that refuses all samples until the cores are set up."""
        return [self._refusing] if self._is_stopped or self.cores is None else self.cores.ext_navs()

    def writeExtNavData(
        self,
        pos: Vector3f,
        quat: Quaternion,
        posErr: np.float32,
        angErr: np.float32,
        timeStamp_ms: int,
        delay_ms: int,
        resetTime_ms: int,
    ) -> None:
        """Log a position and attitude sample, then hand it to all cores."""
        super().writeExtNavData(pos, quat, posErr, angErr, timeStamp_ms, delay_ms, resetTime_ms)
        sample = _floats(pos), float(posErr), yaw_of(quat), float(angErr)
        for ext_nav in self._ext_navs():
            ext_nav.write_pose(*sample, timeStamp_ms, delay_ms, resetTime_ms)
        self._report_outcomes()
        if self.source.follows_poses and not self._is_stopped:
            is_reset = resetTime_ms != self._reset_ms
            self._reset_ms = resetTime_ms
            lever = self._lever_arm()
            place = pos - quat.rotate_vector(Vector3f(*lever)) if any(lever) else pos
            self.source.take_pose(place, quat, u32(timeStamp_ms - delay_ms), is_reset)

    def writeExtNavVelData(self, vel: Vector3f, err: np.float32, timeStamp_ms: int, delay_ms: int) -> None:
        """Log a velocity sample, then hand it to all cores."""
        super().writeExtNavVelData(vel, err, timeStamp_ms, delay_ms)
        for ext_nav in self._ext_navs():
            ext_nav.write_velocity(_floats(vel), float(err), timeStamp_ms, delay_ms)
        self._report_outcomes()

    def writeBodyFrameOdom(
        self,
        quality: np.float32,
        delPos: Vector3f,
        delAng: Vector3f,
        delTime: np.float32,
        timeStamp_ms: int,
        delay_ms: int,
        posOffset: Vector3f,
    ) -> None:
        """Log a body odometry sample, then hand it to all cores."""
        super().writeBodyFrameOdom(quality, delPos, delAng, delTime, timeStamp_ms, delay_ms, posOffset)
        params = self._params
        errors = params.get_number("EK3_VIS_VERR_MIN"), params.get_number("EK3_VIS_VERR_MAX")
        vel, err, has_nan = body_velocity(quality, delPos, delAng, delTime, posOffset, errors)
        for lane, ext_nav in enumerate(self._ext_navs()):
            offset = _floats(self._from_imu(posOffset, lane))
            ext_nav.write_odometry(vel, err, float(delTime), has_nan, timeStamp_ms, delay_ms, offset)
        self._report_outcomes()

    def _from_imu(self, place: Vector3f, lane: int) -> Vector3f:
        """Return a place on the vehicle as counted from a core's IMU."""
        from_first = place - self._place_of_imu()
        return from_first if self.cores is None else from_first - Vector3f(*self.cores.place_of_imu(lane))


def body_velocity(
    quality: np.float32,
    del_pos: Vector3f,
    del_ang: Vector3f,
    del_time: np.float32,
    offset: Vector3f,
    errors: tuple[float, float],
) -> tuple[Three, float, bool]:
    """Return what a body odometry measures: m/s, body, its error, and whether anything in it is NaN.

    ``errors`` are EK3_VIS_VERR_MIN and EK3_VIS_VERR_MAX, m/s.
    Source: AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeBodyFrameOdom, in single precision.
    """
    best, worst = map(f32, errors)
    with np.errstate(all="ignore"):
        vel = del_pos * (f32(1) / del_time)
        err = best + (worst - best) * (f32(1) - f32(0.01) * quality)
    has_nan = math.isnan(quality) or math.isnan(del_time) or any(v.is_nan() for v in (del_pos, del_ang, offset))
    return _floats(vel), float(err), has_nan
