# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One core of EKF3: frames in, estimates out (AP_NavEKF3/AP_NavEKF3_core.cpp, UpdateFilter).

Range beacons, airspeed and wind are not fused; external navigation, optical flow, range finders, barometer, compass and
GPS are.

The filter lives at the fusion horizon, as far in the past as the most delayed sensor needs. Inertial data go two ways:
summed up to steps of about 10 ms they wait until the horizon reaches them, and at the full rate they carry an output
from the horizon to the present, which each step draws towards the filter. A step predicts, takes out of the buffers
what has come due, and fuses it in the firmware's order: yaw, then velocity, position and height, then optical flow,
then body odometry.

This class has that order, and what starts the filter and restarts it. The state, each kind of measurement, the
modes and the report are classes of their own, so that each can be tested alone and held against a recorded log.
"""

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.cint import i32, later_ms, u32
from ap_core.location import Location
from ekf_stub.core.frame import Frame as Frame
from ekf_stub.core.frame_door import FrameDoor
from ekf_stub.core.mode_control import FLYING_MS, ModeControl
from ekf_stub.filter.attitude import quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inactive_biases import ImuRates, InactiveBiases, with_biases
from ekf_stub.filter.inertial import EKF_TARGET_DT, LOOP_DT, Array, InertialDelta, InertialStep, limited
from ekf_stub.filter.inertial_pass import PLAIN, Kernel
from ekf_stub.filter.nominal_state import EARTH_RATE
from ekf_stub.filter.process_model import BAD_ACCEL_NOISE, ProcessNoise
from ekf_stub.filter.release import REFERENCE, FilterRelease
from ekf_stub.fusion.aiding import ABSOLUTE, NO_AIDING, Aiding
from ekf_stub.fusion.body_odometry import BodyOdometry
from ekf_stub.fusion.flow_fusion import FlowFusion
from ekf_stub.fusion.height_source import RANGE, HeightSource
from ekf_stub.fusion.measurements import BaroSample, Delayed
from ekf_stub.fusion.origin_height import IN_MEASUREMENTS, OriginHeight
from ekf_stub.fusion.parts import FilterParts
from ekf_stub.fusion.resets import POS_NE, Resets
from ekf_stub.fusion.terrain import Terrain
from ekf_stub.fusion.vel_pos_fusion import VelPosFusion
from ekf_stub.fusion.yaw_fusion import IN_USE_MS as YAW_IN_USE_MS
from ekf_stub.fusion.yaw_fusion import YawFusion
from ekf_stub.inputs.compasses import NO_COMPASS, Compasses, CompassReading
from ekf_stub.inputs.ext_nav_ingest import HALF_FILTER_STEP_MS, ExtNavIngest
from ekf_stub.inputs.flow_ingest import FlowIngest, FlowMeasurement
from ekf_stub.inputs.gps_checks import GpsSurroundings
from ekf_stub.inputs.gps_reading import CENTI, GpsReading
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.obs_ring import RingSizes
from ekf_stub.inputs.range_reading import RangeReading
from ekf_stub.inputs.sources import YAW_EXTNAV, Z_GPS, EkfSources
from ekf_stub.reports.core_texts import MAV_SEVERITY_WARNING, CoreTexts

BOOTSTRAP_MS: Final = 1000
SENSOR_INTERVAL_MS: Final = 50
FORCED_RESET_MS: Final = 5000
DEAD_RECKONING_MS: Final = 1000
MAX_PLACE_AGE_MS: Final = 5000
LONG_AGO_MS: Final = 1 << 30
MIN_STEP: Final = 0.1  # of the average step
MOST_FRAMES_OF_STEP: Final = int(EKF_TARGET_DT / LOOP_DT + 0.5) + 3
AFFINITY_GPS, AFFINITY_BARO, AFFINITY_MAG = 1, 2, 4  # of EK3_AFFINITY
COMPASS_SHARE: Final = float(np.float32(0.3))
_FIX_2D: Final = 2
_U32: Final = 0xFFFFFFFF  # by it, as u32 does, which takes a call
_NOISES: Final = ("GYRO_P_NSE", "ACC_P_NSE", "GBIAS_P_NSE", "ABIAS_P_NSE", "MAGE_P_NSE", "MAGB_P_NSE")
_ACCEL_NOISE: Final = _NOISES.index("ACC_P_NSE")


@dataclass(slots=True)
class CommonOrigin:
    """Where told positions count from: the first origin that any core has set, None before (common_EKF_origin)."""

    place: Location | None = None


class Ekf3Core:
    """The filter, from its first inertial data on.

    Args:
        get_float: returns a parameter by its name after ``EK3_``.
        counts: what became of samples of external navigation.
        kernel: what its arithmetic runs on.
        common: the origin that it shares with other cores.
        imu: whose data it uses at first.

    Attributes:
        ingest: where external navigation is handed in.
        initialised: it has a state.
        refused: in how many frames which of their fields could not be used.
        stepped: whether the last frame has made a step.
        was_idle: whether nothing has come of the last step but what the filter holds to be true.
        origin: where its own positions count from, None until it is set.
        fix: the solution of the GPS that came with the last frame.
        stillness: what the test for standing still says.
    """

    def __init__(
        self,
        sources: EkfSources,
        get_float: Callable[[str], float],
        sizes: RingSizes,
        texts: CoreTexts,
        counts: Counter[tuple[str, str]],
        has_compass: Callable[[], bool],
        kernel: Kernel = PLAIN,
        *,
        common: CommonOrigin | None = None,
        number: int = 0,
        imu: int = 0,
        release: FilterRelease = REFERENCE,
    ) -> None:
        self.sources = sources
        self._get_float = get_float
        self._sizes = sizes
        self._texts = texts
        self._has_compass = has_compass
        self._kernel = kernel
        self._common = common or CommonOrigin()
        self._number = number
        self._imu = imu
        self.release = release
        self.ingest = ExtNavIngest(counts, get_float)
        self.ingest.set_up(sizes if sources.ext_nav_enabled() else None)
        self.ranges = RangeReading(sizes.ranges)
        self.flow_ingest = FlowIngest(sizes.flow)
        self.gps = GpsReading(get_float, sizes.slow)
        self._pass = kernel.make_pass()
        self.stillness = self._pass.stillness
        self._door = FrameDoor()
        self.refused = self._door.refused
        self._first_ms: int | None = None
        self._steps: deque[InertialStep] = deque(maxlen=sizes.imu)
        self._baro_ms = 0
        self._mag: tuple[int, Array] | None = None
        self._only_compass = NO_COMPASS
        self.origin: Location | None = None
        self._origin_height = OriginHeight()
        self._had_flags_ms = self._now_ms = self._frames_of_step = 0
        self.fix: GpsSample | None = None
        self.initialised = self.stepped = self.was_idle = self._has_begun = False
        self._frame: Frame | None = None

    def run(self, frame: Frame) -> None:
        """Run one frame.

        The filter's own times, in ms, do not wrap; stamps of samples and the horizon do, at 2^32.
        """
        frame = self._frame = self._door.admit(frame)
        now_ms = self._now_ms = frame.time_us // 1000
        self.fix = frame.gps
        if not self.initialised:
            self._pass.sense(frame.delta)
            self._bootstrap(frame, now_ms)
            if self._texts.waiting:
                self._texts.flush()
        else:
            self._update(frame, now_ms)

    # Frames like the last one

    def quiet_until_ms(self) -> int | None:
        """Return until when, included, `run_alike` will do for frames like the last one; None if it does not now."""
        frame = self._frame
        if frame is None or not self.initialised:
            return None
        if not self._door.is_open or frame.is_late or frame.imu_rates is not None:
            return None
        until_ms = self.control.quiet_until_ms() if self.control.flags or not self._had_flags_ms else None
        if until_ms is None or not 0 < frame.flying_ms <= FLYING_MS:
            return until_ms
        return min(until_ms, frame.time_us // 1000 + FLYING_MS - frame.flying_ms - 1)

    def run_alike(self, rows: Array, times_us: range, set_us: Callable[[int], None]) -> int:
        """Run frames like the last one, up to one that makes a step or changes `is_still`; return how many.

        What comes of them is what comes of :meth:`run` for each.

        Args:
            rows: their inertial data, usable, shape (n, 8), a row a frame (`ekf_stub.filter.inertial.row_of`).
            times_us: of the frames, up to ``quiet_until_ms``.
            set_us: sets the clock to the time of the last one that is run.
        """
        control, get, frame = self.control, self._get_float, self._frame
        assert frame is not None
        if self.stepped:
            control.update(frame, times_us[0] // 1000, self._pass.dt_ekf_avg, get, self._texts)
        count, step = self._pass.advance_all(
            rows,
            times_us,
            self.state,
            scale=get("OGNM_TEST_SF") if control.tests_stillness else None,
            height_filter_hz=get("HRT_FILT"),
        )
        if count > 1 and control.flags:
            self._had_flags_ms = times_us[count - 2] // 1000
        now_ms = self._now_ms = times_us[count - 1] // 1000
        control.pass_quietly(now_ms)
        self._frames_of_step += count - 1
        delta = self._pass.delta_of(rows[count - 1])
        self._door.note(delta)
        set_us(times_us[count - 1])
        self._finish(frame, delta, step, now_ms)
        return count

    # Starting up

    def _bootstrap(self, frame: Frame, now_ms: int) -> None:
        if self._first_ms is None:
            self._first_ms = now_ms
        elif now_ms - self._first_ms >= BOOTSTRAP_MS:
            self._initialise(frame, now_ms)
            self._has_begun = True

    def _initialise(self, frame: Frame, now_ms: int) -> None:
        """Begin with the attitude that the accelerometers show, at rest and facing north."""
        self.state = self._make_state(frame)
        self._pass.begin(self.state, self._sizes.imu)
        self.output = self._pass.output
        self._inactive = InactiveBiases(self._imu)
        self.aiding = Aiding()
        self.aiding.times.pos = self.aiding.times.height = now_ms
        self.ranges.reset(now_ms)
        self.flow_ingest.reset(now_ms)
        self._make_fusion(now_ms)
        # In the firmware always 0, which after half of 2^32 ms is in the future.
        long_ago_ms = max(0, now_ms - LONG_AGO_MS)
        empty = InertialStep(long_ago_ms, np.zeros(3), np.zeros(3), 0.0, 0.0)
        self._steps.extend([empty] * self._sizes.imu)
        self.ingest.reset()
        self.ingest.horizon_ms = u32(long_ago_ms)
        self.gps.reset()
        self._baro_ms = now_ms
        self.yaw.compass.begin(self._compasses(frame), now_ms)
        self._had_flags_ms = 0
        self.ingest.initialised = self.initialised = True
        if self.origin is not None:
            self._origin_height.put(self.origin.alt_cm)
            self._texts.add("origin set")
        self._texts.add("initialised")

    def _make_state(self, frame: Frame) -> ErrorState:
        accel = np.array(self._pass.accel())
        length = float(np.linalg.norm(accel))
        accel = accel / length if length > 1e-3 else np.array([0.0, 0.0, -1.0])
        quat = quat_of_euler(math.atan2(-accel[1], -accel[2]), math.asin(limited(accel[0], -1.0, 1.0)), 0.0)
        get = self._get_float
        variances = np.array([get("VELNE_M_NSE")] * 2 + [get("VELD_M_NSE")] + [get("POSNE_M_NSE")] * 2) ** 2
        state = self._kernel.make_state(quat, np.append(variances, get("ALT_M_NSE") ** 2))
        state.forgets_frozen = self.release.forgets_frozen
        latitude = math.radians(1e-7 * frame.home_lat)
        state.earth_rate_ned = EARTH_RATE * np.array([math.cos(latitude), 0.0, -math.sin(latitude)])
        return state

    def _make_fusion(self, now_ms: int) -> None:
        self.delayed = Delayed(self.ingest)
        parts = FilterParts(
            state=self.state,
            output=self.output,
            aiding=self.aiding,
            sources=self.sources,
            delayed=self.delayed,
            ingest=self.ingest,
            gps=self.gps,
            origin_height=self._origin_height,
            texts=self._texts,
            get_float=self._get_float,
            has_compass=self._has_compass,
            ring_size=self._sizes.slow,
            release=self.release,
            core=self._number,
        )
        self.resets = Resets(parts)
        terrain = Terrain(parts, self.ranges, now_ms)
        self.height = HeightSource(parts, terrain)
        self.fusion = VelPosFusion(parts, self.resets, self.height)
        self.flow = FlowFusion(parts, self.flow_ingest, terrain)
        self.yaw = YawFusion(parts, self.resets, self.fusion.innovations)
        self.odometry = BodyOdometry(parts)
        self.control = ModeControl(self)
        self._fusion_waits = False
        self._densities: list[float] = []

    # Every frame

    def _compasses(self, frame: Frame) -> Compasses:
        if frame.compasses is not None:
            return frame.compasses
        if frame.mag is not self._mag:
            self._mag = frame.mag
            self._only_compass = NO_COMPASS if frame.mag is None else Compasses((CompassReading(*frame.mag),))
        return self._only_compass

    def _update(self, frame: Frame, now_ms: int) -> None:
        get = self._get_float
        self.yaw.compass.select(self._compasses(frame), now_ms, armed=frame.armed)
        self.control.update(frame, now_ms, self._pass.dt_ekf_avg, get, self._texts)
        scale = get("OGNM_TEST_SF") if self.control.tests_stillness else None
        if self._has_begun:
            # The firmware reads the frame's data once to see that its buffer is full, and once more to run.
            self._has_begun = False
            self._pass.sample(frame.delta, now_ms, scale=scale)
        if frame.imu_rates is not None:
            self._follow_imus(frame.imu_rates)
        may_step = not frame.is_late or self._frames_of_step >= MOST_FRAMES_OF_STEP
        step = self._pass.advance(
            frame.delta, now_ms, self.state, scale=scale, height_filter_hz=get("HRT_FILT"), may_step=may_step
        )
        self._finish(frame, frame.delta, step, now_ms)

    def _finish(self, frame: Frame, delta: InertialDelta, step: InertialStep | None, now_ms: int) -> None:
        """Make the step that a frame has completed, if it has, and look what has come of it."""
        self.stepped = step is not None
        self._frames_of_step = 0 if self.stepped else self._frames_of_step + 1
        if step is not None:
            self._steps.append(step)
            flags, get = self.control.flags, self._get_float
            self._run_step(frame, now_ms, self._due())
            is_same = self.control.flags == flags and self.aiding.mode is ABSOLUTE
            self.was_idle = is_same and not (self.ingest.has_due or self._texts.waiting)
            self._pass.follow(
                delta,
                self.state,
                delay_s=1e-3 * (now_ms - self.ingest.horizon_ms & _U32),
                tau_s=limited(0.01 * get("TAU_OUTPUT"), 0.1, 0.5),
                height_filter_hz=get("HRT_FILT"),
            )
        if self.control.flags:
            self._had_flags_ms = now_ms
        else:
            self._check_stuck(frame, now_ms)
        if self._texts.waiting:
            self._texts.flush()

    def _follow_imus(self, rates: ImuRates) -> None:
        dt = self._pass.dt_ekf_avg
        changes = self._inactive.update(rates, self.state, dt)
        if changes is not None:  # what waits for the horizon is of the sensors before
            self._steps = deque((with_biases(step, *changes, dt) for step in self._steps), maxlen=self._steps.maxlen)

    def _due(self) -> InertialStep:
        step, least = self._steps[0], MIN_STEP * self._pass.dt_ekf_avg
        self.ingest.move_horizon(step.time_ms & _U32)
        if step.del_ang_dt >= least and step.del_vel_dt >= least:
            return step
        return InertialStep(
            step.time_ms, step.del_vel, step.del_ang, max(step.del_vel_dt, least), max(step.del_ang_dt, least)
        )

    def _run_step(self, frame: Frame, now_ms: int, step: InertialStep) -> None:
        get, vehicle, dt = self._get_float, self.control.vehicle, self._pass.dt_ekf_avg
        noise = self._process_noise(get)
        self.yaw.begin_step()
        aided = self.aiding.mode is not NO_AIDING
        if self.flow_ingest.received_ms is not None:
            self.flow_ingest.note_turn(self.state.turn_of(step, dt), step.del_ang_dt)
        is_still, rests = self.stillness.is_still, self.release.fuses_rest
        self.state.predict(step, noise, dt, aided=aided, on_ground=vehicle.on_ground, is_moved=rests and not is_still)
        self.gps.note_motion(self.state.rotation, step)
        self.height.terrain.constrain()
        self.yaw.by_gps.predict(step)
        self._read_sensors(frame, now_ms)
        self.yaw.step(now_ms, vehicle, step, is_still=is_still, climbed_m=self.control.climbed_m)
        # Three axes of a compass take so long that the firmware leaves the rest to the next step, once.
        self._fusion_waits = self.yaw.field_was_fused and not self._fusion_waits
        if not self._fusion_waits:
            self.delayed.recall(self.state, step, frame.lever_arm)
            if frame.gps is not None:
                self._take_gps(frame.gps, now_ms)
            self.gps.recall(self.ingest.horizon_ms)
            if frame.ranges is not None:
                self.ranges.read(frame.ranges, now_ms, on_ground=vehicle.on_ground)
            self.ranges.recall(self.ingest.horizon_ms, self.state.rotation)
            self.fusion.step(now_ms, vehicle, rests=rests and (is_still or frame.takeoff_expected))
            self.flow.step(now_ms, ground_is_datum=self.height.active == RANGE)
            if self.ingest.has_due:
                self.odometry.step(now_ms, step)
        self.yaw.correct_by_gps(now_ms, vehicle)
        self.control.update_flags(frame, now_ms)

    def _process_noise(self, get: Callable[[str], float]) -> ProcessNoise:
        densities = [get(name) for name in _NOISES]
        if self.state.accel_is_bad:
            densities[_ACCEL_NOISE] = BAD_ACCEL_NOISE
        if densities != self._densities:
            self._densities, self._noise = densities, ProcessNoise(*densities)
        return self._noise

    def _read_sensors(self, frame: Frame, now_ms: int) -> None:
        if frame.baro is not None and frame.baro[0] - self._baro_ms & _U32 > SENSOR_INTERVAL_MS:
            self._baro_ms = frame.baro[0]
            time_ms = self._baro_ms - int(self._get_float("HGT_DELAY")) - HALF_FILTER_STEP_MS
            self.height.baro.push(BaroSample(later_ms(u32(time_ms), self.ingest.horizon_ms), frame.baro[1]))
        table = frame.place_declination if self.origin is not None else None
        self.yaw.field.declination = frame.declination if table is None else table
        if frame.place_field is not None and self.origin is not None:
            self.yaw.field.use_table(frame.place_field)

    def _take_gps(self, sample: GpsSample, now_ms: int) -> None:
        innovations = self.fusion.innovations
        mag_x, mag_y, _ = self.yaw.field.ratios.tolist()
        fix = self.gps.read(
            sample,
            now_ms,
            absolute=self.aiding.mode is ABSOLUTE,
            wants_climb=self.sources.uses_vel_z(Z_GPS),
            worst_ratios=(innovations.vel_ratio, innovations.pos_ratio),
            around=GpsSurroundings(
                on_ground=self.control.vehicle.on_ground, mag_x=mag_x, mag_y=mag_y, yaw=self.yaw.ratio
            ),
        )
        if fix is not None:
            self.yaw.check_compass(now_ms, self.control.vehicle)
        if fix is not None and self.gps.checks.good and self.origin is None:
            self._set_origin_by_gps(fix.location)
        if fix is not None and self.origin is not None:
            height, is_told = self._origin_height, not self._corrects_measurements()
            reference_m = height.reference_m if is_told else CENTI * height.alt_cm
            self.gps.push(fix, self.origin, reference_m, self.ingest.horizon_ms, now_ms)

    def _set_origin_by_gps(self, place: Location) -> None:
        """Put the origin where the vehicle is, in flight at the height from which it has climbed."""
        climbed_cm = int(100.0 * self.state.down) if self.control.vehicle.in_flight else 0
        self.set_origin(Location(place.lat, place.lng, place.alt_cm + climbed_cm))
        self._origin_height.reference_m = CENTI * place.alt_cm + float(self.output.now.pos[2])
        self._origin_height.variance = self.gps.height_accuracy**2

    def _corrects_measurements(self) -> bool:
        return bool(int(self._get_float("OGN_HGT_MASK")) & IN_MEASUREMENTS)

    def _check_stuck(self, frame: Frame, now_ms: int) -> None:
        """Restart once nothing has been right for a while, on the ground."""
        if self._had_flags_ms and now_ms - self._had_flags_ms > FORCED_RESET_MS and not frame.armed:
            self._texts.add("forced reset", MAV_SEVERITY_WARNING)
            self._initialise(frame, now_ms)

    # Optical flow and the ground

    def write_flow(self, measured: FlowMeasurement) -> None:
        """Take what a flow sensor has measured, between two frames (writeOptFlowMeas)."""
        delta = self._door.delta
        if not self.initialised or delta is None:
            return
        delay_ms = int(self._get_float("FLOW_DELAY"))
        if self.flow_ingest.write(measured, delta, self._now_ms, self.ingest.horizon_ms, delay_ms):
            self.control.detect_takeoff(self._pass.gyro(), self._pass.dt_ekf_avg)

    def set_terrain_stable(self, *, is_stable: bool) -> None:
        """Hear whether heights may count from the ground (setTerrainHgtStable)."""
        if self.initialised:
            self.height.terrain_is_stable = is_stable

    # Origin and height

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once; say whether it was set (setOrigin)."""
        if self.origin is not None or (self.release.refuses_early_origin and not self.initialised):
            return False
        self.origin = origin
        if self._common.place is None:
            self._common.place = origin
        self._origin_height.put(origin.alt_cm)
        latitude = math.radians(1e-7 * origin.lat)
        if self.initialised:
            self.state.earth_rate_ned = EARTH_RATE * np.array([math.cos(latitude), 0.0, -math.sin(latitude)])
        self._texts.add("origin set")
        self._texts.flush()
        return True

    def set_place(self, place: Location, accuracy_m: float, time_ms: int) -> bool:
        """Put the vehicle somewhere while it navigates without a position; say whether it was (setLatLng).

        Args:
            place: its height counts for nothing.
            accuracy_m: not a number when unknown.
            time_ms: when it was there, since boot; up to 5 s ago.
        """
        if not self.initialised:
            return False
        age_ms = self._now_ms - self.aiding.times.pos
        if self.origin is None or self.aiding.mode is NO_AIDING or age_ms < DEAD_RECKONING_MS:
            return False
        age_of_place_ms = min(max(i32(self._now_ms - time_ms), 0), MAX_PLACE_AGE_MS)
        ahead_s = 1e-3 * (age_of_place_ms - u32(self._now_ms - self.ingest.horizon_ms))
        north, east, _ = (float(value) for value in self.origin.distance_ned(place).to_tuple())
        noise = self._get_float("POSNE_M_NSE")
        accuracy = noise if math.isnan(accuracy_m) else max(accuracy_m, noise)
        self.state.clear(POS_NE, accuracy**2)
        self.resets.shift_to(np.array([north, east, 0.0]) + ahead_s * self.state.vel, with_height=False)
        return True

    def reset_height_datum(self) -> bool:
        """Count heights from the present one, on the ground; the barometer does so too (resetHeightDatum).

        The origin takes up the difference, so that the height above the sea stays what it was; it is the GPS's where
        that is good.
        """
        if not self.initialised or not self.control.vehicle.on_ground or self.height.active == RANGE:
            return False
        if self.origin is not None:
            above_cm = self._origin_height.alt_cm + math.trunc(-100.0 * float(self.state.pos[2]))
            fix = self.fix if self.gps.checks.good else None
            self._origin_height.put(above_cm if fix is None else fix.location.alt_cm)
        self.state.pos = np.array([*self.state.pos[:2], 0.0])
        self.height.terrain.down = 0.0
        return True

    def request_yaw_reset(self) -> None:
        """Ask for yaw to be reset by the velocity of GPS, within 5 s (EKFGSF_requestYawReset)."""
        if self.initialised:
            self.yaw.by_gps.request(self._now_ms)

    @property
    def yaw_resets(self) -> int:
        """How often yaw has been set since the filter began."""
        return self.yaw.resets if self.initialised else 0

    def uses_ext_nav_for_yaw(self, now_ms: int) -> bool:
        """Return whether yaw comes from external navigation, or is assumed while it waits for that."""
        if self.initialised:
            return self.yaw.uses_ext_nav(now_ms)
        return self.sources.yaw() == YAW_EXTNAV and now_ms < YAW_IN_USE_MS

    def is_still(self) -> bool | None:
        """Return the answer of the test for standing still, None while it does not run."""
        stillness = self.stillness
        return stillness.is_still if stillness.is_tested else None

    @property
    def inertial(self) -> InertialDelta | None:
        """The inertial data of the last frame, as the filter used them; None before the first."""
        return self._door.delta

    @property
    def dt_ekf_avg(self) -> float:
        """The average interval of the steps, s."""
        return self._pass.dt_ekf_avg

    def origin_alt_cm(self) -> int:
        """Return the height of the origin above mean sea level as it is told, 0 without one (getOriginLLH).

        It has been through metres and single precision, and may so have lost a centimetre.
        """
        common = self._common.place
        if self.origin is None or common is None:
            return 0
        if self._corrects_measurements():
            return common.alt_cm
        return int(np.float32(100) * np.float32(self._origin_height.reference_m))

    def position(self) -> Array:
        """Return the present position, metres NED from the common origin as it was set (getPosNE, getPosD).

        Without aiding it is the GPS's, if that has a fix, else the last one known; nothing without an origin.
        """
        north, east, down = self.output.now.pos.tolist()
        common, is_unknown = self._common.place, self.aiding.mode is NO_AIDING
        if common is not None and self.origin is not None:
            down += CENTI * (common.alt_cm - self.origin_alt_cm())
        if is_unknown and self.origin is None:
            return np.array([0.0, 0.0, down])
        if is_unknown and common is not None and self.fix is not None and self.fix.fix_type >= _FIX_2D:
            north, east = (float(value) for value in common.distance_ned(self.fix.location).to_tuple()[:2])
        elif not is_unknown and common is not None and common is not self.origin:
            # FIRMWARE PARITY: as long as the core has no origin of its own, that is where 0 N, 0 E is.
            away = common.distance_ned(self.origin or Location(0, 0, 0)).to_tuple()
            north, east = north + float(away[0]), east + float(away[1])
        return np.array([north, east, down])

    def error_score(self) -> float:
        """Return how far the innovations are off, 1 at their gates; 0 until tilt and yaw are aligned (errorScore)."""
        if not self.is_aligned:
            return 0.0
        innovations = self.fusion.innovations
        score = max(0.5 * (innovations.vel_ratio + innovations.pos_ratio), innovations.height_ratio)
        if int(self._get_float("AFFINITY")) & AFFINITY_MAG:
            score = max(score, COMPASS_SHARE * float(self.yaw.field.ratios.sum()))
        return score

    @property
    def is_aligned(self) -> bool:
        """Whether tilt and yaw are aligned; they are not before there is a state."""
        return self.initialised and self.control.tilt_aligned and self.yaw.aligned
