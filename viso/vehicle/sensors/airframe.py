# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A point mass with a thrust along its vertical axis: how a multicopter moves, of no airframe in particular.

Lean angles, rate of turn and thrust follow what is demanded with a lag each. Air slows it in proportion to its speed.
The ground is level, at the height where it stood at first: springy legs, and friction.
"""

import math
from typing import Final, NamedTuple

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import quat_of_euler, scaled
from ekf_stub.inputs.measurements import InertialDelta
from viso.vehicle.sensors.motion import Moving, State, Truth, delta_between
from viso.vehicle.sensors.vectors import ZERO, Three, added

LEAN_LAG_S: Final = 0.1
THRUST_LAG_S: Final = 0.05
TURN_LAG_S: Final = 0.1
DRAG_PER_S: Final = 0.15
MOST_THRUST_M_S2: Final = 2.0 * GRAVITY_MSS
LEGS_RAD_S: Final = 20.0
"""Natural frequency of the vehicle on its legs, which are damped critically."""
FRICTION_PER_S: Final = 10.0
STILL_M_S: Final = 1e-3
CONTACT_M: Final = GRAVITY_MSS / LEGS_RAD_S**2
"""Legs bear the vehicle at height 0, and touch the ground up to this height."""


class Demand(NamedTuple):
    """What a flight controller demands: lean angles in rad, thrust in m/s/s, rate of turn to the right in rad/s."""

    roll: float = 0.0
    pitch: float = 0.0
    thrust_m_s2: float = 0.0
    turn_rad_s: float = 0.0


MOTORS_OFF: Final = Demand()


class AirframeState(NamedTuple):
    """Where it is: m and m/s (NED) from where it stood, roll, pitch and yaw in rad, thrust and rate of turn."""

    pos: Three = ZERO
    vel: Three = ZERO
    rpy: Three = ZERO
    thrust_m_s2: float = 0.0
    turn_rad_s: float = 0.0

    def seen(self) -> State:
        """Return the motion alone."""
        return State(self.pos, self.vel, quat_of_euler(*self.rpy), self.rpy[2])

    def is_on_ground(self) -> bool:
        """Return whether its legs touch the ground."""
        return -self.pos[2] < CONTACT_M

    def is_at_rest(self) -> bool:
        """Return whether it stands still with its motors off, and would for ever."""
        return self.is_on_ground() and max(map(abs, self.vel)) == self.thrust_m_s2 == self.turn_rad_s == 0.0


def moved(state: AirframeState, demand: Demand, dt_s: float) -> AirframeState:
    """Return the state after an interval, which is to be short, with a demand in force all the while."""
    lean = 1.0 - math.exp(-dt_s / LEAN_LAG_S)
    on_ground = state.is_on_ground()
    turn_rad_s = state.turn_rad_s + (1.0 - math.exp(-dt_s / TURN_LAG_S)) * (demand.turn_rad_s - state.turn_rad_s)
    thrust = min(max(demand.thrust_m_s2, 0.0), MOST_THRUST_M_S2)
    thrust = state.thrust_m_s2 + (1.0 - math.exp(-dt_s / THRUST_LAG_S)) * (thrust - state.thrust_m_s2)
    if on_ground and thrust < 0.5 * GRAVITY_MSS:
        turn_rad_s = 0.0
    roll, pitch, yaw = state.rpy
    # The legs keep it level.
    roll += lean * ((0.0 if on_ground else demand.roll) - roll)
    pitch += lean * ((0.0 if on_ground else demand.pitch) - pitch)
    yaw = math.remainder(yaw + turn_rad_s * dt_s, 2.0 * math.pi)
    acc = added(scaled(_up_axis(roll, pitch, yaw), thrust), state.vel, -DRAG_PER_S)
    acc = added(acc, (0.0, 0.0, GRAVITY_MSS))
    if on_ground:
        bearing = max(0.0, GRAVITY_MSS + LEGS_RAD_S * (LEGS_RAD_S * state.pos[2] + 2.0 * state.vel[2]))
        acc = added(acc, (-FRICTION_PER_S * state.vel[0], -FRICTION_PER_S * state.vel[1], -bearing))
    vel = added(state.vel, acc, dt_s)
    pos = added(state.pos, added(state.vel, vel), 0.5 * dt_s)
    after = AirframeState(pos, vel, (roll, pitch, yaw), thrust, turn_rad_s)
    return _settled(after) if on_ground and not demand.thrust_m_s2 else after


def _up_axis(roll: float, pitch: float, yaw: float) -> Three:
    """Return the direction, NED, in which an attitude's thrust is."""
    sin_roll, cos_roll, sin_pitch = math.sin(roll), math.cos(roll), math.sin(pitch)
    sin_yaw, cos_yaw = math.sin(yaw), math.cos(yaw)
    return (
        -(cos_roll * sin_pitch * cos_yaw + sin_roll * sin_yaw),
        -(cos_roll * sin_pitch * sin_yaw - sin_roll * cos_yaw),
        -cos_roll * math.cos(pitch),
    )


