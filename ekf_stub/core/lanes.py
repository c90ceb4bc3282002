# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All cores together, and which of them the vehicle flies by: the primary one (AP_NavEKF3/AP_NavEKF3.cpp).

By how much yaw, position and height jump as another core takes over is for controllers, and is not worked out.
"""

from typing import Final, final

from ap_core.location import Location
from ekf_stub.core import events as ev
from ekf_stub.core.core import CommonOrigin, Core
from ekf_stub.core.events import Text
from ekf_stub.core.imus import Imus
from ekf_stub.core.params import EkfSources, Params
from ekf_stub.core.samples import RingSizes
from ekf_stub.core.vectors import ZERO, larger, limited, smaller
from ekf_stub.release import FilterRelease

_SETTLED_US: Final = 10_000_000
_NOT_PRIMARY_US: Final = 10_000_000
_BETTER_BY: Final = 0.5
_MAX_RELATIVE_ERROR: Final = 1.0
_MIN_THRESHOLD: Final = 0.05
_BAD_SCORE: Final = 1.0
_GOOD_SCORE: Final = 0.9
_BETWEEN_CHECKS_MS: Final = 5000
_INITIALISING: Final = "EKF3 still initialising"
_MANUAL_LANE_SWITCH: Final = 1 << 1  # of EK3_OPTIONS


@final
class Lanes:
    """The cores, in the order of their numbers (NavEKF3).

    Args:
        sources: the source sets, and which one is active.
        sizes: the lengths of the buffers of each core.
        imus: what IMUs say; rows are read into it.
        numbers, imu_of_core: number and IMU of each core.
        count: how many cores there are, where the only filter stands for all of them.

    Attributes:
        cores: the cores, or the filter that stands for all.
        texts: what they have said; whoever tells it clears the list.
        tells_outcomes: whether somebody hears at once what becomes of samples, see ``advance``.
        common: the origin that they share.
        primary: the number of the primary core.
        error_scores: of each core, as of the last pass in which one was to be chosen.
        relative_errors: how much worse than the primary one each has been, summed up.
        now_us: the time of the last pass.
    """

    def __init__(
        self,
        params: Params,
        sources: EkfSources,
        sizes: list[RingSizes],
        release: FilterRelease,
        imus: Imus,
        numbers: list[int],
        imu_of_core: list[int],
        count: int,
    ) -> None:
        self._params = params
        self._are_automatic = release.lanes_are_automatic
        self.imus = imus
        self.texts: list[Text] = []
        self.tells_outcomes = False
        self.common = CommonOrigin()
        self.cores = [
            Core(params, sources.of_core(number, release), size, release, self.common, number, imu, self.texts)
            for number, imu, size in zip(numbers, imu_of_core, sizes)
        ]
        self._count = count
        self.primary = self.chosen_by_user()
        self.error_scores = [0.0] * len(self.cores)
        self.relative_errors = [0.0] * len(self.cores)
        self._yaw_resets = [0] * len(self.cores)
        self._yaw_reset_ms = [0] * len(self.cores)
        self._last_primary_us = [0] * len(self.cores)
        self._switched_ms = 0
        self.now_us = 0
        self._unhealthy_us = 0
        self._selects = False
        self._armed = False

    # Passes

    def advance(self, rows: list[float], first: int, end: int) -> int:
        """Run passes, up to the first after which somebody has to act.

        That is a pass in which a core has said something, has something to log or has set its yaw, or in which another
        core has become primary; or in which a sample has come to its end, if ``tells_outcomes``.

        Args:
            rows: inertial data, a row a pass, one after the other (`ekf_stub.core.imus`).
            first, end: the numbers of the first row to run and of the first not to run.

        Returns:
            The number of the row after the last that was run.
        """
        columns = self.imus.columns()
        for number in range(first, end):
            if self._run(rows, number * columns):
                return number + 1
        return end

    def _run(self, rows: list[float], at: int) -> bool:
        """Run a pass; return whether somebody has to act."""
        now_us, late = int(rows[at]), int(rows[at + 2])
        now_ms, flying_ms = now_us // 1000, int(rows[at + 1])
        self.now_us = now_us
        self.imus.read(rows, at)
        primary, acts = self.primary, False
        for i, core in enumerate(self.cores):
            core.run(self.imus, now_ms, flying_ms, late >> core.number & 1 != 0)
            if core.yaw_resets != self._yaw_resets[i]:
                self._yaw_resets[i], self._yaw_reset_ms[i] = core.yaw_resets, now_ms
                acts = True
            if core.logs_stillness or core.logs_tilt or (self.tells_outcomes and len(core.events.outcomes) > 0):
                acts = True
        self._armed = self.cores[0].inputs.armed
        if not self._selects:
            self._settle()
        self._select()
        return acts or self.primary != primary or len(self.texts) > 0

    # The primary core

    def chosen_by_user(self) -> int:
        """Return the number of the core that EK3_PRIMARY chooses."""
        wanted = int(self._params.PRIMARY)
        return wanted if 0 <= wanted < self._count else 0

    def _index_of(self, number: int) -> int:
        return number if len(self.cores) > 1 else 0

    @property
    def primary_filter(self) -> Core:
        """The filter of the primary core."""
        return self.cores[self._index_of(self.primary)]

    @property
    def yaw_reset_ms(self) -> int:
        """When yaw jumped last, by a reset of the primary core or as that changed (getLastYawResetAngle); 0 before."""
        return max(self._switched_ms, self._yaw_reset_ms[self._index_of(self.primary)])

    def _is_healthy(self, number: int) -> bool:
        core = self.cores[self._index_of(number)]
        return core.initialised and core.healthy(self.now_us // 1000)

    def unhealthy_reason(self, now_ms: int) -> str | None:
        """Return what is wrong with the first core that does not run well, None while all do (pre_arm_check)."""
        for i, core in enumerate(self.cores):
            if not (core.initialised and core.healthy(now_ms)):
                return f"EKF3 core {i} unhealthy" if core.gps.checks.good else core.gps.checks.reason or _INITIALISING
        return None

    def _settle(self) -> None:
        if not self._unhealthy_us or not self._is_healthy(self.primary):
            self._unhealthy_us = self.now_us
        self._selects = self.now_us - self._unhealthy_us > _SETTLED_US

    def _is_manual(self) -> bool:
        return not self._are_automatic and int(self._params.OPTIONS) & _MANUAL_LANE_SWITCH != 0

    def _select(self) -> None:
        if self._is_manual():
            self._switch(self.chosen_by_user())
        elif self._armed and self._selects and len(self.cores) > 1:
            self._select_in_flight()
        elif self._armed and self._selects and self.cores[0].stepped:
            self.error_scores[0] = self.cores[0].error_score()
        by_user = self.primary if self._armed else self.chosen_by_user()
        if self.primary != by_user and self._is_healthy(by_user):
            self.primary = by_user

    def _select_in_flight(self) -> None:
        for i, core in enumerate(self.cores):
            self.error_scores[i] = core.error_score()
        self._update_relative_errors()
        primary, best, is_better = self.primary, self.primary, False
        for i, core in enumerate(self.cores):
            may_be = i != primary and self.now_us - self._last_primary_us[i] > _NOT_PRIMARY_US
            if may_be and self._has_better_score(i, best):
                is_better = self.relative_errors[i] <= -_BETTER_BY or (
                    core.yaw.aligned and not self.cores[primary].yaw.aligned
                )
                best = i
        if best == primary:
            return
        if is_better or self.error_scores[primary] > _BAD_SCORE or not self._is_healthy(primary):
            self._switch(best)
            self.relative_errors = [0.0] * len(self.cores)
            self._last_primary_us[primary if self._are_automatic else self.primary] = self.now_us

    def _update_relative_errors(self) -> None:
        """Count against each core what it was worse than the primary one, and for it what it was much better."""
        threshold = larger(self._params.ERR_THRESH, _MIN_THRESHOLD)
        for i, score in enumerate(self.error_scores):
            error = score - self.error_scores[self.primary]
            if i != self.primary and (error > 0 or error < -threshold):
                self.relative_errors[i] = limited(
                    self.relative_errors[i] + error, -_MAX_RELATIVE_ERROR, _MAX_RELATIVE_ERROR
                )

    def _has_better_score(self, i: int, than: int) -> bool:
        """Return whether a core is better than another (coreBetterScore)."""
        if not self._is_healthy(i):
            return False
        new, old = self.cores[i], self.cores[than]
        if new.tilt_aligned != old.tilt_aligned:
            return new.tilt_aligned
        if new.yaw.aligned != old.yaw.aligned:
            return new.yaw.aligned
        return self.relative_errors[i] < self.relative_errors[than]

    def _switch(self, i: int) -> None:
        if i != self.primary:
            self.primary = i
            self._switched_ms = self.now_us // 1000
            self.texts.append(Text(-1, ev.LANE_SWITCH, (float(i), 0.0, 0.0)))

    def check_lane_switch(self) -> None:
        """Go over to a core that is much better, as the vehicle is about to give up (checkLaneSwitch)."""
        is_soon = self._switched_ms != 0 and self.now_us // 1000 - self._switched_ms < _BETWEEN_CHECKS_MS
        if self._is_manual() or is_soon or not self.primary_filter.initialised:
            return
        best, lowest = self.primary, self.primary_filter.error_score()
        for i, core in enumerate(self.cores):
            if i != self.primary and self._is_healthy(i) and core.is_aligned:
                score = core.error_score()
                if score < smaller(lowest, _GOOD_SCORE):
                    best, lowest = i, score
        self._switch(best)

    # What goes to all cores

    @property
    def origin(self) -> Location | None:
        """Where told positions count from, None until any core has an origin."""
        return self.common.place

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once; say whether it was set (setOriginLLH)."""
        if self.common.place is not None:
            self.texts.append(Text(-1, ev.ORIGIN_ALREADY_SET, ZERO))
            return False
        was_set = False
        for core in self.cores:
            if core.set_origin(origin):
                was_set = True
        return was_set

    def set_place(self, place: Location, accuracy_m: float, time_ms: int) -> bool:
        """Put the vehicle somewhere while it navigates without a position; say whether it was (setLatLng)."""
        was_put = False
        for core in self.cores:
            if core.set_place(place, accuracy_m, time_ms):
                was_put = True
        return was_put

    def reset_height_datum(self) -> bool:
        """Count heights from the present one, on the ground; say whether all do (resetHeightDatum)."""
        were_reset = True
        for core in self.cores:
            if not core.reset_height_datum():
                were_reset = False
        return were_reset

    def request_yaw_reset(self) -> None:
        """Ask for yaw to be reset by the velocity of GPS, within 5 s (requestYawReset)."""
        for core in self.cores:
            core.request_yaw_reset()
