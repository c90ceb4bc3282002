# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When checks run and send texts, and what arming and disarming log and send (AP_Arming/AP_Arming.cpp)."""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from ap_core.cint import u32
from ap_core.clock import Clock
from ap_core.param import ParamGroup
from ap_core.sinks import TextSink
from viso.logs.vehicle_log import VehicleLog
from viso.parameters.releases import STABLE_4_7, ParameterRelease

PREARM_DISPLAY_PERIOD_MS: Final = 30_000
PREARM_CHANGE_DISPLAY_MS: Final = 4000
CHECK_ALL: Final = 1 << 0
ANY_CHECK: Final = 0xFFFFFFFF
OPTION_DISABLE_PREARM_DISPLAY: Final = 1 << 0
OPTION_DISABLE_STATUSTEXT: Final = 1 << 1
EV_ARMED: Final = 10
EV_DISARMED: Final = 11

_MAV_SEVERITY_CRITICAL: Final = 2
_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_INFO: Final = 6


class ArmMethod(IntEnum):
    """Who armed or disarmed (AP_Arming::Method)."""

    MAVLINK = 1
    LANDED = 13
    MISSIONEXIT = 14
    DISARMDELAY = 17
    DDS = 35


class Check(NamedTuple):
    """A check: a function that returns its failure, or None.

    ``bit`` is its bit in ARMING_CHECK, and in ARMING_SKIPCHK; 0 for a check that is always made, ANY_CHECK for one that
    is made unless all are switched off.
    """

    bit: int
    run: Callable[[], str | None]


class CheckLists(NamedTuple):
    """All checks, each list in the firmware's order.

    Attributes:
        boot: when one of these fails, no other is made.
        vehicle: the copter's own.
        common: those of all vehicles; only when these stop passing that is shown soon.
        mandatory: all that is left of the above when checks are switched off or arming is forced.
        arm: made last, at an attempt to arm only, up to the first failure.
    """

    boot: Sequence[Check] = ()
    vehicle: Sequence[Check] = ()
    common: Sequence[Check] = ()
    mandatory: Sequence[Check] = ()
    arm: Sequence[Check] = ()


class Arming:
    """Runs the checks in order, sends their failures, arms and disarms; ``params`` is the ARMING_ group.

    ``passed`` says whether the pre-arm checks passed when they were made the last time.
    """

    def __init__(
        self,
        checks: CheckLists,
        params: ParamGroup,
        texts: TextSink,
        log: VehicleLog,
        clock: Clock,
        release: ParameterRelease = STABLE_4_7,
    ) -> None:
        self._release = release
        self._checks = checks
        self._params = params
        self._texts = texts
        self._log = log
        self._clock = clock
        self._report_immediately = False
        self._last_display_ms = 0
        self._common_passed = False
        self.armed = False
        self.passed = False

    def enabled_checks(self) -> int:
        """Return the checks to make, as ARMING_CHECK has them: bit 0 is all."""
        return self._release.enabled_checks(self._params.get_int(self._release.arming_check))

    def is_enabled(self, bit: int) -> bool:
        """Return whether the check with a bit is to be made."""
        return bit == 0 or bool(self.enabled_checks() & (CHECK_ALL | bit))

    def _option(self, bit: int) -> bool:
        return bool(self._params.get_int("OPTIONS") & bit)

    def update(self) -> None:
        """Run the checks, as once a second; display failures now and then (AP_Arming::update)."""
        now_ms = self._clock.millis()
        since_display_ms = u32(now_ms - self._last_display_ms)
        display = since_display_ms > PREARM_DISPLAY_PERIOD_MS or (
            self._report_immediately and since_display_ms > PREARM_CHANGE_DISPLAY_MS
        )
        if display:
            self._report_immediately = False
            self._last_display_ms = now_ms
        self.pre_arm_checks(display and not self._option(OPTION_DISABLE_PREARM_DISPLAY))

    def pre_arm_checks(self, display: bool) -> bool:
        """Run all checks unless armed, as a rule even after one failed; send failures if ``display``."""
        self.passed = self.armed or self._pre_arm("PreArm", display)
        return self.passed

    def _pre_arm(self, prefix: str, display: bool) -> bool:
        # AP_Arming_Copter::run_pre_arm_checks, AP_Arming::pre_arm_checks.
        if not self._run(self._checks.boot, prefix, display):
            return False
        if self.enabled_checks() == 0:
            return self._run(self._checks.mandatory, prefix, display)
        vehicle_passed = self._run(self._checks.vehicle, prefix, display)
        common_passed = self._run(self._checks.common, prefix, display)
        if self._common_passed and not common_passed:
            self._report_immediately = True
        self._common_passed = common_passed
        return vehicle_passed and common_passed

    def _run(self, checks: Sequence[Check], prefix: str, display: bool) -> bool:
        failures = [check.run() for check in checks if self.is_enabled(check.bit)]
        for failure in failures:
            if failure is not None and display:
                self._texts.send_text(_MAV_SEVERITY_CRITICAL, f"{prefix}: {failure}")
        return not any(failures)

    def arm(self, do_checks: bool, method: ArmMethod = ArmMethod.MAVLINK) -> bool:
        """Try to arm and send failures; without checks the mandatory ones remain (AP_Arming::arm).

        Return whether the vehicle is armed by this; False when it was armed already.
        """
        if self.armed or not (self._may_be_forced(do_checks) or self._passes()):
            return False
        self.become_armed(forced=not do_checks, method=method)
        return True

    def become_armed(self, *, forced: bool, method: ArmMethod = ArmMethod.MAVLINK) -> None:
        """Arm without checks."""
        self.armed = True
        self._log.arming(armed=True, checks=self.enabled_checks(), forced=forced, method=method)
        self._log.event(EV_ARMED)
        if not forced and self.enabled_checks() == 0:
            self._texts.send_text(_MAV_SEVERITY_WARNING, "Warning: Arming Checks Disabled")
        self._send_change("Arming motors")

    def _may_be_forced(self, do_checks: bool) -> bool:
        # When it may not, the firmware goes on to make all checks.
        return not do_checks and self._run(self._checks.mandatory, "Arm", display=True)

    def _passes(self) -> bool:
        self.passed = self._pre_arm("Arm", display=True)
        return self.passed and all(self._run([check], "Arm", display=True) for check in self._checks.arm)

    def disarm(self, method: ArmMethod, *, forced: bool = False) -> bool:
        """Disarm; return whether that changed anything."""
        if not self.armed:
            return False
        self.armed = False
        self._log.arming(armed=False, checks=0, forced=forced, method=method)
        self._log.event(EV_DISARMED)
        self._send_change("Disarming motors")
        return True

    def _send_change(self, text: str) -> None:
        if not self._option(OPTION_DISABLE_STATUSTEXT):
            self._texts.send_text(_MAV_SEVERITY_INFO, text)
