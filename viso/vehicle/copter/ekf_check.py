# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the vehicle does when its estimator fails (ArduCopter/ekf_check.cpp)."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from ap_core.cint import u32
from ekf_stub.reports import FilterStatus

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

ITERATIONS_MAX: Final = 10
WARNING_PERIOD_MS: Final = 30_000
ERR_SUBSYSTEM_EKFCHECK: Final = 16
ERR_SUBSYSTEM_FAILSAFE_EKFINAV: Final = 17
ERR_BAD_VARIANCE: Final = 2
ERR_FAILSAFE_OCCURRED: Final = 1
ERR_RESOLVED: Final = 0

_MAV_SEVERITY_CRITICAL: Final = 2


def is_over_threshold(status: FilterStatus, threshold: float, *, has_flow: bool = False) -> bool:
    """Return whether too many variances are too large (Copter::ekf_over_threshold).

    With a flow sensor that works a velocity far off counts as any that is off.
    """
    # FIRMWARE PARITY: the firmware filters position and velocity first, with FS_EKF_FILT.
    over = int(status.compass_variance >= threshold)
    if status.velocity_variance >= 2 * threshold and not has_flow:
        over += 2
    elif status.velocity_variance >= threshold:
        over += 1
    return over >= 2 or (over >= 1 and status.pos_horiz_variance >= threshold)


class EkfCheck:
    """Counts failures, ten times per second; it asks the estimator for help, and after a second of them it warns.

    Args:
        vehicle: the vehicle around it.
        has_position: says whether the estimator has a position, failsafe or not.
        is_armed: says whether the vehicle is armed.
        act: leaves a mode that needs a position, of an armed vehicle; returns what it is called that it enters.

    Attributes:
        failed: whether the estimator is not to be trusted.
        in_failsafe: whether the vehicle is in the failsafe that follows.
    """

    def __init__(
        self,
        vehicle: "Vehicle",
        *,
        has_position: Callable[[], bool],
        is_armed: Callable[[], bool],
        act: Callable[[], str | None],
    ) -> None:
        self._ahrs = vehicle.ahrs
        self._texts = vehicle.texts
        self._log = vehicle.log
        self._vehicle = vehicle
        self._has_position = has_position
        self._is_armed = is_armed
        self._act = act
        self._failures = 0
        self._has_ever_passed = False
        self._last_warning_ms = 0
        self._failsafe_was_told = False
        self.failed = False
        self.in_failsafe = False

    def update(self) -> None:
        """Look at the estimator, once there is an origin (Copter::ekf_check)."""
        status = None if self._ahrs.origin() is None else self._ahrs.get_filter_status()
        if status is None:
            return
        threshold = float(self._vehicle.params.get_float("FS_EKF_THRESH"))
        if threshold <= 0:
            self._failures = 0
            self.failed = False
            self._end_failsafe()
            return
        is_over = is_over_threshold(status, threshold, has_flow=self._vehicle.flow.healthy())
        passed = self._has_position() and not is_over
        self._has_ever_passed |= passed
        if self._has_ever_passed:
            self._count(passed=passed, is_over=is_over)

    def _count(self, *, passed: bool, is_over: bool) -> None:
        if not passed and not self.failed:
            self._failures += 1
            if self._failures == ITERATIONS_MAX - 2 and is_over:
                self._ahrs.request_yaw_reset()
            if self._failures == ITERATIONS_MAX - 1:
                self._ahrs.check_lane_switch()
            if self._failures == ITERATIONS_MAX:
                self._fail(is_over)
        elif passed and self._failures > 0:
            self._failures -= 1
            if self.failed and self._failures == 0:
                self.failed = False
                self._log.error(ERR_SUBSYSTEM_EKFCHECK, ERR_RESOLVED)
                self._end_failsafe()

    def _fail(self, is_over: bool) -> None:
        self.failed = True
        self._log.error(ERR_SUBSYSTEM_EKFCHECK, ERR_BAD_VARIANCE)
        now_ms = self._vehicle.clock.millis()
        if u32(now_ms - self._last_warning_ms) > WARNING_PERIOD_MS:
            over, lost = self._vehicle.firmware.variance_texts
            self._texts.send_text(_MAV_SEVERITY_CRITICAL, over if is_over else lost)
            self._last_warning_ms = now_ms
        self.in_failsafe = True
        self._log.error(ERR_SUBSYSTEM_FAILSAFE_EKFINAV, ERR_FAILSAFE_OCCURRED)
        if self._is_armed():
            mode = self._act()
            self._failsafe_was_told |= mode is not None or self._vehicle.firmware.reports_ekf_failure
            if mode is not None:
                self._texts.send_text(_MAV_SEVERITY_CRITICAL, f"EKF Failsafe: changed to {mode} Mode")
            elif self._vehicle.firmware.reports_ekf_failure:
                self._texts.send_text(_MAV_SEVERITY_CRITICAL, "EKF Failsafe")

    def _end_failsafe(self) -> None:
        if not self.in_failsafe:
            return
        self.in_failsafe = False
        if self._failsafe_was_told:
            self._failsafe_was_told = False
            self._texts.send_text(_MAV_SEVERITY_CRITICAL, "EKF Failsafe Cleared")
        self._log.error(ERR_SUBSYSTEM_FAILSAFE_EKFINAV, ERR_RESOLVED)
