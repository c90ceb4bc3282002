# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When yaw is taken from the velocity of GPS (AP_NavEKF3_MagFusion.cpp, realignYawGPS, EKFGSF_resetMainFilterYaw).

Source too: AP_NavEKF3_Control.cpp (runYawEstimatorPrediction, runYawEstimatorCorrection), AP_NavEKF3_VehicleStatus.cpp
(detectFlight).
"""

import math
from typing import Final, final

from ekf_stub.core.aiding import ABSOLUTE, Aiding, Vehicle
from ekf_stub.core.gps import Gps
from ekf_stub.core.gsf import GsfYaw
from ekf_stub.core.inertial import Inertial
from ekf_stub.core.params import GPS, EkfSources, Params
from ekf_stub.core.state import State
from ekf_stub.core.vectors import Vec2, larger, length2, limited, scaled, square, wrap_pi

_MAX_VARIANCE: Final = math.radians(15.0) ** 2
_MAX_INNOVATION_M_S: Final = 2.0
_STEADY: Final = 5
_REQUEST_MS: Final = 5000
_MIN_SPEED_M_S: Final = 1.0
_BAD_YAW: Final = 0.7854


@final
class Course:
    """The direction in which GPS says that the vehicle moves, rad, and its variance.

    ``is_steady`` says whether it has been exact for long enough; ``disagrees`` whether the filter moves or points
    elsewhere.
    """

    def __init__(self, yaw: float, variance: float, is_steady: bool, disagrees: bool) -> None:
        self.yaw = yaw
        self.variance = variance
        self.is_steady = is_steady
        self.disagrees = disagrees


@final
class GpsYaw:
    """Runs the GSF while the vehicle flies by GPS, and says what yaw GPS shows.

    ``core`` is the core's number, ``gsf`` the estimator.
    """

    def __init__(
        self, params: Params, state: State, aiding: Aiding, sources: EkfSources, gps: Gps, asks_load: bool, core: int
    ) -> None:
        self._params = params
        self._state = state
        self._aiding = aiding
        self._sources = sources
        self._gps = gps
        self.gsf = GsfYaw(asks_load)
        self._core_bit = 1 << core  # of the masks
        self._is_looked_up = False
        self._exists = False
        self._runs = False
        self._was_on_ground = True
        self._valid = 0
        self._course_valid = 0
        self._emergencies = 0
        self._requested_ms = 0

    def follow_flight(self, vehicle: Vehicle, takeoff_expected: bool, dt_ekf_avg: float) -> None:
        """Let velocity be fused from take-off on, while GPS tells it well, until the vehicle is disarmed."""
        has_landed = vehicle.on_ground and not self._was_on_ground
        self._was_on_ground = vehicle.on_ground
        if has_landed or not self._gps.speed_good:
            self._runs = False
        elif not self._runs and (vehicle.in_flight or takeoff_expected) and self._is_there():
            self._runs = True
            self._valid = 0
            self._emergencies = 0
            self._requested_ms = 0
            self.gsf.gyro_bias = scaled(self._state.gyro_bias, 1.0 / dt_ekf_avg)

    def _is_there(self) -> bool:
        if not self._is_looked_up:
            self._is_looked_up = True
            self._exists = int(self._params.GSF_RUN_MASK) & self._core_bit != 0
        return self._exists

    def _uses_gps(self) -> bool:
        return self._sources.pos_xy() == GPS and self._sources.uses_vel_xy(GPS) and self._is_there()

    def predict(self, step: Inertial) -> None:
        """Follow the inertial data of a step."""
        if self._uses_gps():
            self.gsf.predict(step, self._runs)

    def fuse(self) -> None:
        """Fuse the velocity that has come due, after the filter has."""
        delayed = self._gps.delayed
        if not self._runs:
            self._valid = 0
        elif self._gps.is_due and delayed is not None and self._uses_gps():
            self.gsf.fuse(delayed.vel[0], delayed.vel[1], self._accuracy())
            self._valid = min(self._valid + 1, _STEADY) if self.has_estimate() else 0

    def _accuracy(self) -> float:
        return larger(self._gps.speed_accuracy, self._params.VELNE_M_NSE)

    @property
    def is_steady(self) -> bool:
        """Whether the GSF has known yaw for long enough."""
        return self._valid >= _STEADY

    def has_estimate(self) -> bool:
        """Return whether the GSF knows enough of yaw (EKFGSF_getYaw)."""
        if not self.gsf.is_running:
            return False
        variance = self.gsf.estimate()[1]
        return 0 < variance < _MAX_VARIANCE and self.gsf.innovation_length() < _MAX_INNOVATION_M_S

    def request(self, now_ms: int) -> None:
        """Ask for an emergency reset, within 5 s (EKFGSF_requestYawReset)."""
        self._requested_ms = now_ms

    def emergency(self, now_ms: int) -> bool:
        """Return whether an emergency reset is asked for, and there may still be one in this flight."""
        is_asked_for = self._runs and self._requested_ms > 0 and now_ms - self._requested_ms < _REQUEST_MS
        return is_asked_for and self._emergencies < self._params.GSF_RST_MAX and self._uses_gps()

    def take_for_reset(self) -> Vec2 | None:
        """Return what to reset yaw to and its variance, and note it; None if the GSF may not or cannot say."""
        if not self._is_there() or not int(self._params.GSF_USE_MASK) & self._core_bit or not self.has_estimate():
            return None
        self._requested_ms = 0
        self._emergencies += 1
        return self.gsf.estimate()

    def course(self, worst_ratio: float) -> Course | None:
        """Return where the vehicle goes by GPS, in a step in which yaw is wanted; None while it is too slow.

        ``worst_ratio`` is that of the innovation of velocity to its gate, squared.
        """
        fix, state = self._gps.delayed, self._state
        speed = 0.0 if fix is None else length2(fix.vel[0], fix.vel[1])
        if fix is None or speed <= _MIN_SPEED_M_S:
            self._course_valid = 0
            return None
        course = math.atan2(fix.vel[1], fix.vel[0])
        apart = larger(
            abs(wrap_pi(course - math.atan2(state.vel[1], state.vel[0]))), abs(wrap_pi(course - state.yaw(True)))
        )
        variance = square(math.asin(limited(self._accuracy() / speed, -1.0, 1.0)))
        self._course_valid = self._course_valid + 1 if variance < _MAX_VARIANCE else 0
        disagrees = apart > _BAD_YAW and worst_ratio > 1 and self._aiding.mode == ABSOLUTE
        return Course(course, variance, self._course_valid >= _STEADY, disagrees)

    def forget_course(self) -> None:
        """Restart the count of how long the course has been exact."""
        self._course_valid = 0
