# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flight that a simulated camera sees, as the vehicle's own sensors feel it."""

from dataclasses import dataclass

from viso.companion.trials.scripted_flight import Flight, Vector
from viso.sensors.options import ImuOptions
from viso.sensors.script.legs import Motion, Trajectory
from viso.sensors.script.script import ScriptSource
from viso.sensors.script.script_file import Script
from viso.sensors.vectors import Three

_STILL: Three = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FlightLeg:
    """A whole flight as one leg of a script; its accelerations are those of its positions."""

    flight: Flight

    @property
    def duration_s(self) -> float:
        """From take-off to touch-down."""
        return self.flight.end_s - self.flight.start_s

    def at(self, t: float) -> Motion:
        """Return the motion t seconds after take-off, without the acceleration, for which nobody asks here."""
        time_s, flight = self.flight.start_s + t, self.flight
        pos, vel, rpy = flight.position_ned(time_s), flight.velocity_ned(time_s), flight.attitude_rpy_rad(time_s)
        return Motion(_three(pos), _three(vel), _STILL, _three(rpy))


def _three(vector: Vector) -> Three:
    x, y, z = vector.tolist()
    return x, y, z


def flight_source(flight: Flight, options: ImuOptions) -> ScriptSource:
    """Return the sensors of a vehicle that flies it, whether armed or not."""
    return ScriptSource(options, Script(Trajectory([FlightLeg(flight)], tilts=False), flight.start_s, 0.0))
