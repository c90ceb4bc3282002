# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The AHRS of a vehicle that estimates its state by EKF3 (AP_AHRS/AP_AHRS.cpp).

All that it tells is the primary core's.

FIRMWARE PARITY: before the filter runs, the attitude is level with the sensors' true heading, where the firmware has
its simple estimate (DCM).
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.param_cache import FromParams
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.ahrs.cores import Cores
from ekf_stub.ahrs.parts import AhrsParts
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.ekf3_core import Ekf3Core, Frame
from ekf_stub.filter.attitude import euler_of
from ekf_stub.filter.inertial import Array, are_usable, row_of
from ekf_stub.filter.inertial_pass import PLAIN, Kernel
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.fusion.height_source import RANGE
from ekf_stub.inputs.ext_nav_ingest import ExtNavIngest, FilterOutcome
from ekf_stub.inputs.flow_ingest import FlowMeasurement
from ekf_stub.inputs.gps_sample import FIX_3D, GpsSample
from ekf_stub.inputs.places import from_imu, gps_seen_from
from ekf_stub.inputs.range_state import RangeState
from ekf_stub.inputs.sensors import Sensors, SensorSource
from ekf_stub.inputs.source_check import source_failure
from ekf_stub.inputs.sources import SourceYaw
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from ekf_stub.log.replay_log import (
    CHECK_LANE_SWITCH,
    REQUEST_YAW_RESET,
    RESET_HEIGHT_DATUM,
    SOURCE_SET_1,
    TERRAIN_STABLE,
    TERRAIN_UNSTABLE,
    VehicleFrame,
)
from ekf_stub.reports.core_report import CoreReport
from ekf_stub.reports.core_texts import MAV_SEVERITY_INFO, NUMBER_OF_IMUS, cores_of_mask
from ekf_stub.reports.filter_status import FilterFlag, FilterStatus

_NO_ROWS: Final[Array] = np.zeros((0, 8))
_OLD_EXTERNAL_YAW: Final = (5, 6)  # of EK3_MAG_CAL
_HORIZ_POS: Final = FilterFlag.HORIZ_POS_ABS | FilterFlag.HORIZ_POS_REL
_REPORTED: Final = (1 << 10) - 1  # flags that EKF_STATUS_REPORT has as they are
_GLITCHING, _INITIALISED = 1 << 14, 1 << 16  # of nav_filter_status

PoseListener = Callable[[Vector3f, Quaternion, int, bool], None]
"""Takes the IMU's place in m NED, the attitude, when they were observed in ms since boot, and whether they jumped."""


def _floats(place: Vector3f) -> tuple[float, float, float]:
    x, y, z = map(float, place.to_tuple())
    return x, y, z


