# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the estimator navigates, and by what (AP_NavEKF3/AP_NavEKF3_Control.cpp, setAidingMode)."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple

from ap_core.clock import NEVER

IN_USE_MS: Final = 7000
POSITION_LOST_MS: Final = 7000
POSITION_LOST_WITH_VELOCITY_MS: Final = 10_000
ALL_LOST_MS: Final = 15_000
RELATIVE_LOST_MS: Final = 5000


class AidingMode(Enum):
    """PV_AidingMode: at a constant position, by absolute position, or by relative motion."""

    NONE = "none"
    ABSOLUTE = "absolute"
    RELATIVE = "relative"


# In Python 3.11 it takes 0.1 us to look up a member of an enumeration.
ABSOLUTE: Final = AidingMode.ABSOLUTE
NO_AIDING: Final = AidingMode.NONE
RELATIVE: Final = AidingMode.RELATIVE


class Ready(NamedTuple):
    """Which measurements could start aiding now."""

    gps: bool
    ext_nav: bool
    odometry: bool
    flow: bool = False


@dataclass(slots=True)
class FusionTimes:
    """When measurements last passed their gates, in ms since boot; 0 counts as just after boot.

    FIRMWARE PARITY: the filter's own times do not wrap. The firmware's do, so that every 49.7 days what never was, or
    was long ago, counts as having just been.

    Position and velocity are those of whichever source is in use, and of none in particular.
    """

    pos: int = 0
    vel: int = 0
    height: int = 0
    odometry: int = 0
    flow: int = 0


class Aiding:
    """The mode, and which measurements count as lost.

    Attributes:
        mode: how the estimator navigates.
        pos_timeout: position is lost; cleared only as a mode is entered.
        vel_timeout: velocity is lost.
        position_is_lost: position has been lost for so long, in this frame, that GPS counts as not used.
        vel_aiding: something keeps velocity from drifting.
        times: when measurements last passed.
    """

    def __init__(self) -> None:
        self.mode = NO_AIDING
        self.vel_aiding = False
        self.pos_timeout = self.position_is_lost = False
        self.vel_timeout = True
        self.times = FusionTimes()

    def update(self, now_ms: int, ready: Callable[[], Ready], *, no_yaw_on_ground: bool) -> bool:
        """Choose the mode, once a frame, at the time of the last inertial data; say whether it changed.

        ``ready`` is asked only while something could start aiding. With ``no_yaw_on_ground`` the vehicle is disarmed
        and has no yaw source, so that it does not navigate.
        """
        before, self.position_is_lost = self.mode, False
        if no_yaw_on_ground:
            self.mode = NO_AIDING
        if self.mode is NO_AIDING:
            self._start(ready())
        elif self.mode is RELATIVE:
            self._check_relative(now_ms, ready())
        else:
            self._check_absolute(now_ms)
        if self.mode is before:
            return False
        self._enter(now_ms, by_flow=self.mode is RELATIVE and ready().flow)
        return True

    def quiet_until_ms(self, ready: Callable[[], Ready]) -> int | None:
        """Return until when, included, nothing changes unless a measurement comes; None if it may at any time."""
        if self.mode is ABSOLUTE:
            return self.times.pos + IN_USE_MS
        return None if self.mode is RELATIVE or any(ready()) else NEVER

    def _start(self, ready: Ready) -> None:
        if ready.gps or ready.ext_nav:
            self.mode = ABSOLUTE
        elif ready.flow or ready.odometry:
            self.mode = RELATIVE

    def _check_relative(self, now_ms: int, ready: Ready) -> None:
        if ready.gps or ready.ext_nav:
            self.mode = ABSOLUTE
        elif now_ms - max(self.times.odometry, self.times.flow) > RELATIVE_LOST_MS:
            self.mode = NO_AIDING

    def _check_absolute(self, now_ms: int) -> None:
        pos_ms, vel_ms = now_ms - self.times.pos, now_ms - self.times.vel
        flow_ms = now_ms - self.times.flow
        motion_used = min(now_ms - self.times.odometry, flow_ms) <= IN_USE_MS
        vel_used, pos_used = vel_ms <= IN_USE_MS, pos_ms <= IN_USE_MS
        aided = self.vel_aiding = pos_used or vel_used or motion_used
        if not aided and min(pos_ms, vel_ms, flow_ms) > ALL_LOST_MS:
            self.mode, self.position_is_lost = NO_AIDING, True
        elif not pos_used and pos_ms > (POSITION_LOST_WITH_VELOCITY_MS if aided else POSITION_LOST_MS):
            self.pos_timeout = self.position_is_lost = True
            self.vel_timeout = not (vel_used or motion_used)

    def _enter(self, now_ms: int, *, by_flow: bool) -> None:
        # Every change of mode resets the position, which ends its timeout; only a real velocity ends the other.
        self.pos_timeout = False
        self.vel_timeout = self.mode is not ABSOLUTE
        if self.mode is ABSOLUTE:
            self.times.vel = now_ms
        elif by_flow:
            self.times.flow = now_ms
        elif self.mode is RELATIVE:
            self.times.odometry = now_ms
        self.times.pos = now_ms
