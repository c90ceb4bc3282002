# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator takes from a GPS: solutions that wait for the horizon, and how far they are believed.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readGpsData), AP_NavEKF3_VehicleStatus.cpp (calcGpsGoodForFlight).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ap_core.cint import i32, later_ms, u32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.filter.inertial import Array, InertialStep, limited
from ekf_stub.inputs.ext_nav_ingest import HALF_FILTER_STEP_MS
from ekf_stub.inputs.gps_checks import GpsChecks, GpsSurroundings
from ekf_stub.inputs.gps_sample import GpsSample, whole_ms
from ekf_stub.inputs.obs_ring import ObsRing
from ekf_stub.reports.core_report import Three

CENTI: Final = float(np.float32(0.01))  # the firmware's literals are of single precision
MIN_YAW_ERR: Final = float(np.radians(5.0))
HEIGHT_TO_HORIZONTAL: Final = 1.5
SCALERS: Final = {5: 1.4}  # of the noise, by number of satellites
FEW_SATELLITES_SCALER: Final = 2.0
ENOUGH_SATELLITES: Final = 6
UNKNOWN: Final = GpsSurroundings()
_NOWHERE: Final = Location(0, 0, 0)
_MAX_SPEED_ACCURACY: Final = 50.0
_MAX_ACCURACY: Final = 100.0
_DECAY_PER_MS: Final = 0.0002
_SPEED_FILTER: Final = 0.2
_SPEED_HOLD_S: Final = 10.0
_BAD_SPEED: Final = 1.5
_GOOD_SPEED: Final = 1.0
_BAD_INNOVATION_MS: Final = 1000
_GOOD_INNOVATION_MS: Final = 10_000
_WARNING_RATIO: Final = 0.7


@dataclass(frozen=True, slots=True)
class GpsFix:
    """A solution at the time of its observation: m NED from the origin, m/s NED.

    ``antenna`` is the place of the antenna from the one that position and velocity are of, m, body (FRD).
    """

    time_ms: int
    pos: Array
    vel: Array
    has_vertical_velocity: bool
    yaw: float | None
    antenna: Three = (0.0, 0.0, 0.0)
    place: Location = _NOWHERE


