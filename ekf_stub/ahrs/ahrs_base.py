# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every AHRS shares: start-up times, yaw source, origin, and a log of its inputs.

Source: AP_AHRS/AP_AHRS.cpp.
"""

from collections import Counter
from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.sources import SourceYaw
from ekf_stub.ahrs.vehicle_state import VehicleState
from ekf_stub.core.params import EkfSources
from ekf_stub.inputs.measurements import FlowMeasurement
from ekf_stub.inputs.sensors import SensorSource
from ekf_stub.log.ext_nav_log import ExtNavLog
from ekf_stub.reports import NO_LIMITS, ControlLimits, FilterStatus

AP_AHRS_NAVEKF_SETTLE_TIME_MS: Final = 20_000
ESTIMATOR_STARTUP_DELAY_US: Final = 1_000_000
# When the AHRS of the reference first wanted to run the estimator, in all recordings.
AHRS_START_US: Final = 2_455_000


class AhrsBase:
    """The part of AP_AHRS that does not depend on where the attitude comes from.

    Args:
        clock: time since boot.
        sources: the EKF's source sets.
        log: where the calls are logged.
        start_us: when the AHRS starts; the estimator starts 1 s later and counts as initialised 20 s later.

    Attributes:
        state: that of the vehicle, which the vehicle keeps up to date.
        source: the source of the sensors' data.
        primary: number of the estimator's core by which the vehicle flies.
        yaw_reset_ms: when the estimator's yaw has jumped last, 0 before the first time.
        ext_nav_counts: how many samples the estimator took, refused or fused, by kind and code of the rule
            (``ingest_rules``).
    """

    def __init__(
        self, clock: VirtualClock, sources: EkfSources, log: ExtNavLog, *, start_us: int = AHRS_START_US
    ) -> None:
        self._clock = clock
        self._sources = sources
        self._log = log
        self._start_us = start_us
        self._estimator_start_us = start_us + ESTIMATOR_STARTUP_DELAY_US
        self._origin: Location | None = None
        self.state = VehicleState()
        self.source = SensorSource()
        self.primary = self.yaw_reset_ms = 0
        self.ext_nav_counts: Counter[tuple[str, str]] = Counter()

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know of where the estimates come from, a line each."""
        return ()

    def _now_ms(self) -> int:
        # Without the wrap of the firmware's clock, see ekf_stub.core.aiding.
        return self._clock.micros64() // 1000

    def started(self) -> bool:
        """Return whether the AHRS runs, if only on its first, simple estimate (DCM)."""
        return self._clock.micros64() >= self._start_us

    def estimator_started(self) -> bool:
        """Return whether the estimator runs, for which the AHRS waits 1 s (AP_AHRS::update_EKF3)."""
        return self._clock.micros64() >= self._estimator_start_us

    def initialised(self) -> bool:
        """Return whether the AHRS has run for more than 20 s (AP_AHRS::initialised)."""
        return self.estimator_started() and self._now_ms() - self._start_us // 1000 > AP_AHRS_NAVEKF_SETTLE_TIME_MS

    def dcm_yaw_initialised(self) -> bool:
        """Return whether DCM has had a yaw reference."""
        return False

    def get_yaw_rad(self) -> np.float32:
        """Return the yaw in radians, -pi..pi."""
        return f32(0)

    def get_quaternion(self) -> Quaternion | None:
        """Return the attitude, body (FRD) to earth (NED), or None while there is none."""
        return None

    def using_extnav_for_yaw(self) -> bool:
        """Return whether yaw comes from external navigation.

        While such a yaw is configured but missing, the EKF fuses a synthetic one, which counts as well.
        Source: NavEKF3_core::using_extnav_for_yaw.
        """
        return self.estimator_started() and self._sources.yaw() == SourceYaw.EXTNAV

    def uses_gps(self) -> bool:
        """Return whether the estimator uses a GPS (AP_AHRS::using_gps)."""
        return self._sources.uses_gps()

    def origin(self) -> Location | None:
        """Return the EKF origin, or None while unset."""
        return self._origin

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once, and not before the estimator runs; return whether it was set."""
        if self._origin is not None or not self.estimator_started():
            return False
        self._origin = origin
        return True

    @property
    def runs_ahead(self) -> bool:
        """Whether ``advance`` may run several passes at once."""
        return False

    def update(self) -> None:
        """Run one frame of the estimator, once a pass of the main loop; ``state`` is that of the pass."""
        if self.estimator_started():
            self._log.frame(self.state.camera)

    def advance(self, times_us: range, due_us: Callable[[], int]) -> int:
        """Run the frames of passes, up to one at which other tasks are due, and return how many.

        The clock stands at the first one, and moves on with each.

        Args:
            times_us: of the passes, in which ``state`` stays what it is; not empty.
            due_us: returns when other tasks are due next.
        """
        self.update()
        return 1

    def log_estimates(self) -> None:
        """Log the present estimates."""

    def get_imu(self) -> tuple[Vector3f, Vector3f] | None:
        """Return what the first IMU measures: m/s/s and rad/s in the body, FRD; None without one."""
        return None

    def get_gyro(self) -> Vector3f:
        """Return the body rates in rad/s, without bias."""
        return Vector3f()

    def get_gyro_drift(self) -> Vector3f:
        """Return the estimated gyro bias in rad/s."""
        return Vector3f()

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the position in metres NED from the EKF origin, or None while there is none."""
        return None

    def get_velocity_NED(self) -> Vector3f | None:
        """Return the velocity in m/s NED, or None while there is none."""
        return None

    def get_location(self) -> Location | None:
        """Return where the vehicle is, or None without origin or position."""
        origin, position = self.origin(), self.get_relative_position_NED_origin_float()
        return None if origin is None or position is None else origin.offset(position)

    def last_location(self) -> Location | None:
        """Return where the vehicle is, or was or may be; None if nothing is known (AP_AHRS::get_location)."""
        return self.get_location()

    def get_filter_status(self) -> FilterStatus | None:
        """Return the status of the filter, or None without a filter that runs."""
        return None

    def healthy(self) -> bool:
        """Return whether the estimator runs well (AP_AHRS::healthy)."""
        return self.estimator_started()

    def reset_height_datum(self) -> bool:
        """Make the present height zero; return whether the estimator did (AP_AHRS::resetHeightDatum)."""
        return False

    def request_yaw_reset(self) -> None:
        """Ask the estimator to reset its yaw if it knows better (AP_AHRS::request_yaw_reset)."""

    def check_lane_switch(self) -> None:
        """Switch to a better core, if there is one (AP_AHRS::check_lane_switch)."""

    def handle_external_position_estimate(self, location: Location, accuracy_m: np.float32, time_ms: int) -> bool:
        """Take a position from outside, of a time in ms since boot; return whether it was used.

        Source: AP_AHRS::handle_external_position_estimate.
        """
        return False

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        """Return what keeps the vehicle from arming, the text after ``AHRS: ``, or None (AP_AHRS::pre_arm_check)."""
        return None if self.estimator_started() else "EKF3 not started"

    def write_flow(self, measured: FlowMeasurement, time_ms: int) -> None:
        """Log what a flow sensor measured at a time, then hand it to the estimator (AP_AHRS::writeOptFlowMeas).

        Args:
            measured: with the sensor's place on the vehicle, m, body (FRD).
            time_ms: since boot.
        """
        self._log.flow(measured, time_ms)

    def set_terrain_stable(self, *, is_stable: bool) -> None:
        """Set whether the ground is flat enough to measure heights from it (AP_AHRS::set_terrain_hgt_stable)."""

    def height_above_ground(self) -> float | None:
        """Return the height above the ground in m, or None while it is unknown (AP_AHRS::get_hagl)."""
        return None

    def baro_height_m(self) -> float:
        """Return the barometer's height above where it was calibrated, m (AP_Baro::get_altitude)."""
        return 0.0

    def control_limits(self) -> ControlLimits:
        """Return how fast and high the vehicle may fly (AP_AHRS::getControlLimits, AP_AHRS::get_hgt_ctrl_limit)."""
        return NO_LIMITS

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
        """Log a position and attitude sample; an estimator hands it to all cores."""
        self._log.pose(pos, quat, (posErr, angErr), timeStamp_ms, delay_ms, resetTime_ms)

    def writeExtNavVelData(self, vel: Vector3f, err: np.float32, timeStamp_ms: int, delay_ms: int) -> None:
        """Log a velocity sample; an estimator hands it to all cores."""
        self._log.velocity(vel, err, timeStamp_ms, delay_ms)

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
        """Log a body odometry sample; an estimator hands it to all cores."""
        self._log.body_odometry(quality, delPos, delAng, delTime, timeStamp_ms, delay_ms, posOffset)