class Ekf3Ahrs(AhrsBase):
    """The AHRS with the cores in it.

    Args:
        parts: the vehicle around it.
        source: where inertial data and other measurements come from.
        find_kernel: finds what the filter's arithmetic runs on, once the cores are set up.
        start_us: when the AHRS starts.
        buffer_ms: a delay for which the filter's buffers are long enough in any case.

    Attributes:
        cores: the cores, once they have been set up; None also when none is wanted.
        core: the filter of the primary one.
        on_pose: hears of each pose that external navigation gives.
    """

    def __init__(
        self,
        parts: AhrsParts,
        source: SensorSource,
        *,
        find_kernel: Callable[[], Kernel] = lambda: PLAIN,
        start_us: int = AHRS_START_US,
        buffer_ms: int = 0,
    ) -> None:
        super().__init__(parts.clock, parts.sources, parts.log, start_us=start_us)
        self._parts = parts
        self._replay_log = parts.log
        self.source = self._source = source
        self._has_compass = FromParams(parts.params, parts.has_compass)
        self._place_of_imu = FromParams(parts.params, parts.imu_pos)
        self._find_kernel = find_kernel
        self._buffer_ms = buffer_ms
        self._camera: VisualOdomFrame | None = None
        self._camera_pos: Vector3f | None = None
        self._imu_pos: Vector3f | None = None
        self._lever = (0.0, 0.0, 0.0)
        self._has_flow = FromParams(parts.params, parts.has_flow)
        self._gps_said: GpsSample | None = None
        self._gps_moved: GpsSample | None = None
        self._gps_imu_pos: Vector3f | None = None
        self._ranges_said: RangeState | None = None
        self._ranges: RangeState | None = None
        self._ranges_imu_pos: Vector3f | None = None
        self._terrain_is_stable: bool | None = None
        self._sensors: Sensors | None = None
        self._was_still: bool | None = None
        self._baro_zero_m = self._gps_lag_s = 0.0
        self._is_stirred = self._is_set_up = self._active = self._has_camera = self._stands_still = False
        self._yaw_reset_ms = self._primary = 0
        self._source_set = parts.sources.active_set
        self._quat: Quaternion | None = None
        self._reset_ms = 0
        self.cores: Cores | None = None
        self.core: Ekf3Core | None = None
        self.on_pose: PoseListener | None = None
        self._on_filter_outcome: Callable[[FilterOutcome], None] | None = None
        self._hand_to(ExtNavIngest(self.ext_nav_counts, float))  # refuses all until the cores are set up

    # Frames

    def stop(self) -> None:
        """Run the filter no further: it keeps to its last estimate, and is handed no more samples or poses."""
        self._stands_still = True
        self.on_pose = self._on_filter_outcome = None
        self._hand_to(ExtNavIngest(self.ext_nav_counts, float))

    def update(self, camera: VisualOdomFrame) -> None:
        """Run one frame."""
        if self._stands_still:
            return
        self._camera = camera
        now_us = self._clock.micros64()
        armed = self._parts.is_armed()
        self._source.set_armed(armed)
        sensors = self._source.sense(now_us)
        self._is_stirred = sensors is None  # what has changed counts from the next frame on
        if sensors is not None:
            self._sensors = sensors
            if self._is_set_up or self.estimator_started():
                self._run_frame(sensors, now_us, armed=armed)
        self._quat = None

    def run_quietly(self, times_us: range, set_us: Callable[[int], None], is_quiet: Callable[[int], bool]) -> int:
        """Run frames, up to one of which more may come than steps of the filter; return how many."""
        core, cores, sensors = self.core, self.cores, self._sensors
        if core is None or cores is None or sensors is None:
            return 0
        done, end, expected = 0, len(times_us), self._parts.expected()
        ran_us, note_us = -1, cores.record_due_us()
        rows, left_from = _NO_ROWS, 0  # what passes from ``left_from`` on get
        while done < end:
            if done - left_from >= len(rows):
                rows, left_from = self._source.ahead(times_us[done:]), done
            if len(rows):
                last = end if times_us[end - 1] < note_us else self._count_before(note_us, times_us, done, end - 1) + 1
                ahead = times_us[done : min(left_from + len(rows), last)]
                count = cores.lanes.run_alike(rows[done - left_from :], ahead, set_us)
                self._source.pass_over(ahead[:count])
                done += count
                ran_us = ahead[count - 1]
            else:
                found = self._source.sense(times_us[done])
                done += 1
                if found is None:
                    continue
                row, ran_us = row_of(found.delta)[np.newaxis], times_us[done - 1]
                is_same = self._parts.expected() == expected and self._brings_nothing(found, sensors)
                brings_nothing = is_same and are_usable(row)[0]
                self._sensors = sensors = found
                if brings_nothing:
                    cores.lanes.run_alike(row, times_us[done - 1 : done], set_us)
                else:
                    set_us(ran_us)
                    self._run_frame(found, ran_us, armed=self._parts.is_armed())
                    if self._parts.expected() != expected or not is_quiet(ran_us):
                        break
                    end, note_us = self._count_before(self.quiet_until_us(), times_us, done, end), cores.record_due_us()
                    continue
            brings_nothing = not core.stepped or (core.was_idle and not cores.record_is_due(ran_us))
            if brings_nothing and ran_us < note_us and core.is_still() == self._was_still:
                continue
            self._note_run(cores, ran_us)
            note_us = cores.record_due_us()
            if not is_quiet(ran_us):
                break
            end = self._count_before(self._next_event_us(core), times_us, done, end)
        if ran_us >= 0:
            log = self._replay_log
            log.start_frame(ran_us, 0)
            if self._camera is not None:
                log.frame(self._camera)
            log.note_run(was_initialised=True)
        self._quat = None
        return done

    @staticmethod
    def _count_before(until_us: int, times_us: range, least: int, most: int) -> int:
        """Return how many of some times come before another, within limits."""
        return max(least, min(most, -((times_us.start - until_us) // times_us.step)))

    def quiet_until_us(self) -> int:
        """Return before when frames may be run like the last one, 0 if the next may not."""
        cores, core = self.cores, self.core
        may = self._active and not (self._is_stirred or self._stands_still)
        if cores is None or core is None or not may or not cores.may_be_alike or self._replay_log.is_wanted:
            return 0
        is_same = self._sources.active_set == self._source_set and self._parts.ranges() is self._ranges_said
        return self._next_event_us(core) if is_same and core.fix is self._gps() else 0

    @staticmethod
    def _next_event_us(core: Ekf3Core) -> int:
        until_ms = core.quiet_until_ms()
        return 0 if until_ms is None else until_ms * 1000 + 1000

    def _brings_nothing(self, found: Sensors, before: Sensors) -> bool:
        """Return whether sensors say what they said before, but for inertial data that the filter takes as they are."""
        is_same = found.baro is before.baro and found.mag is before.mag and found.declination == before.declination
        core = self.core
        return is_same and core is not None and core.fix is self._gps()

    def _run_frame(self, sensors: Sensors, now_us: int, *, armed: bool) -> None:
        if not self._is_set_up:
            self._set_up(len(sensors.imus))
        frame = self._frame(sensors, now_us, armed=armed)
        self._log_frame(sensors, frame)
        cores, core = self.cores, self.core
        if cores is None or core is None:
            return
        was_initialised = core.initialised
        if was_initialised and not self._active:
            self._active = True
            self._parts.texts.send_text(MAV_SEVERITY_INFO, "AHRS: EKF3 active")
        cores.run(frame, sensors.imus)
        self._replay_log.note_run(was_initialised=was_initialised)
        self._note_run(cores, now_us)

    def _note_run(self, cores: Cores, now_us: int) -> None:
        self._was_still = cores.log_run(now_us)
        self._follow_primary(cores)
        if self._origin is None:
            self._origin = cores.lanes.origin

    def _follow_primary(self, cores: Cores) -> None:
        """Tell what jumps and who is primary (Copter::check_ekf_reset)."""
        lanes = cores.lanes
        if self.core is not lanes.primary_filter:
            self.core = lanes.primary_filter
            self._hand_to(*(core.ingest for core in lanes.cores))
        if lanes.yaw_reset_ms != self._yaw_reset_ms:
            self._yaw_reset_ms = lanes.yaw_reset_ms
            self._parts.on_yaw_reset()
        if self._active and lanes.primary != self._primary:
            self._primary = lanes.primary
            self._parts.on_primary(self._primary)

    def _set_up(self, differing_imus: int) -> None:
        # NavEKF3_core::setup_core: what later changes of parameters do not change until the next boot.
        self._is_set_up = True
        parts = self._parts
        self._has_camera, self._gps_lag_s = parts.visual_odom_enabled(), parts.gps_lag_s()
        imus = cores_of_mask(parts.imu_mask(), differing_imus or NUMBER_OF_IMUS)
        if not imus:
            return
        sizes = buffer_sizes(
            parts.params.get_int,
            self._sources,
            has_camera=self._has_camera,
            has_flow=self._has_flow(),
            gps_lag_s=self._gps_lag_s,
            least_ms=self._buffer_ms,
        )
        self.cores = Cores(
            parts, self._find_kernel(), sizes, imus, differ=differing_imus > 0, has_camera=self._has_camera
        )
        lanes = self.cores.lanes
        self.core = lanes.primary_filter
        self._hand_to(*(core.ingest for core in lanes.cores))
        if self._origin is not None:
            lanes.set_origin(self._origin)

    def _hand_to(self, *ingests: ExtNavIngest) -> None:
        """Hand samples to these from now on; what becomes of them counts and is told of the primary core alone."""
        self._ingests = ingests
        told = self.core.ingest if self.core is not None and self.core.ingest in ingests else ingests[0]
        for ingest in ingests:
            ingest.counts = self.ext_nav_counts if ingest is told else Counter()
            ingest.on_outcome = self._on_filter_outcome if ingest is told else None

    @property
    def on_filter_outcome(self) -> Callable[[FilterOutcome], None] | None:
        """What hears of each sample of external navigation what becomes of it (``ExtNavIngest.on_outcome``)."""
        return self._on_filter_outcome

    @on_filter_outcome.setter
    def on_filter_outcome(self, on_filter_outcome: Callable[[FilterOutcome], None] | None) -> None:
        self._on_filter_outcome = on_filter_outcome
        self._hand_to(*self._ingests)

    def _log_frame(self, sensors: Sensors, frame: Frame) -> None:
        log = self._replay_log
        if self._sources.active_set != self._source_set:
            self._source_set = self._sources.active_set
            log.event(SOURCE_SET_1 + self._source_set)
        if log.start_frame(frame.time_us, frame.flying_ms):
            expected = frame.takeoff_expected, frame.touchdown_expected
            log.vehicle(VehicleFrame(frame.armed, *expected, self._has_flow(), self._parts.home()))
            log.sensors(self._with_zeroed_baro(sensors), frame.gps, self._gps_lag_s)
            log.ranges(self._parts.ranges())
        if self._camera is not None:
            log.frame(self._camera)

    def _with_zeroed_baro(self, sensors: Sensors) -> Sensors:
        if not self._baro_zero_m or sensors.baro is None:
            return sensors
        height = float(np.float32(sensors.baro[1] - self._baro_zero_m))
        return replace(sensors, baro=(sensors.baro[0], height))

    def _frame(self, sensors: Sensors, now_us: int, *, armed: bool) -> Frame:
        parts = self._parts
        home = parts.home()
        return Frame(  # by position, which takes half the time
            now_us,
            sensors.delta,
            armed,
            parts.flying_ms(),
            *parts.expected(),
            self._with_zeroed_baro(sensors).baro if self._baro_zero_m else sensors.baro,
            sensors.mag,
            self._gps(),
            sensors.declination,
            None,  # place_declination
            self._lever_arm(),
            0 if home is None else home.lat,
            self._range_finders(),
        )

    def _gps(self) -> GpsSample | None:
        """Return the newest solution with its antenna's place from the IMU: the same until either changes."""
        said, imu_pos = self._parts.gps(), self._place_of_imu()
        if said is not self._gps_said or imu_pos is not self._gps_imu_pos:
            self._gps_said, self._gps_imu_pos = said, imu_pos
            self._gps_moved = None if said is None else gps_seen_from(said, _floats(imu_pos))
        return self._gps_moved

    def _range_finders(self) -> RangeState | None:
        """Return what the range finders say, with their places from the IMU: the same until that changes."""
        said, imu_pos = self._parts.ranges(), self._place_of_imu()
        if said is not self._ranges_said or imu_pos is not self._ranges_imu_pos:
            self._ranges_said, self._ranges_imu_pos = said, imu_pos
            self._ranges = None if said is None else said.seen_from(_floats(imu_pos))
        return self._ranges

    def _lever_arm(self) -> tuple[float, float, float]:
        """Return the camera's place from the IMU, m, body (FRD)."""
        camera = self._camera
        if not self._has_camera or camera is None:
            return (0.0, 0.0, 0.0)
        place, imu_pos = camera.pos_offset, self._place_of_imu()
        if place is not self._camera_pos or imu_pos is not self._imu_pos:
            self._camera_pos, self._imu_pos = place, imu_pos
            self._lever = _floats(place - imu_pos)
        return self._lever

    # What the filter says

    def log_estimates(self) -> None:
        """Log what the filters say at the moment."""
        if self.cores is not None:
            self.cores.log_estimates(self._clock.micros64())
            self._replay_log.note_logged()

    def report(self) -> CoreReport | None:
        """Return what the primary core says of itself; None before it has a state."""
        if self.cores is None or self.core is None or not self.core.initialised:
            return None
        lanes = self.cores.lanes
        return lanes.report(lanes.cores.index(self.core))

    def _attitude(self) -> Quaternion:
        if self._active and self.core is not None:
            quat = self.core.output.now.quat
            return Quaternion(quat.w, quat.x, quat.y, quat.z)
        return Quaternion.from_euler(f32(0), f32(0), f32(self._source.yaw_rad()))

    def _flags(self) -> FilterFlag:
        if self.core is None or not self.core.initialised:
            return FilterFlag.UNINITIALISED
        flags = self.core.control.flags
        reported = FilterFlag(flags & _REPORTED)
        if flags & _GLITCHING:
            reported |= FilterFlag.GPS_GLITCHING
        return reported if flags & _INITIALISED else reported | FilterFlag.UNINITIALISED

    def dcm_yaw_initialised(self) -> bool:
        """Return whether there has been a compass heading."""
        return self.started() and self._has_compass()

    def using_extnav_for_yaw(self) -> bool:
        """Return whether yaw comes from external navigation (NavEKF3_core::using_extnav_for_yaw)."""
        return self.core is not None and self.core.uses_ext_nav_for_yaw(self._now_ms())

    def get_yaw_rad(self) -> np.float32:
        """Return the yaw, -pi..pi."""
        if self._active and self.core is not None:
            return f32(euler_of(self.core.output.now.quat)[2])
        return f32(self._source.yaw_rad())

    def get_quaternion(self) -> Quaternion | None:
        """Return the attitude as of the last frame; None before the AHRS runs."""
        if self._quat is None and self.started():
            self._quat = self._attitude()
        return self._quat

    def get_imu(self) -> tuple[Vector3f, Vector3f] | None:
        """Return what the first IMU measures."""
        delta = None if self._sensors is None else self._sensors.delta
        if delta is None or delta.accel is None or delta.gyro is None:
            return None
        return Vector3f(*delta.accel), Vector3f(*delta.gyro)

    def get_gyro(self) -> Vector3f:
        """Return the body rates in rad/s, without bias."""
        if self._sensors is None:
            return Vector3f()
        used = None if self.core is None else self.core.inertial
        delta = self._sensors.delta if used is None else used
        return Vector3f(*(delta.del_ang / delta.del_ang_dt).tolist()) + self.get_gyro_drift()

    def get_gyro_drift(self) -> Vector3f:
        """Return what is added to the gyros' rates against their bias, rad/s."""
        if not self._active or self.core is None:
            return Vector3f()
        return Vector3f(*(-self.core.state.gyro_bias / self.core.dt_ekf_avg).tolist())

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the position while the filter navigates; it needs no origin for that."""
        core = self.core
        navigates = self._active and core is not None and core.aiding.mode is not AidingMode.NONE
        if not navigates or core is None or not self._flags() & FilterFlag.VERT_POS:
            return None
        return Vector3f(*core.position().tolist())

    def get_velocity_NED(self) -> Vector3f | None:
        """Return the velocity, as soon as the filter runs."""
        return Vector3f(*self.core.output.now.vel.tolist()) if self._active and self.core is not None else None

    def get_location(self) -> Location | None:
        """Return the filter's place while it has one, else that of the GPS (NavEKF3_core::getLLH)."""
        origin = self.origin()
        position = None if origin is None else self.get_relative_position_NED_origin_float()
        if origin is not None and position is not None and self._flags() & _HORIZ_POS:
            return origin.offset(position)
        fix = self._parts.gps()
        has_fix = self._active and fix is not None and fix.fix_type >= FIX_3D
        return fix.location if has_fix and fix is not None else None

    def get_filter_status(self) -> FilterStatus | None:
        """Return flags and test ratios, once there are cores."""
        core = self.core
        if core is None:
            return None
        if not core.initialised:
            return FilterStatus(FilterFlag.UNINITIALISED)
        innovations = core.fusion.innovations
        ratios = innovations.vel_ratio, innovations.pos_ratio, innovations.height_ratio
        compass = max(core.yaw.ratio, *core.yaw.field.ratios.tolist())
        terrain = core.height.terrain.range_ratio if self._needs_terrain(core) else 0.0
        return FilterStatus(self._flags(), *map(math.sqrt, (*ratios, compass, terrain)))

    def _needs_terrain(self, core: Ekf3Core) -> bool:
        is_height = core.height.active == RANGE and self._parts.params.get_int("EK3_RNG_USE_HGT") > 0
        return is_height or (core.aiding.mode is AidingMode.RELATIVE and core.flow.is_valid)

    def height_above_ground(self) -> float | None:
        """Return the height above the ground in m, or None while it is unknown (NavEKF3_core::getHAGL)."""
        core = self.core
        if core is None or not self.healthy() or core.height.is_lost or not core.flow.ground_is_valid:
            return None
        return core.height.terrain.down - float(core.output.now.pos[2])

    def healthy(self) -> bool:
        """Return whether the filter runs well."""
        return self._active and self.core is not None and self.core.control.healthy(self._now_ms())

    # What the vehicle asks for

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once, and not before the estimator runs; say whether it was set."""
        core = self.core
        is_early = core is None or (core.release.refuses_early_origin and not core.initialised)
        if self._origin is not None or self.cores is None or is_early:
            return False
        self._is_stirred = True
        self._replay_log.origin(origin)
        self._origin = origin
        self.cores.lanes.set_origin(origin)
        return True

    def set_terrain_stable(self, *, is_stable: bool) -> None:
        """Hear whether heights may count from the ground; the filter and the log hear of changes alone."""
        if is_stable is self._terrain_is_stable:
            return
        self._terrain_is_stable = is_stable
        self._is_stirred = True
        self._replay_log.event(TERRAIN_STABLE if is_stable else TERRAIN_UNSTABLE)
        for core in () if self.cores is None else self.cores.lanes.cores:
            core.set_terrain_stable(is_stable=is_stable)

    def reset_height_datum(self) -> bool:
        """Let heights count from the present one, on the ground (NavEKF3::resetHeightDatum)."""
        if self.cores is None:
            return False
        self._is_stirred = True
        self._replay_log.event(RESET_HEIGHT_DATUM)
        was_reset = self.cores.lanes.reset_height_datum()
        is_zeroed_here = was_reset and not self._source.has_recorded_heights
        if is_zeroed_here and self._sensors is not None and self._sensors.baro is not None:
            self._baro_zero_m = self._sensors.baro[1]
        return was_reset

    def request_yaw_reset(self) -> None:
        """Ask all cores to reset yaw by the velocity of GPS (NavEKF3::requestYawReset)."""
        if self.cores is not None:
            self._is_stirred = True
            self._replay_log.event(REQUEST_YAW_RESET)
            self.cores.lanes.request_yaw_reset()

    def check_lane_switch(self) -> None:
        """Go over to a core that is much better, if there is one (NavEKF3::checkLaneSwitch)."""
        if self.cores is not None:
            self._is_stirred = True
            self._replay_log.event(CHECK_LANE_SWITCH)
            self.cores.lanes.check_lane_switch()
            self._follow_primary(self.cores)

    def handle_external_position_estimate(self, location: Location, accuracy_m: np.float32, time_ms: int) -> bool:
        """Put the vehicle somewhere while it navigates without a position; say whether it was."""
        self._is_stirred = True
        return self.cores is not None and self.cores.lanes.set_place(location, float(accuracy_m), time_ms)

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        """Return what keeps the vehicle from arming, the text after ``AHRS: ``, or None (AP_AHRS::pre_arm_check)."""
        if not self._active or self.cores is None or self.core is None:
            return "not using configured AHRS type" if self._has_compass() else "EKF3 not started"
        failure = self.cores.disagreement(checks_yaw=self._has_compass()) or source_failure(
            self._sources, self._parts.is_fitted, requires_position=requires_position
        )
        if failure is not None:
            return failure
        if self._parts.params.get_int("EK3_MAG_CAL") in _OLD_EXTERNAL_YAW and self.core.yaw.source != SourceYaw.GPS:
            return "EK3_MAG_CAL and EK3_SRC1_YAW inconsistent"
        return self.cores.lanes.unhealthy_reason(self._now_ms())

    # Calls of the drivers

    def write_flow(self, measured: FlowMeasurement, time_ms: int) -> None:
        """Log what a flow sensor measured, then hand it to the filter."""
        super().write_flow(measured, time_ms)
        if self.cores is not None and not self._stands_still:
            place = from_imu(measured.offset, _floats(self._place_of_imu()))
            for lane, core in enumerate(self.cores.lanes.cores):
                core.write_flow(measured._replace(offset=from_imu(place, self.cores.place_of_imu(lane))))

    def _tell_pose(self, pos: Vector3f, quat: Quaternion, time_ms: int, reset_ms: int) -> None:
        if self.on_pose is not None:
            is_reset = reset_ms != self._reset_ms
            self._reset_ms = reset_ms
            lever = self._lever_arm()
            place = pos - quat.rotate_vector(Vector3f(*lever)) if any(lever) else pos
            self.on_pose(place, quat, time_ms, is_reset)

    def _from_imu(self, place: Vector3f, lane: int) -> Vector3f:
        from_first = place - self._place_of_imu()
        return from_first if self.cores is None else from_first - Vector3f(*self.cores.place_of_imu(lane))
