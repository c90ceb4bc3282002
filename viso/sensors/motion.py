# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a vehicle moves, and what ideal inertial sensors feel of it."""

from typing import NamedTuple

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.inputs.inertial import InertialDelta
from viso.geometry import quaternions as quaternion
from viso.sensors.attitude import halfway, rotate_to_body, rotation_between
from viso.sensors.errors import exact_delta
from viso.sensors.vectors import Three, added


class Truth(NamedTuple):
    """Where a vehicle really is: m and m/s (NED), attitude (body to earth)."""

    pos_ned: Three
    vel_ned: Three
    quat_wxyz: tuple[float, float, float, float]


class State(NamedTuple):
    """Position and velocity in m and m/s, NED, attitude (body to earth), and yaw in rad, full turns counted."""

    pos: Three
    vel: Three
    quat: quaternion.quaternion
    yaw_rad: float


def delta_between(before: State, now: State, dt: float) -> InertialDelta:
    """Return what inertial sensors feel from one state to another, in ``dt`` seconds."""
    north, east, down = added(now.vel, before.vel, -1.0)
    del_vel = rotate_to_body(halfway(before.quat, now.quat), (north, east, down - GRAVITY_MSS * dt))
    return exact_delta(del_vel, rotation_between(before.quat, now.quat), dt)
