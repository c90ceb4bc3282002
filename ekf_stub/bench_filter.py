# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimator of a vehicle that stands still: it believes what EKF3 would use, as soon as EKF3 would.

FIRMWARE PARITY: there is one filter for all cores, and the times of its starting up are those of the recordings. When
aiding starts and stops, what is said of it and which flags follow is as in AP_NavEKF3/AP_NavEKF3_core.cpp and
AP_NavEKF3/AP_NavEKF3_Control.cpp.
"""

from collections import Counter, deque
from collections.abc import Callable
from typing import Final

from ap_core.cint import u32
from ap_core.clock import Clock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.aiding import AidingMode, Ready
from ekf_stub.bench_fusion import BenchFusion
from ekf_stub.bench_yaw import BenchYaw
from ekf_stub.core_texts import MAV_SEVERITY_WARNING, CoreTexts, cores_of_mask
from ekf_stub.ext_nav_ingest import ExtNavIngest, PoseSample
from ekf_stub.filter_flags import FilterState, filter_flags
from ekf_stub.filter_status import FilterFlag
from ekf_stub.gps_checks import GpsChecks
from ekf_stub.source_check import VISUAL_ODOM
from ekf_stub.sources import EkfSources, SourceXY, SourceYaw, SourceZ
from ekf_stub.surroundings import Surroundings

BOOTSTRAP_US: Final = 1_000_000
HEALTHY_AFTER_MS: Final = 1000
# Of a level bench, after initialisation; the recordings have 0.57 to 1.5 s.
TILT_ALIGNED_AFTER_US: Final = 1_322_500
# Of a bench with a compass; other sources differ, but none was recorded.
GYRO_BIAS_LEARNED_AFTER_US: Final = 40_500_000
EKF_STEP_US: Final = 12_500
ODOMETRY_FRESH_MS: Final = 200
ODOMETRY_IN_USE_MS: Final = 5000
MAX_ODOMETRY_ERR: Final = f32(1)
POSITION_IN_USE_MS: Final = 1000

_EARLIEST_STEP_US: Final = 10_750  # EKF_TARGET_DT less half a pass of the main loop


class BenchFilter:
    """Starts, aligns, steps, and chooses how to navigate.

    Args:
        clock: time since boot.
        sources: the source sets.
        around: the vehicle around it.
        counts: what became of how many samples, by kind and code of the rule.
        yaw: where yaw comes from.
        origin: returns the EKF origin.

    Attributes:
        active: whether the AHRS may use it: it has a state, and has run for a frame since.
        has_cores: whether there is any core.
        flags: its status.
        ingest: where samples are handed in.
        gps: what it thinks of the GPS.
    """

    def __init__(
        self,
        clock: Clock,
        sources: EkfSources,
        around: Surroundings,
        counts: Counter[tuple[str, str]],
        yaw: BenchYaw,
        origin: Callable[[], Location | None],
    ) -> None:
        self._clock = clock
        self._sources = sources
        self._around = around
        self._yaw = yaw
        self._origin = origin
        self.ingest = ExtNavIngest(counts, around.get_float)
        self.gps = GpsChecks()
        self._fusion = BenchFusion(clock, sources, self.ingest, self.gps, yaw, origin, around.gps)
        self._aiding = self._fusion.aiding
        self._texts = CoreTexts(around.texts, ())
        self._horizon: deque[int] = deque()
        self._set_up_us: int | None = None
        self._init_us = self._last_step_us = 0
        self._init_ms = 0
        self._tilt_aligned = self._yaw_was_reset = False
        self.active = False
        self.has_cores = False
        self.flags = FilterFlag.UNINITIALISED

    @property
    def mode(self) -> AidingMode:
        """How it navigates."""
        return self._aiding.mode

    @property
    def position(self) -> Vector3f:
        """Metres NED from the origin."""
        return self._fusion.position

    @property
    def velocity(self) -> Vector3f:
        """Metres a second NED."""
        return self._fusion.velocity

    def healthy(self) -> bool:
        """Tell whether it has run for a second (NavEKF3_core::healthy)."""
        return self.ingest.initialised and u32(self._clock.millis() - self._init_ms) >= HEALTHY_AFTER_MS

    def failure_reason(self) -> str | None:
        """Return why it is not healthy, None when nothing is known against it (prearm_failure_reason)."""
        return None if self.gps.good else self.gps.reason or "EKF3 still initialising"

    def update(self) -> None:
        """Run one frame (NavEKF3::InitialiseFilter, then NavEKF3_core::UpdateFilter)."""
        now_us = self._clock.micros64()
        if self._set_up_us is None:
            self._set_up(now_us)
        elif self.ingest.initialised:
            self.active = True
            self._control(now_us)
            if now_us - self._last_step_us >= _EARLIEST_STEP_US:
                self._last_step_us = now_us
                self._step()
        elif self.has_cores and now_us - self._set_up_us >= BOOTSTRAP_US:
            self._initialise(now_us)
        self._texts.flush()
        if self._yaw_was_reset:
            self._yaw_was_reset = False
            self._around.on_yaw_reset()

    def _set_up(self, now_us: int) -> None:
        # NavEKF3_core::setup_core: what later changes of parameters do not change until the next boot.
        self._set_up_us = now_us
        cores = cores_of_mask(self._around.imu_mask())
        self.has_cores = bool(cores)
        self._texts = CoreTexts(self._around.texts, cores)
        if cores:
            sizes = self._around.buffer_sizes(self._sources, has_camera=self._around.is_fitted(VISUAL_ODOM))
            self._horizon = deque(maxlen=sizes.imu)
            self.ingest.set_up(sizes if self._sources.ext_nav_enabled() else None)

    def _initialise(self, now_us: int) -> None:
        self.ingest.reset()
        self.ingest.initialised = True
        self._init_us = self._last_step_us = now_us
        self._init_ms = self._clock.millis()
        self._aiding.times.height = self._aiding.times.pos = self._init_ms
        for steps_ago in reversed(range(self._horizon.maxlen or 0)):
            self._horizon.append(u32((now_us - steps_ago * EKF_STEP_US) // 1000))
        self.ingest.horizon_ms = self._horizon[0]
        self._texts.add("initialised")

    # Every frame

    def _control(self, now_us: int) -> None:
        since_us = now_us - self._init_us
        # In no recording does a sample that is already there start aiding in the very frame.
        if not self._tilt_aligned and since_us >= TILT_ALIGNED_AFTER_US and self._fusion.pose is None:
            self._tilt_aligned = True
            self._texts.add("tilt alignment complete")
        self._yaw.check_source()
        no_yaw_on_ground = self._yaw.source() == SourceYaw.NONE and not self._around.is_armed()
        if no_yaw_on_ground and self.mode is not AidingMode.NONE:
            self._yaw.aligned = False
        ready = self._ready(gyro_bias_learned=since_us >= GYRO_BIAS_LEARNED_AFTER_US)
        if self._aiding.update(self._clock.millis(), ready, no_yaw_on_ground=no_yaw_on_ground):
            self._enter_mode(ready)

    def _ready(self, *, gyro_bias_learned: bool) -> Ready:
        source = self._sources.pos_xy()
        gps = gyro_bias_learned and self._yaw.aligned and self.gps.good and self._fusion.fix is not None
        return Ready(
            gps=self._tilt_aligned and source == SourceXY.GPS and gps and self._origin() is not None,
            ext_nav=self._tilt_aligned and source == SourceXY.EXTNAV and self._fusion.pose is not None,
            odometry=self._tilt_aligned and gyro_bias_learned and self._odometry_is_good(),
        )

    def _odometry_is_good(self) -> bool:
        fresh = u32(self._clock.millis() - self.ingest.odometry_ms) < ODOMETRY_FRESH_MS
        exact = bool(self.ingest.odometry_err < MAX_ODOMETRY_ERR)
        return fresh and exact and self._sources.uses_vel_xy(SourceXY.EXTNAV)

    def _enter_mode(self, ready: Ready) -> None:
        fusion = self._fusion
        fusion.keeps_velocity = False
        if self.mode is AidingMode.NONE:
            self._texts.add("stopped aiding", MAV_SEVERITY_WARNING)
            fusion.fuses_odometry = False
            self.reset_height()
        elif self.mode is AidingMode.RELATIVE:
            self._texts.add("started relative aiding")
        elif ready.gps or fusion.pose is None:
            self._texts.add("is using GPS")
        else:
            self._start_by_ext_nav(fusion.pose)
        if self.mode is not AidingMode.ABSOLUTE:
            fusion.velocity = Vector3f()

    def _start_by_ext_nav(self, pose: PoseSample) -> None:
        self._texts.add("is using external nav data")
        self._texts.add("initial pos NED = {:3.1f},{:3.1f},{:3.1f} (m)".format(*pose.pos.to_tuple()))
        self._fusion.move(pose.pos)
        if self.ingest.have_velocity:
            vel = self._fusion.last_velocity
            self._texts.add("initial vel NED = {:3.1f},{:3.1f},{:3.1f} (m/s)".format(*vel.to_tuple()))
            self._fusion.set_velocity(Vector3f(vel.x, vel.y, 0))

    # Every step

    def _step(self) -> None:
        self._horizon.append(self._clock.millis())
        self.ingest.horizon_ms = self._horizon[0]
        if self._yaw.step(self.ingest.recall_yaw(), self.gps.newest, self._tilt_aligned):
            self._texts.add(self._yaw.aligned_text())
            self._yaw_was_reset = True
        self._fusion.step()
        if self._fusion.step_odometry():
            self._texts.add("fusing odometry")
        self.flags = self._make_flags()

    def _make_flags(self) -> FilterFlag:
        odometry_ms = u32(self._clock.millis() - self._aiding.times.odometry)
        return filter_flags(
            FilterState(
                healthy=self.healthy(),
                tilt_aligned=self._tilt_aligned,
                yaw_aligned=self._yaw.aligned,
                uses_compass=self._yaw.uses_compass(),
                mode=self.mode,
                pos_timeout=self._aiding.pos_timeout,
                vel_timeout=self._aiding.vel_timeout,
                height_timeout=self._fusion.height_timeout,
                has_vertical_velocity=self.ingest.have_velocity,
                odometry_in_use=odometry_ms < ODOMETRY_IN_USE_MS,
                keeps_velocity=self._fusion.keeps_velocity,
                height_needs_origin=self._sources.pos_z() == SourceZ.GPS and self._origin() is None,
            )
        )

    # What may be asked of it

    def reset_height(self) -> None:
        """Let heights count from the present one."""
        self._fusion.reset_height()

    def set_position(self, way: Vector3f) -> bool:
        """Put the vehicle somewhere, metres NED from the origin; tell whether it was (setLatLng).

        Refused while any position is in use, and without aiding.
        """
        in_use = u32(self._clock.millis() - self._aiding.times.pos) < POSITION_IN_USE_MS
        if in_use or self.mode is AidingMode.NONE:
            return False
        self._fusion.move(Vector3f(way.x, way.y, self.position.z))
        return True
