# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the filter navigates, and by what (AP_NavEKF3/AP_NavEKF3_Control.cpp, setAidingMode)."""

from typing import Final, final

# PV_AidingMode: by absolute position, at a constant position, or by relative motion.
NO_AIDING: Final = 0
ABSOLUTE: Final = 1
RELATIVE: Final = 2

_IN_USE_MS: Final = 7000
_POSITION_LOST_MS: Final = 7000
_POSITION_LOST_WITH_VELOCITY_MS: Final = 10_000
_ALL_LOST_MS: Final = 15_000
_RELATIVE_LOST_MS: Final = 5000


@final
class Ready:
    """Which measurements could start aiding now."""

    def __init__(self, gps: bool, ext_nav: bool, odometry: bool, flow: bool) -> None:
        self.gps = gps
        self.ext_nav = ext_nav
        self.odometry = odometry
        self.flow = flow


@final
class Aiding:
    """The mode, when measurements last passed their gates, and which count as lost.

    Times are ms since boot; 0 counts as just after boot. Position and velocity are those of whichever source is in use.

    FIRMWARE PARITY: the filter's own times do not wrap. The firmware's do, so that every 49.7 days what never was, or
    was long ago, counts as having just been.

    Attributes:
        mode: how the filter navigates.
        pos_timeout: position is lost; cleared only as a mode is entered.
        vel_timeout: velocity is lost.
        position_is_lost: position has been lost for so long, in this pass, that GPS counts as not used.
        vel_aiding: something keeps velocity from drifting.
        pos_ms, vel_ms, height_ms, odometry_ms, flow_ms: when each last passed its gate.
    """

    def __init__(self, now_ms: int) -> None:
        self.mode = NO_AIDING
        self.vel_aiding = False
        self.pos_timeout = False
        self.position_is_lost = False
        self.vel_timeout = True
        self.pos_ms = now_ms
        self.height_ms = now_ms
        self.vel_ms = 0
        self.odometry_ms = 0
        self.flow_ms = 0

    def update(self, now_ms: int, ready: Ready, no_yaw_on_ground: bool) -> bool:
        """Choose the mode, once a pass, at the time of the last inertial data; say whether it changed.

        With ``no_yaw_on_ground`` the vehicle is disarmed and has no yaw source, so that it does not navigate.
        """
        before = self.mode
        self.position_is_lost = False
        if no_yaw_on_ground:
            self.mode = NO_AIDING
        if self.mode == ABSOLUTE:
            self._check_absolute(now_ms)
        elif ready.gps or ready.ext_nav:
            self.mode = ABSOLUTE
        elif self.mode == NO_AIDING:
            if ready.flow or ready.odometry:
                self.mode = RELATIVE
        elif now_ms - max(self.odometry_ms, self.flow_ms) > _RELATIVE_LOST_MS:
            self.mode = NO_AIDING
        if self.mode == before:
            return False
        self._enter(now_ms, self.mode == RELATIVE and ready.flow)
        return True

    def _check_absolute(self, now_ms: int) -> None:
        pos_ms, vel_ms, flow_ms = now_ms - self.pos_ms, now_ms - self.vel_ms, now_ms - self.flow_ms
        motion_used = min(now_ms - self.odometry_ms, flow_ms) <= _IN_USE_MS
        vel_used, pos_used = vel_ms <= _IN_USE_MS, pos_ms <= _IN_USE_MS
        aided = pos_used or vel_used or motion_used
        self.vel_aiding = aided
        if not aided and min(pos_ms, vel_ms, flow_ms) > _ALL_LOST_MS:
            self.mode = NO_AIDING
            self.position_is_lost = True
        elif not pos_used and pos_ms > (_POSITION_LOST_WITH_VELOCITY_MS if aided else _POSITION_LOST_MS):
            self.pos_timeout = True
            self.position_is_lost = True
            self.vel_timeout = not (vel_used or motion_used)

    def _enter(self, now_ms: int, by_flow: bool) -> None:
        # Every change of mode resets the position, which ends its timeout; only a real velocity ends the other.
        self.pos_timeout = False
        self.vel_timeout = self.mode != ABSOLUTE
        if self.mode == ABSOLUTE:
            self.vel_ms = now_ms
        elif by_flow:
            self.flow_ms = now_ms
        elif self.mode == RELATIVE:
            self.odometry_ms = now_ms
        self.pos_ms = now_ms


@final
class Vehicle:
    """What the filter knows of the vehicle.

    Attributes:
        armed: as it says.
        on_ground, in_flight: each surely so; both may be False.
        near_ground: take-off or touch-down is expected, and with it a wrong air pressure.
        tilt_aligned: roll and pitch are known.
    """

    def __init__(self) -> None:
        self.armed = False
        self.on_ground = True
        self.in_flight = False
        self.near_ground = False
        self.tilt_aligned = False
