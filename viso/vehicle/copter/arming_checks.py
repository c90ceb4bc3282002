# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The arming checks that have something to look at here (AP_Arming.cpp, ArduCopter/AP_Arming_Copter.cpp).

FIRMWARE PARITY: there are no motors, radio and inertial sensors; their checks are left out. The compass always is
healthy, and none is asked for when yaw comes from elsewhere.
"""

import math
from typing import TYPE_CHECKING, Final

from ap_core.fmath import f32, norm3
from ap_core.print_format import fixed
from ekf_stub.inputs.measurements import AllGps, GpsSample
from viso.vehicle.copter.arming import ANY_CHECK, Check, CheckLists
from viso.vehicle.copter.modes import Mode, ModeNumber

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

CHECK_GPS: Final = 1 << 3
CHECK_INS: Final = 1 << 4
CHECK_LOGGING: Final = 1 << 10
CHECK_SWITCH: Final = 1 << 11
CHECK_MISSION: Final = 1 << 14
CHECK_RANGEFINDER: Final = 1 << 15
CHECK_VISION: Final = 1 << 18
GPS_FIX_3D: Final = 3
AHRS_GPS_ERROR_MAX_M: Final = 10
GPS_APART_MAX_M: Final = 50
AUTO_ALLOWS_ARMING: Final = 1 << 0
"""A bit of AUTO_OPTIONS."""
LEAN_LIMIT_DEG: Final = 30.0
"""ANGLE_MAX's default."""


