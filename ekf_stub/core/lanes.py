# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All cores together, and which of them the vehicle flies by: the primary one (AP_NavEKF3/AP_NavEKF3.cpp).

By how much yaw, position and height jump as another core takes over is for controllers, and is not worked out.
"""

from collections.abc import Callable, Sequence
from typing import Final

from ap_core.location import Location
from ap_core.sinks import TextSink
from ekf_stub.core.ekf3_core import CommonOrigin, Ekf3Core, Frame
from ekf_stub.core.reporting import report_of
from ekf_stub.filter.inertial import Array, limited
from ekf_stub.log.ekf_log import UNINITIALISED
from ekf_stub.reports.core_report import CoreReport
from ekf_stub.reports.core_texts import MAV_SEVERITY_CRITICAL, MAV_SEVERITY_WARNING

SETTLED_US: Final = 10_000_000
NOT_PRIMARY_US: Final = 10_000_000
BETTER_BY: Final = 0.5
MAX_RELATIVE_ERROR: Final = 1.0
MIN_THRESHOLD: Final = 0.05
BAD_SCORE: Final = 1.0
GOOD_SCORE: Final = 0.9
BETWEEN_CHECKS_MS: Final = 5000
_INITIALISING: Final = "EKF3 still initialising"
_MANUAL_LANE_SWITCH: Final = 1 << 1  # of EK3_OPTIONS


class Lanes:
    """The cores, in the order of their numbers (NavEKF3).

    Args:
        cores: the cores; they share ``common``.
        get_float: returns a parameter by its name after ``EK3_``.
        count: how many cores there are, where the only filter stands for all of them.

    Attributes:
        cores: the cores, or the filter that stands for all.
        primary: the number of the primary core.
        error_scores: of each core, as of the last frame in which one was to be chosen.
        relative_errors: how much worse than the primary one each has been, summed up.
        yaw_reset_ms: when yaw jumped last, by a reset of the primary core or as that changed; 0 before.
    """

    def __init__(
        self,
        cores: Sequence[Ekf3Core],
        common: CommonOrigin,
        get_float: Callable[[str], float],
        texts: TextSink,
        count: int | None = None,
    ) -> None:
        self.cores = tuple(cores)
        self._count = count or len(self.cores)
        self._filters = range(self._count) if len(self.cores) > 1 else (0,) * self._count  # by number of the core
        self._common = common
        self._get_float = get_float
        self._texts = texts
        self.primary = self.chosen_by_user()
        self.error_scores = [0.0] * len(self.cores)
        self.relative_errors = [0.0] * len(self.cores)
        self._yaw_resets = [0] * len(self.cores)
        self._yaw_reset_ms = [0] * len(self.cores)
        self._last_primary_us = [0] * len(self.cores)
        self._switched_ms = self._now_us = self._unhealthy_us = 0
        self._selects = self._armed = False

    def chosen_by_user(self) -> int:
        """Return the number of the core that EK3_PRIMARY chooses."""
        wanted = int(self._get_float("PRIMARY"))
        return wanted if 0 <= wanted < self._count else 0

    @property
    def primary_filter(self) -> Ekf3Core:
        """The filter of the primary core."""
        return self.cores[self._filters[self.primary]]

    @property
    def yaw_reset_ms(self) -> int:
        """When yaw jumped last, as the vehicle sees it (getLastYawResetAngle)."""
        return max(self._switched_ms, self._yaw_reset_ms[self._filters[self.primary]])

    def run(self, frames: Sequence[Frame]) -> None:
        """Run one frame of each core, and choose the primary one (UpdateFilter)."""
        now_us = self._now_us = frames[0].time_us
        for i, core in enumerate(self.cores):
            core.run(frames[i])
            if core.yaw_resets != self._yaw_resets[i]:
                self._yaw_resets[i], self._yaw_reset_ms[i] = core.yaw_resets, now_us // 1000
        self._armed = frames[0].armed
        if not self._selects:
            self._settle()
        self._select()

    def run_alike(self, rows: Array, times_us: range, set_us: Callable[[int], None]) -> int:
        """Run frames of the only filter as of ``Ekf3Core.run_alike``; return how many."""

        def begin_last(now_us: int) -> None:
            if now_us != times_us[0]:
                self._now_us = now_us - times_us.step
                self._settle()
            set_us(now_us)

        (core,) = self.cores
        count = core.run_alike(rows, times_us, set_us if self._selects else begin_last)
        now_us = self._now_us = times_us[count - 1]
        if core.yaw.resets != self._yaw_resets[0]:
            self._yaw_resets[0], self._yaw_reset_ms[0] = core.yaw.resets, now_us // 1000
        if not self._selects:
            self._settle()
        self._select()
        return count

    def report(self, i: int) -> CoreReport:
        """Return what a core says as of the last frame."""
        core = self.cores[i]
        if not core.initialised:
            return UNINITIALISED
        report = report_of(core, self._now_us // 1000)
        report.error_score, report.relative_error = self.error_scores[i], self.relative_errors[i]
        return report

    def _is_healthy(self, i: int) -> bool:
        core = self.cores[self._filters[i]]
        return core.initialised and core.control.healthy(self._now_us // 1000)

    def unhealthy_reason(self, now_ms: int) -> str | None:
        """Return what is wrong with the first core that does not run well, None while all do (pre_arm_check)."""
        for i, core in enumerate(self.cores):
            if not (core.initialised and core.control.healthy(now_ms)):
                return f"EKF3 core {i} unhealthy" if core.gps.checks.good else core.gps.checks.reason or _INITIALISING
        return None

    def _settle(self) -> None:
        if not self._unhealthy_us or not self._is_healthy(self.primary):
            self._unhealthy_us = self._now_us
        self._selects = self._now_us - self._unhealthy_us > SETTLED_US

    def _select(self) -> None:
        if int(self._get_float("OPTIONS")) & _MANUAL_LANE_SWITCH:
            self._switch(self.chosen_by_user())
        elif self._armed and self._selects and len(self.cores) > 1:
            self._select_in_flight()
        elif self._armed and self._selects and self.cores[0].stepped:
            self.error_scores[0] = self.cores[0].error_score()
        by_user = self.primary if self._armed else self.chosen_by_user()
        if self.primary != by_user and self._is_healthy(by_user):
            self.primary = by_user

    def _select_in_flight(self) -> None:
        self.error_scores = [core.error_score() for core in self.cores]
        self._update_relative_errors()
        primary, best, is_better = self.primary, self.primary, False
        for i, core in enumerate(self.cores):
            may_be = i != primary and self._now_us - self._last_primary_us[i] > NOT_PRIMARY_US
            if may_be and self._has_better_score(i, best):
                is_better = self.relative_errors[i] <= -BETTER_BY
                is_better |= core.yaw.aligned and not self.cores[primary].yaw.aligned
                best = i
        if best == primary:
            return
        if is_better or self.error_scores[primary] > BAD_SCORE or not self._is_healthy(primary):
            self._switch(best)
            self.relative_errors = [0.0] * len(self.cores)
            self._last_primary_us[self.primary] = self._now_us

    def _update_relative_errors(self) -> None:
        """Count against each core what it was worse than the primary one, and for it what it was much better."""
        threshold = max(self._get_float("ERR_THRESH"), MIN_THRESHOLD)
        for i, score in enumerate(self.error_scores):
            error = score - self.error_scores[self.primary]
            if i != self.primary and (error > 0 or error < -threshold):
                self.relative_errors[i] = limited(
                    self.relative_errors[i] + error, -MAX_RELATIVE_ERROR, MAX_RELATIVE_ERROR
                )

    def _has_better_score(self, i: int, than: int) -> bool:
        """Return whether a core is better than another (coreBetterScore)."""
        if not self._is_healthy(i):
            return False
        new, old = self.cores[i], self.cores[than]
        if new.control.tilt_aligned != old.control.tilt_aligned:
            return new.control.tilt_aligned
        if new.yaw.aligned != old.yaw.aligned:
            return new.yaw.aligned
        return self.relative_errors[i] < self.relative_errors[than]

    def _switch(self, i: int) -> None:
        if i != self.primary:
            self.primary = i
            self._switched_ms = self._now_us // 1000
            self._texts.send_text(MAV_SEVERITY_CRITICAL, f"EKF3 lane switch {i}")

    def check_lane_switch(self) -> None:
        """Go over to a core that is much better, as the vehicle is about to give up (checkLaneSwitch)."""
        is_manual = int(self._get_float("OPTIONS")) & _MANUAL_LANE_SWITCH
        is_soon = self._switched_ms and self._now_us // 1000 - self._switched_ms < BETWEEN_CHECKS_MS
        if is_manual or is_soon or not self.primary_filter.initialised:
            return
        best, lowest = self.primary, self.primary_filter.error_score()
        for i, core in enumerate(self.cores):
            if i != self.primary and self._is_healthy(i) and core.is_aligned:
                score = core.error_score()
                if score < min(lowest, GOOD_SCORE):
                    best, lowest = i, score
        self._switch(best)

    # What goes to all cores

    @property
    def origin(self) -> Location | None:
        """Where told positions count from, None until any core has an origin."""
        return self._common.place

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once; say whether it was set (setOriginLLH)."""
        if self._common.place is not None:
            self._texts.send_text(MAV_SEVERITY_WARNING, "EKF3: origin already set")
            return False
        were_set = [core.set_origin(origin) for core in self.cores]
        return any(were_set)

    def set_place(self, place: Location, accuracy_m: float, time_ms: int) -> bool:
        """Put the vehicle somewhere while it navigates without a position; say whether it was (setLatLng)."""
        were_put = [core.set_place(place, accuracy_m, time_ms) for core in self.cores]
        return any(were_put)

    def reset_height_datum(self) -> bool:
        """Count heights from the present one, on the ground; say whether all do (resetHeightDatum)."""
        were_reset = [core.reset_height_datum() for core in self.cores]
        return all(were_reset)

    def request_yaw_reset(self) -> None:
        """Ask for yaw to be reset by the velocity of GPS, within 5 s (requestYawReset)."""
        for core in self.cores:
            core.request_yaw_reset()
