# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GUIDED: to the targets of a companion (ArduCopter/mode_guided.cpp)."""

from mav_handlers.handlers.commands.flight import GuidedTarget
from viso.vehicle.copter.flying.steering import PERIOD_S, Lean, Steering


class Guided:
    """Flies to a place, or at a velocity or acceleration as long as it is repeated; else it stays."""

    def __init__(self, steering: Steering) -> None:
        self._steering = steering
        self._target: GuidedTarget | None = None
        self._target_us = 0
        self._place: tuple[float, float, float] | None = None
        self._down_m: float | None = None

    def enter(self) -> None:
        """Stay until there is a target."""
        self._target = self._place = self._down_m = None
        self._steering.heading.hold()

    def stay_at_height(self, down_m: float) -> None:
        """Stay at a height, m below the origin, to which the vehicle has taken off."""
        self._down_m = down_m

    def guide(self, target: GuidedTarget) -> None:
        """Obey a target."""
        self._target, self._target_us = target, self._steering.now_us
        self._place, self._down_m = target.pos_ned_m, None
        self._look(target)

    def _look(self, target: GuidedTarget) -> None:
        heading = self._steering.heading
        if target.yaw_rad is not None:
            heading.turn_to(target.yaw_rad, is_relative=target.is_yaw_relative)
        elif target.yaw_rate_rad_s is not None:
            heading.turn_at(target.yaw_rate_rad_s)
        elif self._steering.limits.wp_yaw_behavior:
            heading.along_course()
        else:
            heading.hold()

    def run(self) -> Lean | None:
        """Go on for a period."""
        steering, target = self._steering, self._target
        way, pace = steering.way, steering.travel_pace()
        is_late = steering.now_us - self._target_us > 1e6 * steering.limits.guid_timeout
        if is_late:
            steering.heading.stop_turning()
        moves = target is not None and not is_late and (target.vel_ned_m_s or target.acc_ned_m_s2)
        steering.destination = self._place
        if self._place is not None:
            if moves and target is not None and target.vel_ned_m_s is not None:  # the place moves on with it
                north, east, down = (
                    at + PERIOD_S * speed for at, speed in zip(self._place, target.vel_ned_m_s, strict=True)
                )
                self._place = north, east, down
            way.to_place(self._place[0], self._place[1], pace, PERIOD_S)
            way.to_height(self._place[2], pace, PERIOD_S)
        elif moves and target is not None:
            north, east, down = target.vel_ned_m_s or way.vel
            if target.vel_ned_m_s is None and target.acc_ned_m_s2 is not None:
                north, east, down = (
                    speed + PERIOD_S * acc for speed, acc in zip(way.vel, target.acc_ned_m_s2, strict=True)
                )
            way.at_velocity(north, east, pace, PERIOD_S)
            way.climb(-down, pace, PERIOD_S)
        else:
            way.at_velocity(0.0, 0.0, pace, PERIOD_S)
            if self._down_m is None:
                way.climb(0.0, pace, PERIOD_S)
            else:
                way.to_height(self._down_m, pace, PERIOD_S)
        return None