class ArmingChecks:
    """Each method checks one condition and returns the failure, or None."""

    def __init__(self, vehicle: "Vehicle") -> None:
        self._vehicle = vehicle

    def _mode(self) -> Mode:
        return self._vehicle.copter.modes.current

    def lists(self) -> CheckLists:
        """Return all checks in the firmware's order."""
        return CheckLists(
            boot=(Check(0, self.system_initialised),),
            vehicle=(Check(0, self.altitude),),
            common=(
                Check(CHECK_SWITCH, self.hardware_safety_switch),
                Check(CHECK_INS, self.attitude),
                Check(0, self.gps),
                Check(CHECK_LOGGING, self.logging),
                Check(CHECK_MISSION, self.mission),
                Check(CHECK_RANGEFINDER, self.ranges),
                Check(ANY_CHECK, self.internal_errors),
                Check(CHECK_VISION, self.visual_odom),
            ),
            mandatory=(Check(0, self.position), Check(0, self.altitude)),
            arm=(
                Check(0, self.ahrs_health),
                Check(0, self.mode),
                Check(CHECK_INS, self.lean_angle),
                Check(ANY_CHECK, self.safety_switch),
                Check(ANY_CHECK, self.logging_started),
            ),
        )

    def system_initialised(self) -> str | None:
        """Booting is over."""
        return None if self._vehicle.copter.has_booted else "System not initialised"

    def altitude(self) -> str | None:
        """A mode that holds height needs to know it (alt_checks)."""
        return None if self._mode().manual_throttle or self._vehicle.copter.estimates.alt_ok() else "Need Alt Estimate"

    def hardware_safety_switch(self) -> str | None:
        """The safety switch lets motors run (hardware_safety_check)."""
        return "Hardware safety switch" if self._vehicle.copter.safety_on else None

    def attitude(self) -> str | None:
        """The estimator has an attitude (ins_checks)."""
        return None if self._vehicle.copter.estimates.attitude_ok() else "EKF attitude is bad"

    def gps(self) -> str | None:
        """What is mandatory, between what a mode with a position needs of GPS and home (gps_checks)."""
        is_needed = self._mode().requires_position and self._vehicle.copter.arming.is_enabled(CHECK_GPS)
        if not is_needed or not (self._vehicle.firmware.checks_unused_gps or self._vehicle.ahrs.uses_gps()):
            return self.position()
        of_source = self._vehicle.source.gps()
        gps = self._vehicle.gps.samples() if of_source is None else AllGps((of_source,))
        return self._gps_failure(gps) or self.position() or self._dilution_failure(gps.used)

    def _gps_failure(self, gps: AllGps) -> str | None:
        # AP_Arming::gps_checks
        for number, one in enumerate(gps.solutions, 1):
            if one is not None and one.fix_type < GPS_FIX_3D:
                return f"GPS {number}: Bad fix"
            if one is not None and not one.is_healthy:
                return f"GPS {number}: not healthy"
        if not self._vehicle.copter.has_home():
            return "AHRS: waiting for home"
        first, second, solution = gps.of(0), gps.of(1), gps.used
        if first is not None and second is not None:
            apart_m = norm3(*first.location.distance_ned(second.location).to_tuple())
            if apart_m >= GPS_APART_MAX_M:
                return f"GPS positions differ by {fixed(float(apart_m), 1, 4)}m"
        place = self._vehicle.ahrs.get_location()
        if solution is None or place is None:
            return None
        way = solution.location.distance_ned(place)
        distance_m = norm3(way.x, way.y, f32(0))
        return (
            f"GPS and AHRS differ by {fixed(float(distance_m), 1, 4)}m" if distance_m > AHRS_GPS_ERROR_MAX_M else None
        )

    def _dilution_failure(self, solution: GpsSample | None) -> str | None:
        limit = self._vehicle.params.get_int("GPS_HDOP_GOOD")
        return "High GPS HDOP" if solution is not None and solution.hdop > limit else None

    def position(self) -> str | None:
        """The AHRS is ready and, in a mode that needs it, has a position (mandatory_gps_checks)."""
        needs_position = self._mode().requires_position
        failure = self._vehicle.ahrs.pre_arm_failure(requires_position=needs_position)
        if failure is not None:
            return f"AHRS: {failure}"
        return self._position_failure() if needs_position else None

    def _position_failure(self) -> str | None:
        estimates = self._vehicle.copter.estimates
        if not estimates.position_ok():
            return "Need Position Estimate"
        if estimates.is_gps_glitching():
            return "GPS glitching"
        variance = estimates.failing_variance(float(self._vehicle.params.get_float("FS_EKF_THRESH")))
        return None if variance is None else f"EKF {variance} variance"

    def logging(self) -> str | None:
        """Logs can be written, and no log is being downloaded (logging_checks)."""
        if self._vehicle.logger.failure is not None:
            return "Logging failed"
        return "Downloading logs" if self._vehicle.log_transfer.is_active else None

    def mission(self) -> str | None:
        """AUTO has a mission (mission_checks)."""
        lacks_one = self._mode().number == ModeNumber.AUTO and not self._vehicle.copter.mission.is_present()
        return "Mode requires mission" if lacks_one else None

    def ranges(self) -> str | None:
        """All range finders work (rangefinder_checks)."""
        return self._vehicle.ranges.failure()

    def internal_errors(self) -> str | None:
        """Nothing happened that should not be possible (system_checks)."""
        errors = self._vehicle.internal_errors
        return f"Internal errors 0x{errors.mask:x} l:{errors.last_line} {errors.describe()}" if errors.mask else None

    def visual_odom(self) -> str | None:
        """Visual odometry works (visodom_checks)."""
        failure = self._vehicle.visual_odom.pre_arm_check()
        return None if failure is None else f"VisOdom: {failure}"

    def ahrs_health(self) -> str | None:
        """The estimator is healthy."""
        return None if self._vehicle.ahrs.healthy() else "AHRS not healthy"

    def mode(self) -> str | None:
        """The mode may be armed in."""
        mode = self._mode()
        if mode.number == ModeNumber.AUTO and self._vehicle.params.get_int("AUTO_OPTIONS") & AUTO_ALLOWS_ARMING:
            return None
        return None if mode.arms else f"{self._vehicle.copter.modes.name_of(mode)} mode not armable"

    def lean_angle(self) -> str | None:
        """The vehicle is roughly level."""
        quat = self._vehicle.ahrs.get_quaternion()
        if quat is None:
            return None
        cos_lean = math.cos(quat.get_euler_roll()) * math.cos(quat.get_euler_pitch())
        return "Leaning" if cos_lean < math.cos(math.radians(LEAN_LIMIT_DEG)) else None

    def safety_switch(self) -> str | None:
        """The safety switch lets motors run."""
        return "Safety Switch" if self._vehicle.copter.safety_on else None

    def logging_started(self) -> str | None:
        """The log of the flight can be opened; opening it comes last (AP_Arming::arm_checks)."""
        logger = self._vehicle.logger
        logger.update(True, self._vehicle.params)
        failed = not logger.is_open and logger.failure is not None
        return "Logging not started" if failed and self._vehicle.copter.arming.is_enabled(CHECK_LOGGING) else None
