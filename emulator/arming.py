# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pre-arm and arming checks that bear on external navigation (AP_Arming/AP_Arming.cpp)."""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from ap_core.cint import u32
from ap_core.clock import Clock
from ap_core.param import ParamGroup
from ap_core.sinks import TextSink

PREARM_DISPLAY_PERIOD_MS: Final = 30_000
PREARM_CHANGE_DISPLAY_MS: Final = 4000
CHECK_ALL: Final = 1 << 0
CHECK_VISION: Final = 1 << 18
ANY_CHECK: Final = 0xFFFFFFFF
OPTION_DISABLE_PREARM_DISPLAY: Final = 1 << 0
OPTION_DISABLE_STATUSTEXT: Final = 1 << 1

_MAV_SEVERITY_CRITICAL: Final = 2
_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_INFO: Final = 6


class Check(NamedTuple):
    """One check, and what says its failure or None.

    ``bit`` is its bit in ARMING_CHECK; 0 for a check that is always made, ANY_CHECK for one that is made unless all
    are switched off. ``ends`` is for a check after whose failure no other is made.
    """

    bit: int
    run: Callable[[], str | None]
    ends: bool = False


class Arming:
    """Runs the checks in order, tells their failures, arms and disarms.

    Args:
        checks: in the firmware's order.
        params: the ARMING_ group.
        texts: where failures are told.
        clock: time since boot.
    """

    def __init__(self, checks: Sequence[Check], params: ParamGroup, texts: TextSink, clock: Clock) -> None:
        self._checks = tuple(checks)
        self._params = params
        self._texts = texts
        self._clock = clock
        self._report_immediately = False
        self._last_display_ms = 0
        self.armed = False
        self.passed = False

    def enabled_checks(self) -> int:
        """Return ARMING_CHECK."""
        return self._params.get_int("CHECK")

    def _is_enabled(self, check: Check) -> bool:
        return check.bit == 0 or bool(self.enabled_checks() & (CHECK_ALL | check.bit))

    def _option(self, bit: int) -> bool:
        return bool(self._params.get_int("OPTIONS") & bit)

    def update(self) -> None:
        """Run the checks, as once a second while disarmed; display failures now and then (AP_Arming::update)."""
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
        """Run all checks, as a rule even after one failed; tell failures when asked to."""
        if self.armed:
            return True
        passed = self._run("PreArm", display, mandatory_only=False)
        if self.passed and not passed:
            self._report_immediately = True
        self.passed = passed
        return passed

    def _run(self, prefix: str, display: bool, *, mandatory_only: bool) -> bool:
        passed = True
        for check in self._checks:
            if not self._is_enabled(check) or (mandatory_only and check.bit):
                continue
            failure = check.run()
            if failure is not None:
                passed = False
                if display:
                    self._texts.send_text(_MAV_SEVERITY_CRITICAL, f"{prefix}: {failure}")
                if check.ends:
                    break
        return passed

    def arm(self, do_checks: bool) -> bool:
        """Try to arm and tell failures; without checks the mandatory ones remain (AP_Arming::arm).

        Tell whether the vehicle is armed by this; False when it was armed already.
        """
        if self.armed:
            return False
        self.passed = self._run("Arm", display=True, mandatory_only=not do_checks)
        if not self.passed:
            return False
        self.armed = True
        if do_checks and self.enabled_checks() == 0:
            self._texts.send_text(_MAV_SEVERITY_WARNING, "Warning: Arming Checks Disabled")
        self._tell_change("Arming motors")
        return True

    def disarm(self) -> bool:
        """Disarm; tell whether that changed anything."""
        if not self.armed:
            return False
        self.armed = False
        self._tell_change("Disarming motors")
        return True

    def _tell_change(self, text: str) -> None:
        if not self._option(OPTION_DISABLE_STATUSTEXT):
            self._texts.send_text(_MAV_SEVERITY_INFO, text)