def _settled(state: AirframeState) -> AirframeState:
    """Return a state on the ground with motors off, at rest as soon as nearly so."""
    if max(map(abs, state.vel)) > STILL_M_S or abs(state.pos[2]) > STILL_M_S or state.thrust_m_s2 > STILL_M_S:
        return state
    return AirframeState((*state.pos[:2], 0.0), ZERO, (0.0, 0.0, state.rpy[2]))


NOMINAL_US: Final = 2500
LONGEST_STEP_US: Final = 5000
LONGEST_US: Final = 100_000
"""An interval between two passes counts as no longer: the vehicle stood still while its computer did."""


class Airframe(Moving[AirframeState]):
    """A vehicle that moves as is demanded; it stands on the ground until a thrust is demanded."""

    def __init__(self, heading_rad: float) -> None:
        super().__init__(AirframeState(rpy=(0.0, 0.0, heading_rad)))
        self._demand = MOTORS_OFF
        self._delta = delta_between(self.state.seen(), self.state.seen(), 1e-6 * NOMINAL_US)
        self._at_rest: tuple[AirframeState, int, InertialDelta] = (self.state, NOMINAL_US, self._delta)

    def demand(self, demand: Demand) -> None:
        """Set the demand from now on."""
        if demand != self._demand:
            self._demand = demand
            self.think_again()

    def moved(self, state: AirframeState, last_us: int | None, now_us: int) -> tuple[AirframeState, InertialDelta]:
        """Return the state at a time, from that of the pass before, and what ideal inertial sensors feel of it."""
        interval_us = NOMINAL_US if last_us is None else min(now_us - last_us, LONGEST_US)
        if state.is_at_rest() and not self._demand.thrust_m_s2:
            return state, self._delta_at_rest(state, interval_us)
        after, steps = state, -(-interval_us // LONGEST_STEP_US)
        for _ in range(steps):
            after = moved(after, self._demand, 1e-6 * interval_us / steps)
        return after, delta_between(state.seen(), after.seen(), 1e-6 * interval_us)

    def _delta_at_rest(self, state: AirframeState, interval_us: int) -> InertialDelta:
        """Return what ideal inertial sensors feel in an interval of a vehicle at rest; each is worked out once."""
        if self._at_rest[:2] != (state, interval_us):
            seen = state.seen()
            self._at_rest = state, interval_us, delta_between(seen, seen, 1e-6 * interval_us)
        return self._at_rest[2]

    def go_to(self, now_us: int) -> InertialDelta:
        """Move on to a time since boot, later than the last; return what ideal inertial sensors feel of it."""
        self._delta = super().go_to(now_us)
        return self._delta

    def is_at_rest(self) -> bool:
        """Return whether it stands still with its motors off."""
        return self.state.is_at_rest() and not self._demand.thrust_m_s2

    def felt(self) -> tuple[Three, Three]:
        """Return the data of ideal inertial sensors in the last pass: m/s/s and rad/s, body (FRD)."""
        force, rates = self._delta.del_vel / self._delta.del_vel_dt, self._delta.del_ang / self._delta.del_ang_dt
        return (*force.tolist(),), (*rates.tolist(),)

    def truth(self) -> Truth:
        """Return where the vehicle really is, as of the last pass."""
        return self.state.seen().truth()
