# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vehicle looks (ArduCopter/autoyaw.cpp)."""

import math
from enum import Enum
from typing import Final

TURN: Final = 2.0 * math.pi
GAIN_PER_S: Final = 3.0
JUMP_RAD: Final = math.radians(5.0)
"""An estimate that turns so much at once was reset."""
NEAR_RAD: Final = math.radians(2.0)
LOOK_AHEAD_ABOVE_M_S: Final = 0.3


class _How(Enum):
    HOLD = "hold"
    COURSE = "course"
    ANGLE = "angle"
    RATE = "rate"


class Heading:
    """Turns to a heading, at a rate, or into the direction of flight; ``rad`` is where it is to look now."""

    def __init__(self) -> None:
        self.rad = 0.0
        self._how = _How.HOLD
        self._left_rad = 0.0
        self._slew_rad_s = math.inf
        self._rate_rad_s = 0.0
        self._last_rad: float | None = None

    def hold(self) -> None:
        """Look where it is looking."""
        self._how = _How.HOLD

    def along_course(self) -> None:
        """Look where it is going."""
        self._how = _How.COURSE

    def turn_to(
        self, yaw_rad: float, slew_rad_s: float = 0.0, direction: int = 0, *, is_relative: bool = False
    ) -> None:
        """Turn to a heading, or by an angle (Mode::AutoYaw::set_fixed_yaw_rad).

        Args:
            yaw_rad: the heading, or the angle.
            slew_rad_s: how fast, 0 as fast as the vehicle may.
            direction: 1 to the right, -1 to the left, 0 the shorter way.
            is_relative: whether it is an angle.
        """
        if is_relative:
            self._left_rad = -yaw_rad if direction < 0 else yaw_rad
        else:
            self._left_rad = math.remainder(yaw_rad - self.rad, TURN)
            if direction * self._left_rad < 0:
                self._left_rad += direction * TURN
        self._how, self._slew_rad_s = _How.ANGLE, slew_rad_s or math.inf

    def has_turned(self, yaw_rad: float) -> bool:
        """Return whether the vehicle looks where it was to turn to, and see to it (reached_fixed_yaw_target)."""
        self._how = _How.ANGLE
        return not self._left_rad and abs(math.remainder(self.rad - yaw_rad, TURN)) <= NEAR_RAD

    def turn_at(self, rate_rad_s: float) -> None:
        """Keep turning, to the right."""
        self._how, self._rate_rad_s = _How.RATE, rate_rad_s

    def stop_turning(self) -> None:
        """Hold the heading if it was turning at a rate."""
        if self._how is _How.RATE:
            self.hold()

    def restart(self, yaw_rad: float) -> None:
        """Look where the vehicle looks."""
        self.rad, self._last_rad = yaw_rad, yaw_rad
        self.hold()

    def rate(self, yaw_rad: float, vel_ne: tuple[float, float], slew_rad_s: float, dt_s: float) -> float:
        """Return how fast to turn now, rad/s to the right.

        Args:
            yaw_rad: where it looks by the estimate.
            vel_ne: where it is going, m/s.
            slew_rad_s: how fast it may turn to a heading.
            dt_s: since the last time.
        """
        if self._last_rad is not None:
            jump = math.remainder(yaw_rad - self._last_rad, TURN)
            if abs(jump) > JUMP_RAD:
                self.rad = math.remainder(self.rad + jump, TURN)
        self._last_rad = yaw_rad
        before = self.rad
        if self._how is _How.RATE:
            self.rad += self._rate_rad_s * dt_s
        elif self._how is _How.ANGLE:
            most = min(slew_rad_s, self._slew_rad_s) * dt_s
            turn = min(max(self._left_rad, -most), most)
            self._left_rad -= turn
            self.rad += turn
        elif self._how is _How.COURSE and math.hypot(*vel_ne) > LOOK_AHEAD_ABOVE_M_S:
            most = slew_rad_s * dt_s
            turn = math.remainder(math.atan2(vel_ne[1], vel_ne[0]) - self.rad, TURN)
            self.rad += min(max(turn, -most), most)
        ahead_rad_s = (self.rad - before) / dt_s
        self.rad = math.remainder(self.rad, TURN)
        return ahead_rad_s + GAIN_PER_S * math.remainder(self.rad - yaw_rad, TURN)
