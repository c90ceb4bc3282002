# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One core of EKF3: frames in, estimates out (AP_NavEKF3/AP_NavEKF3_core.cpp, UpdateFilter).

GPS, optical flow, airspeed and wind are not fused; external navigation, barometer and compass are.
"""

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.cint import u32
from ekf_stub.aiding import Aiding, AidingMode, Ready
from ekf_stub.core_texts import MAV_SEVERITY_WARNING, CoreTexts
from ekf_stub.error_state import ErrorState, ProcessNoise, quat_of_euler
from ekf_stub.ext_nav_ingest import HALF_FILTER_STEP_MS, ExtNavIngest
from ekf_stub.filter_flags import FilterState, filter_flags
from ekf_stub.filter_status import FilterFlag
from ekf_stub.inertial import Array, DownSampler, InertialDelta, InertialStep, limited
from ekf_stub.measurements import BaroSample, Delayed, MagSample
from ekf_stub.obs_ring import RingSizes
from ekf_stub.output_predictor import OutputPredictor
from ekf_stub.resets import Resets
from ekf_stub.sources import EkfSources, SourceXY, SourceYaw
from ekf_stub.vel_pos_fusion import Vehicle, VelPosFusion
from ekf_stub.yaw_fusion import YawFusion

BOOTSTRAP_MS: Final = 1000
HEALTHY_AFTER_MS: Final = 1000
SENSOR_INTERVAL_MS: Final = 50
MAG_DELAY_MS: Final = 60
TILT_ALIGNED_VAR: Final = math.radians(5.0) ** 2
IN_FLIGHT_CLIMB_M: Final = 1.5
FLYING_MS: Final = 5000
USING_POSITION_MS: Final = 4000
MAX_STILL_INNOVATION_M: Final = 1.0
ACCEL_FILTER: Final = 0.15  # of 10 Hz at 400 Hz
_LOOP_DT: Final = 0.0025


@dataclass(frozen=True, slots=True)
class Frame:
    """What the filter is given in a frame.

    ``baro`` is (time of its last update in ms, height in m), ``mag`` (time in us, field in mGauss, body); None when
    there is none. ``lever_arm`` is the camera's place from the IMU in m, body.
    """

    time_us: int
    delta: InertialDelta
    armed: bool = False
    flying_ms: int = 0
    takeoff_expected: bool = False
    touchdown_expected: bool = False
    baro: tuple[int, float] | None = None
    mag: tuple[int, Array] | None = None
    declination: float = 0.0
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Ekf3Core:
    """The filter, from its first inertial data on.

    Args:
        sources: the source sets.
        get_float: returns a parameter by its name after ``EK3_``.
        sizes: lengths of the buffers.
        texts: what the ground station is told.
        counts: what became of samples of external navigation.
        has_compass: tells whether a compass is in use.

    Attributes:
        ingest: where external navigation is handed in.
        initialised: it has a state.
    """

    def __init__(
        self,
        sources: EkfSources,
        get_float: Callable[[str], float],
        sizes: RingSizes,
        texts: CoreTexts,
        counts: Counter[tuple[str, str]],
        has_compass: Callable[[], bool],
    ) -> None:
        self._sources = sources
        self._get_float = get_float
        self._sizes = sizes
        self._texts = texts
        self._has_compass = has_compass
        self.ingest = ExtNavIngest(counts, lambda name: np.float32(get_float(name.removeprefix("EK3_"))))
        self.ingest.set_up(sizes if sources.ext_nav_enabled() else None)
        self._sampler = DownSampler()
        self._first_ms: int | None = None
        self._accel: Array | None = None
        self._steps: deque[InertialStep] = deque(maxlen=sizes.imu)
        self._baro_ms = self._mag_us = 0
        self._origin_alt_cm: int | None = None
        self._public_alt_cm = 0
        self.initialised = False

    def _initialise(self, now_ms: int) -> None:
        accel = self._accel if self._accel is not None else np.array([0.0, 0.0, -1.0])
        accel = accel / max(float(np.linalg.norm(accel)), 1e-3)
        quat = quat_of_euler(math.atan2(-accel[1], -accel[2]), math.asin(limited(accel[0], -1.0, 1.0)), 0.0)
        get = self._get_float
        variances = np.array([get("VELNE_M_NSE")] * 2 + [get("VELD_M_NSE")] + [get("POSNE_M_NSE")] * 2) ** 2
        self.state = ErrorState(quat, np.append(variances, get("ALT_M_NSE") ** 2))
        self.output = OutputPredictor(self.state, self._sizes.imu)
        self.aiding = Aiding()
        self.aiding.times.pos = self.aiding.times.vel = self.aiding.times.height = now_ms
        self.delayed = Delayed(self.ingest)
        self.resets = Resets(self.state, self.output, self.aiding, self._sources, self.delayed, get)
        self.fusion = VelPosFusion(
            self.state, self.resets, self.aiding, self._sources, self.delayed, self.ingest, get, self._sizes.slow
        )
        self.yaw = YawFusion(
            self.state, self.output, self._sources, self.ingest, self._texts, get, self._has_compass, self._sizes.slow
        )
        self._sampler = DownSampler()
        self._steps.clear()
        self._initialised_ms = now_ms
        self._vehicle = Vehicle(armed=False, on_ground=True, in_flight=False)
        self._down_on_ground = 0.0
        self.tilt_aligned = False
        self.flags = 0
        self.ingest.reset()
        self.ingest.initialised = self.initialised = True
        self._texts.add("initialised")

    def run(self, frame: Frame) -> None:
        """Run one frame."""
        now_ms = frame.time_us // 1000
        if not self.initialised:
            self._bootstrap(frame, now_ms)
        if not self.initialised:
            return
        ready = len(self._steps) == self._sizes.imu
        if ready:
            self._control(frame, now_ms)
        self._read_sensors(frame, now_ms)
        step = self._sampler.add(frame.delta, _LOOP_DT, now_ms)
        if step is not None:
            self._steps.append(step)
            self.ingest.horizon_ms = self._steps[0].time_ms
            if len(self._steps) == self._sizes.imu:
                self._run_step(frame, now_ms)
        self._predict_output(frame, now_ms, is_step=step is not None)
        self._texts.flush()

    def _bootstrap(self, frame: Frame, now_ms: int) -> None:
        if frame.delta.del_vel_dt > 0:
            accel = frame.delta.del_vel / frame.delta.del_vel_dt
            self._accel = accel if self._accel is None else self._accel + ACCEL_FILTER * (accel - self._accel)
        if self._first_ms is None:
            self._first_ms = now_ms
        elif now_ms - self._first_ms >= BOOTSTRAP_MS:
            self._initialise(now_ms)

    # Origin and height

    def set_origin(self, alt_cm: int) -> bool:
        """Set the origin, cm above mean sea level, once; tell whether it was set (setOrigin)."""
        if self._origin_alt_cm is not None:
            return False
        self._origin_alt_cm = self._public_alt_cm = alt_cm
        self._texts.add("origin set")
        self._texts.flush()
        return True

    def reset_height_datum(self) -> bool:
        """Count heights from the present one, on the ground; the barometer does so too (resetHeightDatum).

        The origin takes up the difference, so that the height above the sea stays what it was.
        """
        if not self.initialised or not self._vehicle.on_ground:
            return False
        if self._origin_alt_cm is not None:
            self._origin_alt_cm += math.trunc(-100.0 * float(self.state.pos[2]))
        self.state.pos = np.array([*self.state.pos[:2], 0.0])
        return True

    def position(self) -> Array:
        """Return the present position, metres NED from the origin as it was set (getPosNE, getPosD)."""
        if self._origin_alt_cm is None and self.aiding.mode is AidingMode.NONE:
            return np.array([0.0, 0.0, self.output.now.pos[2]])
        origin_alt_cm = self._public_alt_cm if self._origin_alt_cm is None else self._origin_alt_cm
        north, east, down = self.output.now.pos
        return np.array([north, east, down + 0.01 * (self._public_alt_cm - origin_alt_cm)])

    # Every frame

    def _control(self, frame: Frame, now_ms: int) -> None:
        """Find out what the vehicle is about, and choose how to navigate (controlFilterModes)."""
        self._detect_flight(frame)
        if not self.tilt_aligned and self.state.predicted_tilt_variance < TILT_ALIGNED_VAR:
            self.tilt_aligned = True
            self.state.learn_biases(self._get_float("ACC_BIAS_LIM"), self._sampler.dt_ekf_avg)
            self._texts.add("tilt alignment complete")
        self.yaw.check_source()
        no_yaw = self.yaw.source() == SourceYaw.NONE and not frame.armed
        if no_yaw and self.aiding.mode is not AidingMode.NONE:
            self.yaw.aligned = False
        by_ext_nav = self._sources.pos_xy() == SourceXY.EXTNAV and self.tilt_aligned and self.delayed.has_pose
        if self.aiding.update(now_ms, Ready(gps=False, ext_nav=by_ext_nav, odometry=False), no_yaw_on_ground=no_yaw):
            self._enter_mode(now_ms)

    def _detect_flight(self, frame: Frame) -> None:
        down = float(self.state.pos[2])
        if not frame.armed:
            self._down_on_ground = down
        in_flight = frame.armed and (
            self._vehicle.in_flight or self._climbed_m() > IN_FLIGHT_CLIMB_M or frame.flying_ms > FLYING_MS
        )
        self._vehicle = Vehicle(frame.armed, on_ground=not frame.armed, in_flight=in_flight)

    def _climbed_m(self) -> float:
        return self._down_on_ground - float(self.state.pos[2])

    def _enter_mode(self, now_ms: int) -> None:
        pose, velocity = self.delayed.pose, self.delayed.velocity
        by_velocity = self.ingest.have_velocity
        if self.aiding.mode is AidingMode.NONE:
            self._texts.add("stopped aiding", MAV_SEVERITY_WARNING)
            self.fusion.innovations.vel_ratio = self.fusion.innovations.pos_ratio = 0.0
            self.resets.last_known_ne = self.state.pos[:2].copy()
            self.state.pos = np.array([*self.state.pos[:2], -self.fusion.baro_height])
            by_velocity = False
        elif pose is not None:
            self._texts.add("is using external nav data")
            self._texts.add("initial pos NED = {:3.1f},{:3.1f},{:3.1f} (m)".format(*pose.pos))
            if by_velocity:
                vel = np.zeros(3) if velocity is None else velocity.vel
                self._texts.add("initial vel NED = {:3.1f},{:3.1f},{:3.1f} (m/s)".format(*vel))
            self.fusion.reset_height_to_pose(now_ms, self._vehicle)
        vel_timeout = self.aiding.vel_timeout
        self.resets.velocity(now_ms, by_ext_nav=by_velocity)
        self.resets.position(now_ms)
        self.aiding.vel_timeout = vel_timeout

    def _read_sensors(self, frame: Frame, now_ms: int) -> None:
        if frame.baro is not None and u32(frame.baro[0] - self._baro_ms) > SENSOR_INTERVAL_MS:
            self._baro_ms = frame.baro[0]
            time_ms = self._baro_ms - int(self._get_float("HGT_DELAY")) - HALF_FILTER_STEP_MS
            self.fusion.baro.push(BaroSample(max(time_ms, self.ingest.horizon_ms), frame.baro[1]))
        self.yaw.declination = frame.declination
        if frame.mag is not None and frame.mag[0] - self._mag_us > 1000 * SENSOR_INTERVAL_MS:
            self._mag_us = frame.mag[0]
            self.yaw.mag.push(MagSample(now_ms - MAG_DELAY_MS - HALF_FILTER_STEP_MS, 0.001 * frame.mag[1]))

    # Every step

    def _run_step(self, frame: Frame, now_ms: int) -> None:
        step = self._steps[0]
        get = self._get_float
        noise = ProcessNoise(get("GYRO_P_NSE"), get("ACC_P_NSE"), get("GBIAS_P_NSE"), get("ABIAS_P_NSE"))
        aided = self.aiding.mode is not AidingMode.NONE
        self.state.predict(step, noise, self._sampler.dt_ekf_avg, aided=aided, on_ground=self._vehicle.on_ground)
        self.yaw.step(
            now_ms, self._vehicle, tilt_aligned=self.tilt_aligned, moves=frame.armed, climbed_m=self._climbed_m()
        )
        self.delayed.recall(self.state, step.del_ang / step.del_ang_dt, np.array(frame.lever_arm))
        self.fusion.step(now_ms, self._vehicle)
        self.flags = self._make_flags(frame, now_ms)

    def healthy(self, now_ms: int) -> bool:
        """Tell whether nothing is wrong with it (NavEKF3_core::healthy)."""
        innovations = self.fusion.innovations
        if min(innovations.vel_ratio, innovations.pos_ratio, innovations.height_ratio) > 1:
            return False
        drifts = float(np.hypot(*innovations.pos[:2])) > MAX_STILL_INNOVATION_M
        standing = self._vehicle.on_ground and self.aiding.mode is AidingMode.NONE
        return u32(now_ms - self._initialised_ms) >= HEALTHY_AFTER_MS and not (standing and drifts)

    def _make_flags(self, frame: Frame, now_ms: int) -> int:
        """Return nav_filter_status, those of EKF_STATUS_REPORT and beyond (updateFilterStatus)."""
        healthy = self.healthy(now_ms)
        aiding = self.aiding
        flags = filter_flags(
            FilterState(
                healthy=healthy,
                tilt_aligned=self.tilt_aligned,
                yaw_aligned=self.yaw.aligned,
                uses_compass=self.yaw.uses_compass(),
                mode=aiding.mode,
                pos_timeout=aiding.pos_timeout,
                vel_timeout=aiding.vel_timeout,
                height_timeout=self.fusion.height_timeout,
                has_vertical_velocity=self.ingest.have_velocity,
                odometry_in_use=False,
                keeps_velocity=self.ingest.have_velocity,
            )
        )
        value = int(flags & ~FilterFlag.UNINITIALISED)
        value |= frame.takeoff_expected << 11 | frame.touchdown_expected << 12
        in_use = u32(now_ms - aiding.times.pos) < USING_POSITION_MS and aiding.mode is AidingMode.ABSOLUTE
        return value | in_use << 13 | healthy << 16

    def timeouts(self, now_ms: int) -> int:
        """Return the bits of XKF4.TS; airspeed and drag are always lost, the latter 5 s after boot."""
        aiding = self.aiding
        drag = now_ms > 5000
        return aiding.pos_timeout | aiding.vel_timeout << 1 | self.fusion.height_timeout << 2 | 1 << 4 | drag << 5

    def _predict_output(self, frame: Frame, now_ms: int, *, is_step: bool) -> None:
        sampler = self._sampler
        self.output.integrate(frame.delta, self.state, sampler.dt_ekf_avg)
        if is_step and len(self._steps) == self._sizes.imu:
            self.output.follow(
                self.state,
                delay_s=1e-3 * (now_ms - self.ingest.horizon_ms),
                tau_s=limited(0.01 * self._get_float("TAU_OUTPUT"), 0.1, 0.5),
                dt_imu_avg=sampler.dt_imu_avg,
                dt_ekf_avg=sampler.dt_ekf_avg,
            )
