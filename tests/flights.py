# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Flights of a synthetic vehicle other than a survey: a hover, and rounds in a room."""

import math

import numpy as np

from viso.companion.world.motion import FlightPath, gusts, nadir_survey
from viso.geometry.rotation import Array


def hover(height_m: float = 40.0, seed: int = 0) -> FlightPath:
    """Return a flight that is to stay where it is: it sways by some 0.3 m in 10 s, and leans against gusts."""
    rng = np.random.default_rng([seed, 8])
    rates, phases = rng.uniform(0.4, 0.8, 3), rng.uniform(0, 2 * math.pi, 3)
    heading = rng.uniform(-math.pi, math.pi)

    def position(t_s: Array) -> Array:
        sway = np.array([0.3, 0.3, 0.15]) * np.sin(rates * t_s[..., None] + phases)
        place: Array = sway + np.array([0.0, 0.0, height_m])
        return place

    def yaw(t_s: Array) -> Array:
        wavering: Array = heading + 0.02 * np.sin(0.5 * t_s)
        return wavering

    return FlightPath(position, yaw, gusts(rng, 0.03))


def room_tour(speed_m_s: float = 1.2, seed: int = 0) -> FlightPath:
    """Return rounds in a room, 4 m long and half as wide, 1.5 m above its floor, looking around."""
    rng = np.random.default_rng([seed, 9])
    course = nadir_survey(speed_m_s, 1.5, 4.0, seed)
    phase = rng.uniform(0, 2 * math.pi)

    def yaw(t_s: Array) -> Array:
        looking: Array = phase + 0.9 * np.sin(0.45 * t_s + phase)
        return looking

    def position(t_s: Array) -> Array:
        swaying: Array = course.position_w(t_s) + 0.2 * np.sin(0.9 * t_s + phase)[..., None] * np.array([0.0, 0.0, 1.0])
        return swaying

    return FlightPath(position, yaw, gusts(rng, 0.05))
