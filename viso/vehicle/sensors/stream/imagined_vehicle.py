# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that moves as smoothly as a real one while it is steered after something, and what its IMU feels."""

from typing import Final, NamedTuple

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import Quat, euler_of, quat_of_euler
from viso.vehicle.sensors.vectors import ZERO, Three, rotation_between, to_body, turned

MAX_ACCEL: Final = 15.0
MAX_JERK: Final = 150.0
MAX_CATCH_UP_SPEED: Final = 2.0
MAX_CATCH_UP_RATE: Final = 3.0
MAX_ANGULAR_ACCEL: Final = 60.0

# Poles of what steers, all alike, in rad/s.
_STEER_POS: Final = 10.0
_STEER_ATT: Final = 20.0
_BRAKE: Final = 6.0


class Movement(NamedTuple):
    """Position, velocity and acceleration (m, s, NED), attitude (body to NED) and body rates (rad/s)."""

    pos: Three
    vel: Three
    acc: Three
    quat: Quat
    rate: Three


def _within(value: float, limit: float) -> float:
    return limit if value > limit else -limit if value < -limit else value


class ImaginedVehicle:
    """A point with an attitude, at rest and level at first, with a heading.

    Acceleration and body rates are continuous; jerk and angular acceleration are what steers. Limits hold for each
    axis: 15 m/s^2, 150 m/s^3, 60 rad/s^2; what has been left behind is caught up with at 2 m/s and 3 rad/s.
    """

    def __init__(self, heading_rad: float) -> None:
        self._pos: Three = ZERO
        self._vel: Three = ZERO
        self._acc: Three = ZERO
        self._rate: Three = ZERO
        self._jerk: Three = ZERO
        self._rate_change: Three = ZERO
        self.point(heading_rad)

    def __copy__(self) -> "ImaginedVehicle":
        """Return another one that moves alike, and from then on by itself."""
        other = ImaginedVehicle.__new__(ImaginedVehicle)
        other.__dict__.update(self.__dict__)
        return other

    def point(self, heading_rad: float) -> None:
        """Stand level, with a heading; for a vehicle at rest, whose IMU does not feel it."""
        self.quat = quat_of_euler(0.0, 0.0, heading_rad)

    @property
    def height_m(self) -> float:
        """Height above where it stood at first."""
        return -self._pos[2]

    def movement(self) -> Movement:
        """Return how it moves."""
        return Movement(self._pos, self._vel, self._acc, self.quat, self._rate)

    def steer(self, target: Movement) -> None:
        """Go where the target is now, with its velocity, acceleration and rates; holds until the next call."""
        jerk = [0.0, 0.0, 0.0]
        for axis in range(3):
            catch_up = _within(_STEER_POS / 3.0 * (target.pos[axis] - self._pos[axis]), MAX_CATCH_UP_SPEED)
            wanted = target.acc[axis] + _STEER_POS * (target.vel[axis] + catch_up - self._vel[axis])
            jerk[axis] = _within(3.0 * _STEER_POS * (_within(wanted, MAX_ACCEL) - self._acc[axis]), MAX_JERK)
        self._jerk = jerk[0], jerk[1], jerk[2]
        self._turn_to(target.quat, target.rate)

    def brake(self) -> None:
        """Come to rest within a second or so, level, and stay there."""
        jerk = [
            _within(2.0 * _BRAKE * (-0.5 * _BRAKE * v - a), MAX_JERK) for v, a in zip(self._vel, self._acc, strict=True)
        ]
        self._jerk = jerk[0], jerk[1], jerk[2]
        self._turn_to(quat_of_euler(0.0, 0.0, euler_of(self.quat)[2]), ZERO)

    def _turn_to(self, quat: Quat, rate: Three) -> None:
        change = [0.0, 0.0, 0.0]
        for axis, error in enumerate(rotation_between(self.quat, quat)):
            wanted = rate[axis] + _within(0.5 * _STEER_ATT * error, MAX_CATCH_UP_RATE)
            change[axis] = _within(2.0 * _STEER_ATT * (wanted - self._rate[axis]), MAX_ANGULAR_ACCEL)
        self._rate_change = change[0], change[1], change[2]

    def move(self, dt: float) -> tuple[Three, Three]:
        """Move on by dt seconds; return what the IMU feels: changes of velocity (m/s) and angle (rad), body frame."""
        half = 0.5 * dt
        (wx, wy, wz), (ex, ey, ez) = self._rate, self._rate_change
        turn_x, turn_y, turn_z = dt * (wx + half * ex), dt * (wy + half * ey), dt * (wz + half * ez)
        self._rate = wx + dt * ex, wy + dt * ey, wz + dt * ez
        (ax, ay, az), (jx, jy, jz) = self._acc, self._jerk
        fx, fy, fz = to_body(self.quat, (ax + half * jx, ay + half * jy, az + half * jz - GRAVITY_MSS))
        self._translate(dt)
        self.quat = turned(self.quat, (turn_x, turn_y, turn_z))
        # Halfway through the interval the body has turned by half of the angle.
        del_vel = (
            dt * (fx - 0.5 * (turn_y * fz - turn_z * fy)),
            dt * (fy - 0.5 * (turn_z * fx - turn_x * fz)),
            dt * (fz - 0.5 * (turn_x * fy - turn_y * fx)),
        )
        return del_vel, (turn_x, turn_y, turn_z)

    def _translate(self, dt: float) -> None:
        (px, py, pz), (vx, vy, vz) = self._pos, self._vel
        (ax, ay, az), (jx, jy, jz) = self._acc, self._jerk
        half, third = 0.5 * dt, dt / 3.0
        self._pos = (
            px + dt * (vx + half * (ax + third * jx)),
            py + dt * (vy + half * (ay + third * jy)),
            pz + dt * (vz + half * (az + third * jz)),
        )
        self._vel = (
            vx + dt * (ax + half * jx),
            vy + dt * (ay + half * jy),
            vz + dt * (az + half * jz),
        )
        self._acc = ax + dt * jx, ay + dt * jy, az + dt * jz
