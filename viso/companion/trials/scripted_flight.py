# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A scripted flight: where a vehicle is, and how it moves, at any time."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Flight:
    """Take-off, one figure of eight, landing; at rest before and after. Position and velocity are continuous.

    Attributes:
        start_s: take-off.
        climb_s: duration of take-off, and of landing.
        loop_s: duration of the figure of eight.
        height_m: height of the figure above the ground.
        size_m: its half width, north and east.
        heading_rad: yaw, kept all the time.
    """

    start_s: float
    climb_s: float = 4.0
    loop_s: float = 24.0
    height_m: float = 3.0
    size_m: tuple[float, float] = (4.0, 2.5)
    heading_rad: float = 0.0

    @property
    def end_s(self) -> float:
        """When the vehicle is on the ground again."""
        return self.start_s + 2 * self.climb_s + self.loop_s

    def position_ned(self, time_s: float) -> Vector:
        """Return the position in metres NED from the place of take-off."""
        phase = _smooth_step((time_s - self.start_s - self.climb_s) / self.loop_s) * 2 * math.pi
        up = _smooth_step((time_s - self.start_s) / self.climb_s)
        down = _smooth_step((time_s - self.end_s + self.climb_s) / self.climb_s)
        north, east = self.size_m
        return np.array([north * math.sin(phase), east * math.sin(2 * phase), -self.height_m * (up - down)])

    def velocity_ned(self, time_s: float) -> Vector:
        """Return the velocity in m/s NED, by central difference."""
        step_s = 1e-4
        ahead, behind = self.position_ned(time_s + step_s), self.position_ned(time_s - step_s)
        return (ahead - behind) / (2 * step_s)

    def attitude_rpy_rad(self, time_s: float) -> Vector:
        """Return roll, pitch and yaw in rad: the vehicle leans into its acceleration, as a multicopter does."""
        step_s = 1e-2
        ahead, behind = self.velocity_ned(time_s + step_s), self.velocity_ned(time_s - step_s)
        acceleration = (ahead - behind) / (2 * step_s)
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        forward = cos * acceleration[0] + sin * acceleration[1]
        right = -sin * acceleration[0] + cos * acceleration[1]
        gravity = 9.80665
        return np.array([math.atan2(right, gravity), math.atan2(-forward, gravity), self.heading_rad])


def _smooth_step(x: float) -> float:
    """Return 0 below 0, 1 above 1 and between them a rise whose first two derivatives vanish at both ends."""
    x = min(max(x, 0.0), 1.0)
    return x * x * x * (x * (6 * x - 15) + 10)