class GpsReading:
    """Reads the receiver once a step.

    Attributes:
        checks: judges whether it is good enough to start with.
        newest, delayed: the last solution read, and the last that the horizon has reached.
        is_due: whether one came due in this step.
        speed_accuracy, pos_accuracy, height_accuracy: m/s and m, decaying from the worst of the last seconds; 0 when
            the receiver gives none.
        noise_scaler: by which noise counts more while few satellites are seen.
        speed_good: whether the receiver tells velocity well.
        is_in_use: whether solutions wait or have been taken since position was lost.
        tells_climb: whether the last one had a vertical velocity that is wanted.
        accuracy_good: whether solutions are good enough for flight.
    """

    def __init__(self, get_float: Callable[[str], float], ring_size: int) -> None:
        self.checks = GpsChecks(get_float)
        self._get_float = get_float
        self._ring: ObsRing[GpsFix] = ObsRing(ring_size)
        self.reset()

    def reset(self) -> None:
        """Forget everything but the judgement of the receiver."""
        self._ring.clear()
        self._origin = _NOWHERE
        self._rotation: Array = np.eye(3)
        self._step: InertialStep | None = None
        self.newest: GpsFix | None = None
        self.delayed: GpsFix | None = None
        self.is_due = False
        self.received_ms = 0
        self.speed_accuracy = self.pos_accuracy = self.height_accuracy = 0.0
        self.noise_scaler = 1.0
        self.accuracy_good = self.is_in_use = self.tells_climb = False
        self._speed_low_passed = self._speed_held = 0.0
        self.speed_good = self._innovations_good = False
        self._checked_ms = self._innovations_passed_ms = self._innovations_failed_ms = 0

    def read(
        self,
        sample: GpsSample,
        now_ms: int,
        *,
        absolute: bool,
        worst_ratios: tuple[float, float],
        around: GpsSurroundings = UNKNOWN,
        wants_climb: bool = False,
    ) -> GpsSample | None:
        """Take a new solution; return it when it is one with a fix.

        Args:
            absolute: whether the filter navigates by position.
            worst_ratios: of the innovations of velocity and position to their gates, squared.
            around: what else says whether it is to be believed; what the receiver says of that is added.
            wants_climb: whether a vertical velocity is wanted from GPS.
        """
        fix = self.checks.update(sample)
        if fix is None:
            return None
        self.tells_climb = wants_climb and fix.has_vertical_velocity
        self._follow_accuracy(fix, u32(fix.time_ms - self.received_ms))
        self.received_ms = fix.time_ms
        enough = absolute and fix.num_sats >= ENOUGH_SATELLITES
        scaler = SCALERS.get(fix.num_sats, FEW_SATELLITES_SCALER) if absolute else FEW_SATELLITES_SCALER
        self.noise_scaler = 1.0 if enough else scaler
        speed = 0.0 if self.delayed is None else float(np.hypot(*self.delayed.vel[:2]))
        self.checks.judge(fix, now_ms, around._replace(speed_accuracy=self.speed_accuracy, horizontal_speed=speed))
        self._judge_for_flight(fix, now_ms, worst_ratios)
        return fix

    def push(
        self, sample: GpsSample, origin: Location, reference_height_m: float, horizon_ms: int, newest_ms: int
    ) -> None:
        """Put a solution where it waits for the horizon; between this and ``newest_ms`` there are inertial data."""
        north, east, _ = (float(value) for value in origin.distance_ned(sample.location).to_tuple())
        time_ms = later_ms(u32(sample.time_ms - whole_ms(sample.lag_s) - HALF_FILTER_STEP_MS), horizon_ms)
        if i32(time_ms - newest_ms) > 0:
            time_ms = newest_ms
        pos = np.array([north, east, reference_height_m - CENTI * sample.location.alt_cm])
        vel = np.array([float(value) for value in sample.vel_ned.to_tuple()])
        yaw = None if sample.yaw_deg is None else float(np.radians(sample.yaw_deg))
        self._origin, self.is_in_use = origin, True
        self.newest = GpsFix(time_ms, pos, vel, sample.has_vertical_velocity, yaw, sample.antenna, sample.location)
        self._ring.push(self.newest)

    def note_motion(self, rotation: Array, step: InertialStep) -> None:
        """Note the attitude, body to earth, and the inertial data of a step."""
        self._rotation, self._step = rotation, step

    def newest_at_imu(self) -> GpsFix | None:
        """Return the newest solution at the place of the IMU, None before the first."""
        return None if self.newest is None else self._at_imu(self.newest)

    def _at_imu(self, fix: GpsFix) -> GpsFix:
        """Move a solution from the antenna to the IMU (CorrectGPSForAntennaOffset)."""
        step = self._step
        if step is None or not any(fix.antenna):
            return fix
        offset = self._rotation @ np.array(fix.antenna)
        by_turning = self._rotation @ np.cross(step.del_ang / step.del_ang_dt, fix.antenna)
        place = fix.place.offset(Vector3f(*(-offset).tolist()))
        north, east, _ = (float(value) for value in self._origin.distance_ned(place).to_tuple())
        pos = np.array([north, east, fix.pos[2] - offset[2]])
        return replace(fix, pos=pos, vel=fix.vel - by_turning, antenna=(0.0, 0.0, 0.0))

    def recall(self, horizon_ms: int) -> None:
        """Take out what has come due."""
        fix = self._ring.recall(horizon_ms).sample if self._ring.samples else None
        self.is_due = fix is not None
        if fix is not None:
            self.delayed = self._at_imu(fix)

    def _follow_accuracy(self, fix: GpsSample, interval_ms: int) -> None:
        keep = 1.0 - limited(_DECAY_PER_MS * interval_ms, 0.0, 1.0)
        vel_noise, pos_noise = self._get_float("VELNE_M_NSE"), self._get_float("POSNE_M_NSE")

        def follow(held: float, raw: float | None, low: float, high: float) -> float:
            return 0.0 if raw is None else limited(max(keep * held, raw), low, high)

        self.speed_accuracy = follow(self.speed_accuracy, fix.speed_accuracy, vel_noise, _MAX_SPEED_ACCURACY)
        self.pos_accuracy = follow(self.pos_accuracy, fix.horizontal_accuracy, pos_noise, _MAX_ACCURACY)
        self.height_accuracy = follow(
            self.height_accuracy, fix.vertical_accuracy, HEIGHT_TO_HORIZONTAL * pos_noise, _MAX_ACCURACY
        )

    def _judge_for_flight(self, fix: GpsSample, now_ms: int, worst_ratios: tuple[float, float]) -> None:
        interval_s = 1e-3 * (now_ms - (self._checked_ms or now_ms))
        if not self._checked_ms:
            self._innovations_failed_ms = self._innovations_passed_ms = now_ms
        self._checked_ms = now_ms
        raw = fix.speed_accuracy or 0.0
        self._speed_low_passed = limited(
            _SPEED_FILTER * raw + (1 - _SPEED_FILTER) * self._speed_low_passed, 0.0, _SPEED_HOLD_S
        )
        keep = 1.0 - limited(interval_s / _SPEED_HOLD_S, 0.0, 1.0)
        self._speed_held = max(self._speed_low_passed, keep * self._speed_held)
        if self._speed_held > _BAD_SPEED:
            self.speed_good = False
        elif self._speed_held < _GOOD_SPEED:
            self.speed_good = True
        if max(worst_ratios) < 1:
            self._innovations_passed_ms = now_ms
        elif max(worst_ratios) > _WARNING_RATIO:
            self._innovations_failed_ms = now_ms
        if now_ms - self._innovations_passed_ms > _BAD_INNOVATION_MS:
            self._innovations_good = False
        elif now_ms - self._innovations_failed_ms > _GOOD_INNOVATION_MS:
            self._innovations_good = True
        self.accuracy_good = self.speed_good and self._innovations_good
