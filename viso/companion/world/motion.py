# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Flights of a multicopter in ENU: smooth functions of time, from which its attitude, rates and forces follow.

A flight is a position, a yaw and a lean; all else is derived, so that an IMU on board agrees with it: the thrust points
along the acceleration less gravity, against the drag, and a little to the side as in gusts.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.vio.frames import GRAVITY_MSS
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

Curve = Callable[[Array], Array]

_UP: Final = np.array([0.0, 0.0, GRAVITY_MSS])
DRAG_PER_S: Final = 0.12
_FIGURE_S: Final = 15.0  # flying time of the default extent of a survey, unless that takes sharper turns than
_FIGURE_M_S2: Final = 0.8  # this, as the square of the speed by the extent: 3.2 m/s^2 at most

# Central differences of order 8 (Fornberg 1988) for smooth functions: exact to 1e-9 of what an IMU can tell.
_STEP_S: Final = 0.01
_OFFSETS_S: Final = _STEP_S * np.arange(-4, 5)
_FIRST: Final = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / _STEP_S
_SECOND: Final = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]) / _STEP_S**2


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion of a vehicle at N times.

    Attributes:
        t_s: [N].
        position_w: [N, 3] in m, ENU.
        velocity_w: [N, 3] in m/s, ENU.
        rotation_wb: [N, 3, 3], from the body (FLU) to ENU.
        rates_b: [N, 3] in rad/s, of the body against the world.
        specific_force_b: [N, 3] in m/s^2, what a perfect accelerometer shows.
    """

    t_s: Array
    position_w: Array
    velocity_w: Array
    rotation_wb: Array
    rates_b: Array
    specific_force_b: Array


@dataclass(frozen=True, slots=True)
class FlightPath:
    """A flight as functions of an array of times in s, each defined (and smooth) at all times.

    Attributes:
        position_w: to [..., 3] in m, ENU.
        yaw_rad: to [...], continuous, ENU.
        lean: to [..., 2], the shares of gravity by which the thrust points aside, east and north.
    """

    position_w: Curve
    yaw_rad: Curve
    lean: Curve

    def motion(self, t_s: Array) -> Motion:
        """Return the vehicle's motion at times [N]."""
        t_s = np.atleast_1d(np.asarray(t_s, np.float64))
        around = t_s[:, None] + _OFFSETS_S
        rotation = self._rotation(t_s)
        # R' is R times the skew matrix of the body's rates.
        spin = np.einsum("nji,nkjl,k->nil", rotation, self._rotation(around), _FIRST)
        rates = 0.5 * np.stack(
            [spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0], spin[:, 1, 0] - spin[:, 0, 1]], axis=-1
        )
        velocity, acceleration = self._derivatives(t_s)
        force = np.einsum("nji,nj->ni", rotation, acceleration + _UP)
        return Motion(t_s, self.position_w(t_s), velocity, rotation, rates, force)

    def pose(self, t_s: float) -> SE3:
        """Return world_T_body at a time."""
        at = np.array([t_s])
        return SE3(self._rotation(at)[0], self.position_w(at)[0])

    def velocity_w(self, t_s: float) -> Array:
        """Return the velocity [3] in m/s, ENU, at a time."""
        velocity: Array = self._derivatives(np.array([t_s]))[0][0]
        return velocity

    def _derivatives(self, t_s: Array) -> tuple[Array, Array]:
        around = self.position_w(t_s[..., None] + _OFFSETS_S)
        return np.einsum("...ki,k->...i", around, _FIRST), np.einsum("...ki,k->...i", around, _SECOND)

    def _rotation(self, t_s: Array) -> Array:
        velocity, acceleration = self._derivatives(t_s)
        up = acceleration + _UP + DRAG_PER_S * velocity
        up[..., :2] += GRAVITY_MSS * self.lean(t_s)
        up /= np.linalg.norm(up, axis=-1, keepdims=True)
        yaw = self.yaw_rad(t_s)
        ahead = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
        forward = ahead * up[..., 2:]  # the one across the thrust that has the yaw
        forward[..., 2] -= np.sum(ahead * up, axis=-1)
        forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
        return np.stack([forward, np.cross(up, forward), up], axis=-1)


def nadir_survey(
    speed_m_s: float = 8.0, height_m: float = 40.0, extent_m: float | None = None, seed: int = 0
) -> FlightPath:
    """Return a flight along a figure of eight, nose ahead, the height a little up and down; in full flight at time 0.

    Args:
        speed_m_s: on average; a round is not flown at one speed.
        height_m: above the ground.
        extent_m: length of the figure, which is half as wide; None for 15 s of flight, more above 12 m/s.
        seed: of the figure's direction, its start, and the gusts.
    """
    rng = np.random.default_rng([seed, 1])
    default_m = speed_m_s * max(_FIGURE_S, speed_m_s / _FIGURE_M_S2)
    half = 0.5 * (default_m if extent_m is None else extent_m)
    turn, start, sway = rng.uniform(0, 2 * math.pi, 3)
    cos, sin = math.cos(turn), math.sin(turn)
    rate = speed_m_s / (half * _mean_slope())

    def phase(t_s: Array) -> Array:
        turned: Array = rate * t_s + start
        return turned

    def position(t_s: Array) -> Array:
        along, over = half * np.sin(phase(t_s)), 0.5 * half * np.sin(2 * phase(t_s))
        up = height_m * (1 + 0.035 * np.sin(0.35 * t_s + sway))
        place: Array = np.stack([cos * along - sin * over, sin * along + cos * over, up], axis=-1)
        return place

    def yaw(t_s: Array) -> Array:
        course: Array = turn + _course(phase(t_s))
        return course

    return FlightPath(position, yaw, gusts(rng, 0.05))


def _mean_slope() -> float:
    """Return the mean speed of the figure of eight of half length 1 at a phase rate of 1."""
    phase = np.linspace(0, 2 * math.pi, 1000, endpoint=False)
    return float(np.hypot(np.cos(phase), np.cos(2 * phase)).mean())


def _course(phase: Array) -> Array:
    """Return the course of the figure of eight, without jumps: it swings by 135 degrees about -90."""
    course: Array = np.arctan2(np.cos(phase), -np.cos(2 * phase)) - 0.5 * math.pi
    return course


def gusts(rng: np.random.Generator, size: float) -> Curve:
    """Return a lean against gusts, which are some ``size`` of gravity strong."""
    rates = rng.uniform((0.8, 0.7, 3.5, 3.5), (1.2, 1.1, 5.0, 5.0))
    phases = rng.uniform(0, 2 * math.pi, 4)

    def lean(t_s: Array) -> Array:
        waves = np.sin(rates * t_s[..., None] + phases)
        blown: Array = size * (waves[..., :2] + 0.3 * waves[..., 2:])
        return blown

    return lean
