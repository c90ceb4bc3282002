# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight that begins on the ground, for what has to be initialised there."""

import numpy as np

from viso.companion.world.motion import FlightPath
from viso.geometry.rotation import Array


def from_ground(
    flight: FlightPath, still_s: float = 10.0, climb_s: float = 10.0, ramp_s: float = 5.0, stand_m: float = 0.25
) -> FlightPath:
    """Return a flight that begins at rest on the ground, climbs, and then goes over into another one.

    Args:
        flight: the other one, from its time 0.
        still_s: how long the vehicle stands.
        climb_s: how long it climbs, straight up, to where the other flight begins.
        ramp_s: how long it takes to be on the other flight's speed.
        stand_m: height of the body's origin when standing.
    """
    cruise_s = still_s + climb_s

    def warped(t_s: Array) -> Array:
        return ramp_s * _risen((t_s - cruise_s) / ramp_s)

    def position(t_s: Array) -> Array:
        place = flight.position_w(warped(t_s))
        place[..., 2] -= (flight.position_w(np.zeros(1))[0, 2] - stand_m) * (1 - _step((t_s - still_s) / climb_s))
        return place

    def yaw(t_s: Array) -> Array:
        return flight.yaw_rad(warped(t_s))

    def lean(t_s: Array) -> Array:
        return flight.lean(t_s) * _step((t_s - still_s) / climb_s)[..., None]

    return FlightPath(position, yaw, lean)


def _step(x: Array) -> Array:
    """Return 0 below 0, 1 above 1 and between them a rise whose first four derivatives vanish at both ends."""
    x = np.clip(x, 0.0, 1.0)
    risen: Array = x**5 * (126 + x * (-420 + x * (540 + x * (-315 + 70 * x))))
    return risen


def _risen(x: Array) -> Array:
    """Return the integral of :func:`_step` from 0."""
    inside = np.clip(x, 0.0, 1.0)
    area = inside**6 * (21 + inside * (-60 + inside * (67.5 + inside * (-35 + 7 * inside))))
    risen: Array = area + np.maximum(x - 1.0, 0.0)
    return risen
