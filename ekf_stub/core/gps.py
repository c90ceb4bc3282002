# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter takes from a GPS: solutions that wait for the horizon, and how far they are believed.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readGpsData), AP_NavEKF3_VehicleStatus.cpp (calcGpsGoodToAlign,
calcGpsGoodForFlight).
"""

import math
from typing import Final, final

from ap_core.location import Location
from ap_core.print_format import fixed
from ap_core.vector3 import Vector3f
from ekf_stub.core.inertial import Inertial
from ekf_stub.core.params import Params
from ekf_stub.core.samples import HALF_FILTER_STEP_MS, ObsRing, Sample
from ekf_stub.core.vectors import (
    U32,
    ZERO,
    Rotation,
    Vec2,
    Vec3,
    cross,
    is_zero,
    larger,
    later_ms,
    length2,
    limited,
    scaled,
    signed_since_ms,
    since_ms,
    sub,
    to_earth,
)
from ekf_stub.inputs.measurements import FIX_3D, GpsSample, whole_ms

CENTI: Final = 0.009999999776482582  # float32 of 0.01, as the firmware's literals are
MIN_YAW_ERR: Final = math.radians(5.0)
HEIGHT_TO_HORIZONTAL: Final = 1.5
_FEW_SATELLITES_SCALER: Final = 2.0
_FIVE_SATELLITES_SCALER: Final = 1.4
_ENOUGH_SATELLITES: Final = 6
_MAX_SPEED_ACCURACY: Final = 50.0
_MAX_ACCURACY: Final = 100.0
_DECAY_PER_MS: Final = 0.0002
_SPEED_FILTER: Final = 0.2
_SPEED_HOLD_S: Final = 10.0
_BAD_SPEED: Final = 1.5
_GOOD_SPEED: Final = 1.0
_BAD_INNOVATION_MS: Final = 1000
_GOOD_VERTICAL_MS: Final = 3000
_BAD_VERTICAL_MS: Final = 1000
_GOOD_INNOVATION_MS: Final = 10_000
_WARNING_RATIO: Final = 0.7


def distance_ned(origin: Location, place: Location) -> Vec3:
    """Return the way from one place to another, m NED."""
    north, east, down = origin.distance_ned(place).to_tuple()
    return float(north), float(east), float(down)


# Checks

_MIN_INTERVAL_MS: Final = 50
_PASS_TIME_MS: Final = 10_000
_FAIL_TIME_MS: Final = 5000
_MAX_HDOP: Final = 250
_MIN_SATS: Final = 6
_HYSTERESIS: Final = 1.3
_MAX_HORIZONTAL_M: Final = 5.0
_MAX_VERTICAL_M: Final = 7.5
_MAX_SPEED_MS: Final = 1.0
_MAX_DRIFT_M: Final = 3.0
_MAX_AVERAGE_MS: Final = 0.3
_DRIFT_TIME_S: Final = 10.0
_DRIFT_LIMIT_M: Final = 10.0
_MIN_INTERVAL_S: Final = 0.01
_AVERAGE_SHARE: Final = 0.1
_AVERAGE_LIMIT_MS: Final = 10.0
# Of EK3_GPS_CHECK:
_SATS: Final = 1 << 0
_HDOP: Final = 1 << 1
_SPEED_ERR: Final = 1 << 2
_POS_ERR: Final = 1 << 3
_YAW_ERR: Final = 1 << 4
_DRIFT: Final = 1 << 5
_VERT_SPEED: Final = 1 << 6
_HORIZ_SPEED: Final = 1 << 7


@final
class GpsSurroundings:
    """What else says whether GPS is to be believed.

    Attributes:
        speed_accuracy: the worst of the last seconds, m/s, 0 without any.
        horizontal_speed: that of the last fix at the horizon, m/s.
        on_ground: whether the vehicle is.
        mag_x, mag_y, yaw: ratios of the innovations of compass and yaw to their gates, squared.
    """

    def __init__(self) -> None:
        self.speed_accuracy = 0.0
        self.horizontal_speed = 0.0
        self.on_ground = True
        self.mag_x = 0.0
        self.mag_y = 0.0
        self.yaw = 0.0


@final
class GpsChecks:
    """Judges every solution, before and in flight.

    Attributes:
        good: whether GPS has passed for 10 s, and not failed for 5 s since.
        reason: what the last failure was, in the words of the pre-arm check; empty before the first solution.
    """

    def __init__(self, params: Params) -> None:
        self._params = params
        self.good = False
        self.reason = ""
        self._last_ms = 0
        self._failed_ms = -1
        self._passed_ms = 0
        self._judged_ms = 0
        self._place = Location(0, 0, 0)
        self._drift_m = 0.0
        self._climb_ms = 0.0
        self._speed_ms = 0.0

    def update(self, sample: GpsSample) -> bool:
        """Look at the receiver's last solution; say whether it is new and has a 3D fix (readGpsData)."""
        if since_ms(sample.time_ms, self._last_ms) <= _MIN_INTERVAL_MS:
            return False
        self._last_ms = sample.time_ms
        if sample.fix_type < FIX_3D:
            self.reason = "Waiting for 3D fix"
            return False
        return True

    def judge(self, sample: GpsSample, now_ms: int, around: GpsSurroundings) -> None:
        """Find out whether GPS is good by a solution that ``update`` has accepted."""
        self._follow_motion(sample, now_ms, around)
        failure = self._failure(sample, around)
        if failure:
            self.reason = failure
        if self._failed_ms < 0:
            self.reason = "EKF starting GPS checks"
            self._failed_ms = now_ms
        if failure:
            self._failed_ms = now_ms
        else:
            self._passed_ms = now_ms
        if not self.good and now_ms - self._failed_ms > _PASS_TIME_MS:
            self.good = True
        elif self.good and now_ms - self._passed_ms > _FAIL_TIME_MS:
            self.good = False

    def _follow_motion(self, sample: GpsSample, now_ms: int, around: GpsSurroundings) -> None:
        interval_s = limited(1e-3 * (now_ms - self._judged_ms), _MIN_INTERVAL_S, _DRIFT_TIME_S)
        self._judged_ms = now_ms
        north, east, _ = distance_ned(self._place, sample.location)
        self._place = sample.location
        drift = (self._drift_m + length2(north, east)) * (1.0 - interval_s / _DRIFT_TIME_S)
        self._drift_m = min(drift, _DRIFT_LIMIT_M)
        if around.on_ground:
            self._speed_ms = _averaged(self._speed_ms, around.horizontal_speed)
            if sample.has_vertical_velocity:
                self._climb_ms = _averaged(self._climb_ms, float(sample.vel_ned.z))

    def _failure(self, sample: GpsSample, around: GpsSurroundings) -> str:
        """Return the last of what fails, in the firmware's order, as the firmware tells that one; empty if all pass."""
        checks = int(self._params.GPS_CHECK)
        scale = 0.01 * self._params.CHECK_SCALE * (_HYSTERESIS if self.good else 1.0)
        slow = _MAX_AVERAGE_MS * scale
        climb = abs(self._climb_ms) if sample.has_vertical_velocity else 0.0
        failure = ""
        if checks & _DRIFT and around.on_ground and self._drift_m > _MAX_DRIFT_M * scale:
            failure = f"GPS drift {fixed(self._drift_m, 1)}m (needs {fixed(_MAX_DRIFT_M * scale, 1)})"
        if checks & _VERT_SPEED and around.on_ground and climb > slow:
            failure = f"GPS vertical speed {fixed(climb, 2)}m/s (needs {fixed(slow, 2)})"
        if checks & _HORIZ_SPEED and around.on_ground and self._speed_ms > slow:
            # FIRMWARE PARITY: what it tells is the drift.
            failure = f"GPS horizontal speed {fixed(self._drift_m, 2)}m/s (needs {fixed(slow, 2)})"
        horizontal, vertical = sample.horizontal_accuracy, sample.vertical_accuracy
        if checks & _POS_ERR and horizontal is not None and horizontal > _MAX_HORIZONTAL_M * scale:
            failure = f"GPS horiz error {fixed(horizontal, 1)}m (needs {fixed(_MAX_HORIZONTAL_M * scale, 1)})"
        if checks & _POS_ERR and vertical is not None and vertical > _MAX_VERTICAL_M * scale:
            failure = f"GPS vert error {fixed(vertical, 1)}m (needs < {fixed(_MAX_VERTICAL_M * scale, 1)})"
        if checks & _SPEED_ERR and around.speed_accuracy > _MAX_SPEED_MS * scale:
            failure = f"GPS speed error {fixed(around.speed_accuracy, 1)} (needs < {fixed(_MAX_SPEED_MS * scale, 1)})"
        if checks & _HDOP and sample.hdop > _MAX_HDOP:
            failure = f"GPS HDOP {fixed(sample.hdop * 0.01, 1)} (needs 2.5)"
        if checks & _SATS and sample.num_sats < _MIN_SATS:
            failure = f"GPS numsats {sample.num_sats} (needs 6)"
        if checks & _YAW_ERR and max(around.mag_x, around.mag_y, around.yaw) > 1:
            failure = f"Mag yaw error x={fixed(around.mag_x, 1)} y={fixed(around.mag_y, 1)}"
        return failure


