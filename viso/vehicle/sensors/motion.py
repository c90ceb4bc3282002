# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a vehicle moves, and what ideal inertial sensors feel of it."""

from abc import ABC, abstractmethod
from collections import deque
from typing import Generic, NamedTuple, TypeVar

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import Quat
from ekf_stub.inputs.measurements import InertialDelta
from viso.vehicle.sensors.errors import exact_delta
from viso.vehicle.sensors.vectors import Three, added, halfway, rotation_between, to_body

S = TypeVar("S")


class Truth(NamedTuple):
    """Where a vehicle really is: m and m/s (NED), attitude (body to earth)."""

    pos_ned: Three
    vel_ned: Three
    quat_wxyz: Quat


class State(NamedTuple):
    """Position and velocity in m and m/s, NED, attitude (body to earth), and yaw in rad, full turns counted."""

    pos: Three
    vel: Three
    quat: Quat
    yaw_rad: float

    def truth(self) -> Truth:
        """Return it in the form for other rooms."""
        return Truth(self.pos, self.vel, self.quat)


def delta_between(before: State, now: State, dt: float) -> InertialDelta:
    """Return what inertial sensors feel from one state to another, in ``dt`` seconds."""
    north, east, down = added(now.vel, before.vel, -1.0)
    del_vel = to_body(halfway(before.quat, now.quat), (north, east, down - GRAVITY_MSS * dt))
    return exact_delta(del_vel, rotation_between(before.quat, now.quat), dt)


class Moving(ABC, Generic[S]):
    """Something that moves.

    Attributes:
        state: where it is and how it moves, as of the last pass; it is replaced, never changed.
        last_us: when that was, since boot; None before the first one.
    """

    def __init__(self, state: S) -> None:
        self.state = state
        self.last_us: int | None = None
        self._coming: deque[tuple[int, S, InertialDelta]] = deque()

    @abstractmethod
    def moved(self, state: S, last_us: int | None, now_us: int) -> tuple[S, InertialDelta]:
        """Return the state at a time, from that of the pass before, and what ideal inertial sensors feel of it.

        ``last_us`` is None for the first pass.
        """

    def go_to(self, now_us: int) -> InertialDelta:
        """Move on to a time since boot, later than the last; return what ideal inertial sensors feel of it."""
        if self._coming and self._coming[0][0] == now_us:
            _, self.state, delta = self._coming.popleft()
        else:
            self._coming.clear()
            self.state, delta = self.moved(self.state, self.last_us, now_us)
        self.last_us = now_us
        return delta

    def ahead(self, times_us: range) -> list[InertialDelta]:
        """Return what ``go_to`` will return at times, unless it hears of something else before."""
        coming = self._coming
        if any(one[0] != time_us for one, time_us in zip(coming, times_us, strict=False)):
            coming.clear()
        last_us, state = coming[-1][:2] if coming else (self.last_us, self.state)
        for time_us in times_us[len(coming) :]:
            state, delta = self.moved(state, last_us, time_us)
            coming.append((time_us, state, delta))
            last_us = time_us
        return [delta for _, (_, _, delta) in zip(times_us, coming, strict=False)]

    def think_again(self) -> None:
        """Forget what was worked out for passes to come, as it will move otherwise."""
        self._coming.clear()
