# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight through the companion's world, as the vehicle's own sensors feel it."""

import math
from typing import Final

import numpy as np

from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.companion.world.motion import FlightPath
from viso.geometry.rotation import Array, euler_from_rotations
from viso.vehicle.sensors.script.legs import Motion, ScriptedPath
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.script.script_file import Script
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.vectors import Three

_RATE_HZ: Final = 400  # of the main loop
_STILL: Final[Three] = (0.0, 0.0, 0.0)


class WorldFlight:
    """A trajectory of the world (ENU, FLU), at rest at its time 0, as NED from where it begins, in FRD axes."""

    def __init__(self, trajectory: FlightPath) -> None:
        self._trajectory = trajectory
        self._start_w = trajectory.position_w(np.zeros(1))[0]

    def at(self, t_s: Array) -> tuple[Array, Array, Array]:
        """Return positions [N, 3] in m, velocities [N, 3] in m/s and attitudes [N, 3, 3], body to NED, at times [N]."""
        motion, to_ned = self._trajectory.motion(t_s), ENU_TO_NED
        rotation = np.einsum("ij,njk,kl->nil", to_ned, motion.rotation_wb, FLU_TO_FRD)
        return (motion.position_w - self._start_w).dot(to_ned.T), motion.velocity_w.dot(to_ned.T), rotation


class WorldLeg:
    """A flight as the one leg of a script, without end; its accelerations are those of its positions."""

    duration_s: Final = math.inf

    def __init__(self, flight: WorldFlight) -> None:
        self._flight = flight
        self._second = -1
        self._motions: list[Motion] = []

    def at(self, t: float) -> Motion:
        """Return the motion t seconds after the start, without the acceleration, which is not used here."""
        tick = round(t * _RATE_HZ)
        if abs(t * _RATE_HZ - tick) > 1e-6 or tick < 0:
            return self._motions_at(np.array([t]))[0]
        second, number = divmod(tick, _RATE_HZ)
        if second != self._second:  # a second at once is much faster than its passes one by one
            self._motions = self._motions_at((second * _RATE_HZ + np.arange(_RATE_HZ)) / _RATE_HZ)
            self._second = second
        return self._motions[number]

    def _motions_at(self, t_s: Array) -> list[Motion]:
        pos, vel, rotation = self._flight.at(t_s)
        rows = zip(pos.tolist(), vel.tolist(), euler_from_rotations(rotation).tolist(), strict=True)
        return [Motion((*p,), (*v,), _STILL, (*angles,)) for p, v, angles in rows]


def flight_source(trajectory: FlightPath, start_s: float, options: ImuOptions) -> ScriptSource:
    """Return the sensors of a vehicle that flies it, whether armed or not.

    Args:
        trajectory: at rest at its time 0.
        start_s: its time 0, in seconds since boot; the vehicle stands still before.
        options: compass and errors.
    """
    leg = WorldLeg(WorldFlight(trajectory))
    return ScriptSource(options, Script(ScriptedPath([leg], tilts=False), start_s, 0.0))