def _averaged(average: float, value: float) -> float:
    return limited(average + _AVERAGE_SHARE * (value - average), -_AVERAGE_LIMIT_MS, _AVERAGE_LIMIT_MS)


# Solutions


@final
class GpsFix(Sample):
    """A solution at the time of its observation.

    Attributes:
        pos, vel: m NED from the origin, m/s NED.
        has_vertical_velocity: whether the receiver gives one.
        yaw: rad; NaN when the receiver gives none.
        antenna: the place of the antenna from the one that position and velocity are of, m, body (FRD).
        place: where the antenna was.
    """

    def __init__(
        self,
        time_ms: int,
        pos: Vec3,
        vel: Vec3,
        has_vertical_velocity: bool,
        yaw: float,
        antenna: Vec3,
        place: Location,
    ) -> None:
        super().__init__(time_ms)
        self.pos = pos
        self.vel = vel
        self.has_vertical_velocity = has_vertical_velocity
        self.yaw = yaw
        self.antenna = antenna
        self.place = place


@final
class Gps:
    """Reads the receiver once a step.

    Attributes:
        checks: judges whether it is good enough to start with.
        newest, delayed: the last solution read, and the last that the horizon has reached.
        is_due: whether one came due in this step.
        received_ms: when the last one was received.
        speed_accuracy, pos_accuracy, height_accuracy: m/s and m, decaying from the worst of the last seconds; 0 when
            the receiver gives none.
        noise_scaler: by which noise counts more while few satellites are seen.
        speed_good: whether the receiver tells velocity well.
        is_in_use: whether solutions wait or have been taken since position was lost.
        tells_climb: whether the last one had a vertical velocity that is wanted.
        accuracy_good: whether solutions are good enough for flight.
        height_good: whether their heights are, too (gpsAccuracyGoodForAltitude).
    """

    def __init__(self, params: Params, ring_size: int) -> None:
        self.checks = GpsChecks(params)
        self._params = params
        self._ring: ObsRing[GpsFix] = ObsRing(ring_size)
        self.reset()

    def reset(self) -> None:
        """Forget everything but the judgement of the receiver."""
        self._ring.clear()
        self._origin = Location(0, 0, 0)
        self._rotation: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        self._step: Inertial | None = None
        self.newest: GpsFix | None = None
        self.delayed: GpsFix | None = None
        self.is_due = False
        self.received_ms = 0
        self.speed_accuracy = 0.0
        self.pos_accuracy = 0.0
        self.height_accuracy = 0.0
        self.noise_scaler = 1.0
        self.accuracy_good = self.height_good = False
        self.is_in_use = False
        self.tells_climb = False
        self._speed_low_passed = 0.0
        self._speed_held = 0.0
        self.speed_good = False
        self._innovations_good = False
        self._checked_ms = 0
        self._innovations_passed_ms = 0
        self._innovations_failed_ms = 0
        self._vertical_good = False
        self._vertical_failed_ms = 0
        self._vertical_passed_ms = 0

    def read(
        self,
        sample: GpsSample,
        now_ms: int,
        absolute: bool,
        wants_climb: bool,
        worst_ratios: Vec2,
        around: GpsSurroundings,
    ) -> bool:
        """Take a new solution; say whether it is one with a fix.

        Args:
            absolute: whether the filter navigates by position.
            wants_climb: whether a vertical velocity is wanted from GPS.
            worst_ratios: of the innovations of velocity and position to their gates, squared.
            around: what else says whether it is to be believed; what the receiver says of that is added.
        """
        if not self.checks.update(sample):
            return False
        self.tells_climb = wants_climb and sample.has_vertical_velocity
        self._follow_accuracy(sample, since_ms(sample.time_ms, self.received_ms))
        self.received_ms = sample.time_ms
        if absolute and sample.num_sats >= _ENOUGH_SATELLITES:
            self.noise_scaler = 1.0
        elif absolute and sample.num_sats == 5:
            self.noise_scaler = _FIVE_SATELLITES_SCALER
        else:
            self.noise_scaler = _FEW_SATELLITES_SCALER
        delayed = self.delayed
        around.horizontal_speed = 0.0 if delayed is None else length2(delayed.vel[0], delayed.vel[1])
        around.speed_accuracy = self.speed_accuracy
        self.checks.judge(sample, now_ms, around)
        self._judge_for_flight(sample, now_ms, larger(worst_ratios[0], worst_ratios[1]))
        return True

    def push(
        self, sample: GpsSample, origin: Location, reference_height_m: float, horizon_ms: int, newest_ms: int
    ) -> None:
        """Put a solution where it waits for the horizon; between this and ``newest_ms`` there are inertial data."""
        north, east, _ = distance_ned(origin, sample.location)
        time_ms = later_ms((sample.time_ms - whole_ms(sample.lag_s) - HALF_FILTER_STEP_MS) & U32, horizon_ms)
        if signed_since_ms(time_ms, newest_ms) > 0:
            time_ms = newest_ms
        pos = north, east, reference_height_m - CENTI * sample.location.alt_cm
        vel_north, vel_east, vel_down = sample.vel_ned.to_tuple()
        vel = float(vel_north), float(vel_east), float(vel_down)
        yaw_deg = sample.yaw_deg
        yaw = math.nan if yaw_deg is None else math.radians(yaw_deg)
        self._origin = origin
        self.is_in_use = True
        x, y, z = sample.antenna
        fix = GpsFix(time_ms, pos, vel, sample.has_vertical_velocity, yaw, (x, y, z), sample.location)
        self.newest = fix
        self._ring.push(fix)

    def note_motion(self, rotation: Rotation, step: Inertial) -> None:
        """Note the attitude, body to earth, and the inertial data of a step."""
        self._rotation = rotation
        self._step = step

    def newest_at_imu(self) -> GpsFix | None:
        """Return the newest solution at the place of the IMU, None before the first."""
        return None if self.newest is None else self._at_imu(self.newest)

    def _at_imu(self, fix: GpsFix) -> GpsFix:
        """Move a solution from the antenna to the IMU (CorrectGPSForAntennaOffset)."""
        step = self._step
        if step is None or is_zero(fix.antenna):
            return fix
        north, east, down = to_earth(self._rotation, fix.antenna)
        body_rate = scaled(step.del_ang, 1.0 / step.del_ang_dt)
        by_turning = to_earth(self._rotation, cross(body_rate, fix.antenna))
        place = fix.place.offset(Vector3f(-north, -east, -down))
        to_north, to_east, _ = distance_ned(self._origin, place)
        pos = to_north, to_east, fix.pos[2] - down
        vel = sub(fix.vel, by_turning)
        return GpsFix(fix.time_ms, pos, vel, fix.has_vertical_velocity, fix.yaw, ZERO, fix.place)

    def recall(self, horizon_ms: int) -> None:
        """Take out what has come due."""
        fix = self._ring.recall(horizon_ms)
        self.is_due = fix is not None
        if fix is not None:
            self.delayed = self._at_imu(fix)

    def _follow_accuracy(self, fix: GpsSample, interval_ms: int) -> None:
        keep = 1.0 - limited(_DECAY_PER_MS * interval_ms, 0.0, 1.0)
        vel_noise, pos_noise = self._params.VELNE_M_NSE, self._params.POSNE_M_NSE
        speed, horizontal, vertical = fix.speed_accuracy, fix.horizontal_accuracy, fix.vertical_accuracy
        self.speed_accuracy = (
            0.0 if speed is None else limited(max(keep * self.speed_accuracy, speed), vel_noise, _MAX_SPEED_ACCURACY)
        )
        self.pos_accuracy = (
            0.0 if horizontal is None else limited(max(keep * self.pos_accuracy, horizontal), pos_noise, _MAX_ACCURACY)
        )
        self.height_accuracy = (
            0.0
            if vertical is None
            else limited(max(keep * self.height_accuracy, vertical), HEIGHT_TO_HORIZONTAL * pos_noise, _MAX_ACCURACY)
        )

    def _judge_for_flight(self, fix: GpsSample, now_ms: int, worst_ratio: float) -> None:
        if not self._checked_ms:
            self._checked_ms = now_ms
            self._innovations_failed_ms = now_ms
            self._innovations_passed_ms = now_ms
            self._vertical_failed_ms = now_ms
            self._vertical_passed_ms = now_ms
        interval_s = 1e-3 * (now_ms - self._checked_ms)
        self._checked_ms = now_ms
        speed = fix.speed_accuracy
        raw = 0.0 if speed is None else speed
        self._speed_low_passed = limited(
            _SPEED_FILTER * raw + (1 - _SPEED_FILTER) * self._speed_low_passed, 0.0, _SPEED_HOLD_S
        )
        keep = 1.0 - limited(interval_s / _SPEED_HOLD_S, 0.0, 1.0)
        self._speed_held = max(self._speed_low_passed, keep * self._speed_held)
        if self._speed_held > _BAD_SPEED:
            self.speed_good = False
        elif self._speed_held < _GOOD_SPEED:
            self.speed_good = True
        most, vertical = self._params.GPS_VACC_MAX, fix.vertical_accuracy
        if most <= 0 or (vertical is not None and vertical < most):
            self._vertical_passed_ms = now_ms
        else:
            self._vertical_failed_ms = now_ms
        if now_ms - self._vertical_passed_ms > _BAD_VERTICAL_MS:
            self._vertical_good = False
        elif now_ms - self._vertical_failed_ms > _GOOD_VERTICAL_MS:
            self._vertical_good = True
        if worst_ratio < 1:
            self._innovations_passed_ms = now_ms
        elif worst_ratio > _WARNING_RATIO:
            self._innovations_failed_ms = now_ms
        if now_ms - self._innovations_passed_ms > _BAD_INNOVATION_MS:
            self._innovations_good = False
        elif now_ms - self._innovations_failed_ms > _GOOD_INNOVATION_MS:
            self._innovations_good = True
        self.accuracy_good = self.speed_good and self._innovations_good
        self.height_good = self.accuracy_good and self._vertical_good
