# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When yaw is taken from the velocity of GPS (AP_NavEKF3_MagFusion.cpp, realignYawGPS, EKFGSF_resetMainFilterYaw).

Source too: AP_NavEKF3_Control.cpp (runYawEstimatorPrediction, runYawEstimatorCorrection), AP_NavEKF3_VehicleStatus.cpp
(detectFlight).
"""

import math
from typing import Final, NamedTuple

from ekf_stub.filter.inertial import InertialStep, limited
from ekf_stub.fusion.aiding import ABSOLUTE
from ekf_stub.fusion.gsf_yaw import GsfYaw
from ekf_stub.fusion.height_source import Vehicle
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.inputs.sources import XY_GPS

MAX_VARIANCE: Final = math.radians(15.0) ** 2
MAX_INNOVATION_M_S: Final = 2.0
STEADY: Final = 5
REQUEST_MS: Final = 5000
MIN_SPEED_M_S: Final = 1.0
BAD_YAW: Final = 0.7854


class Course(NamedTuple):
    """The direction in which GPS says that the vehicle moves, rad, and its variance.

    ``is_steady`` says whether it has been exact for long enough; ``disagrees`` whether the filter moves or points
    elsewhere.
    """

    yaw: float
    variance: float
    is_steady: bool
    disagrees: bool


class GpsYaw(Fusion):
    """Runs the GSF while the vehicle flies by GPS, and says what yaw GPS shows."""

    def __init__(self, parts: FilterParts) -> None:
        super().__init__(parts)
        self._gsf = GsfYaw(parts.release)
        self._core_bit = 1 << parts.core  # of the masks
        self.report = self._gsf.report
        self._exists: bool | None = None
        self._runs = False
        self._was_on_ground = True
        self._valid = self._course_valid = self._emergencies = 0
        self._requested_ms = 0

    def follow_flight(self, vehicle: Vehicle, *, takeoff_expected: bool, dt_ekf_avg: float) -> None:
        """Let velocity be fused from take-off on, while GPS tells it well, until the vehicle is disarmed."""
        has_landed = vehicle.on_ground and not self._was_on_ground
        self._was_on_ground = vehicle.on_ground
        if has_landed or not self._gps.speed_good:
            self._runs = False
        elif not self._runs and (vehicle.in_flight or takeoff_expected) and self._is_there():
            self._runs = True
            self._valid = self._emergencies = self._requested_ms = 0
            self._gsf.gyro_bias, _ = self._state.bias_rates(dt_ekf_avg)

    def _is_there(self) -> bool:
        if self._exists is None:
            self._exists = bool(int(self._get_float("GSF_RUN_MASK")) & self._core_bit)
        return self._exists

    def _uses_gps(self) -> bool:
        return self._sources.pos_xy() == XY_GPS and self._sources.uses_vel_xy(XY_GPS) and self._is_there()

    def predict(self, step: InertialStep) -> None:
        """Follow the inertial data of a step."""
        if self._uses_gps():
            self._gsf.predict(step, may_run=self._runs)

    def fuse(self) -> None:
        """Fuse the velocity that has come due, after the filter has."""
        if not self._runs:
            self._valid = 0
        elif self._gps.is_due and self._gps.delayed is not None and self._uses_gps():
            north, east, _ = self._gps.delayed.vel.tolist()
            self._gsf.fuse(north, east, self._accuracy())
            self._valid = 0 if self.estimate() is None else min(self._valid + 1, STEADY)

    def _accuracy(self) -> float:
        return max(self._gps.speed_accuracy, self._get_float("VELNE_M_NSE"))

    @property
    def is_steady(self) -> bool:
        """Whether the GSF has known yaw for long enough."""
        return self._valid >= STEADY

    def estimate(self) -> tuple[float, float] | None:
        """Return yaw by the GSF in rad and its variance; None while it knows too little (EKFGSF_getYaw)."""
        if not self._gsf.is_running:
            return None
        yaw, variance = self._gsf.estimate()
        is_exact = 0 < variance < MAX_VARIANCE and self._gsf.innovation_length() < MAX_INNOVATION_M_S
        return (yaw, variance) if is_exact else None

    def request(self, now_ms: int) -> None:
        """Ask for an emergency reset, within 5 s (EKFGSF_requestYawReset)."""
        self._requested_ms = now_ms

    def emergency(self, now_ms: int) -> bool:
        """Return whether an emergency reset is asked for, and there may still be one in this flight."""
        is_asked_for = self._runs and self._requested_ms > 0 and now_ms - self._requested_ms < REQUEST_MS
        return is_asked_for and self._emergencies < self._get_float("GSF_RST_MAX") and self._uses_gps()

    def for_reset(self) -> tuple[float, float] | None:
        """Return what to reset yaw to and its variance, and note it; None if the GSF may not or cannot say."""
        if not self._is_there() or not int(self._get_float("GSF_USE_MASK")) & self._core_bit:
            return None
        estimate = self.estimate()
        if estimate is not None:
            self._requested_ms = 0
            self._emergencies += 1
        return estimate

    def course(self, worst_ratio: float) -> Course | None:
        """Return where the vehicle goes by GPS, in a step in which yaw is wanted; None while it is too slow.

        ``worst_ratio`` is that of the innovation of velocity to its gate, squared.
        """
        fix = self._gps.delayed
        speed = 0.0 if fix is None else math.hypot(*fix.vel[:2].tolist())
        if fix is None or speed <= MIN_SPEED_M_S:
            self._course_valid = 0
            return None
        course = math.atan2(fix.vel[1], fix.vel[0])
        others = math.atan2(self._state.vel[1], self._state.vel[0]), self._state.yaw(by_321=True)
        apart = max(abs(math.remainder(course - other, 2 * math.pi)) for other in others)
        variance = math.asin(limited(self._accuracy() / speed, -1.0, 1.0)) ** 2
        self._course_valid = self._course_valid + 1 if variance < MAX_VARIANCE else 0
        disagrees = apart > BAD_YAW and worst_ratio > 1 and self._aiding.mode is ABSOLUTE
        return Course(course, variance, self._course_valid >= STEADY, disagrees)

    def forget_course(self) -> None:
        """Restart the count of how long the course has been exact."""
        self._course_valid = 0
