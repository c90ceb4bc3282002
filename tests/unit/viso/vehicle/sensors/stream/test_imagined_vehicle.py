# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that is steered: its IMU and its movement must be those of one body."""

import math

import numpy as np
import quaternion

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import normalized, quat_of_euler
from viso.vehicle.sensors.stream.imagined_vehicle import (
    MAX_ACCEL,
    MAX_ANGULAR_ACCEL,
    MAX_CATCH_UP_SPEED,
    MAX_JERK,
    ImaginedVehicle,
    Movement,
)
from viso.vehicle.sensors.vectors import ZERO, rotation_between

DT = 0.0025


def wild_target(time_s: float) -> Movement:
    """Return where something agile is: 4 m/s, 8 m/s^2, 130 deg/s, tilted by up to 30 deg."""
    w = 2.0
    pos = 2.0 * math.sin(w * time_s), 2.0 * math.cos(w * time_s) - 2.0, -math.sin(time_s)
    vel = 2.0 * w * math.cos(w * time_s), -2.0 * w * math.sin(w * time_s), -math.cos(time_s)
    acc = -w * w * pos[0], -w * w * (pos[1] + 2.0), math.sin(time_s)
    quat = quat_of_euler(0.5 * math.sin(time_s), 0.3 * math.sin(2.0 * time_s), 2.0 * math.sin(time_s))
    return Movement(pos, vel, acc, quat, ZERO)


def test_inertial_data_add_up_to_the_movement() -> None:
    vehicle = ImaginedVehicle(0.0)
    quat, vel, pos = quaternion.quaternion(*vehicle.quat), np.zeros(3), np.zeros(3)
    for number in range(8000):
        if number % 4 == 0:
            vehicle.steer(wild_target(number * DT))
        del_vel, del_ang = map(np.array, vehicle.move(DT))
        halfway = quaternion.as_rotation_matrix(quat * quaternion.from_rotation_vector(0.5 * del_ang))
        vel_before = vel
        vel = vel + halfway @ del_vel + (0.0, 0.0, GRAVITY_MSS * DT)
        pos = pos + 0.5 * DT * (vel + vel_before)
        quat = (quat * quaternion.from_rotation_vector(del_ang)).normalized()
    movement = vehicle.movement()
    assert np.abs(pos - movement.pos).max() < 0.01
    assert np.abs(vel - movement.vel).max() < 0.002
    assert math.hypot(*rotation_between(tuple(quat.components.tolist()), movement.quat)) < 1e-6
    assert np.abs(np.array(movement.pos) - wild_target(20.0).pos).max() < 0.1


def test_limits_hold_for_any_target() -> None:
    rng = np.random.default_rng(5)
    vehicle = ImaginedVehicle(0.0)
    before = vehicle.movement()
    for _ in range(2000):
        far = [tuple(1e6 * rng.standard_normal(3)) for _ in range(4)]
        quat = normalized(tuple(rng.standard_normal(4).tolist()))
        vehicle.steer(Movement(far[0], far[1], far[2], quat, far[3]))
        vehicle.move(DT)
        now = vehicle.movement()
        assert np.abs(now.acc).max() < MAX_ACCEL + MAX_JERK * DT
        assert np.abs(np.subtract(now.acc, before.acc)).max() < (1.0 + 1e-9) * MAX_JERK * DT
        assert np.abs(np.subtract(now.rate, before.rate)).max() < (1.0 + 1e-9) * MAX_ANGULAR_ACCEL * DT
        before = now


def test_it_catches_up_with_a_target_at_rest_no_faster_than_the_limit() -> None:
    vehicle = ImaginedVehicle(0.0)
    target = Movement((10.0, 0.0, -10.0), ZERO, ZERO, quat_of_euler(0.0, 0.0, 3.0), ZERO)
    fastest = 0.0
    for _ in range(4000):
        vehicle.steer(target)
        vehicle.move(DT)
        fastest = max(fastest, max(map(abs, vehicle.movement().vel)))
    assert fastest < 1.01 * MAX_CATCH_UP_SPEED
    movement = vehicle.movement()
    assert np.abs(np.subtract(movement.pos, target.pos)).max() < 0.01
    assert math.hypot(*rotation_between(movement.quat, target.quat)) < 0.001


def test_it_brakes_to_rest_and_levels() -> None:
    vehicle = ImaginedVehicle(1.0)
    for number in range(800):
        vehicle.steer(wild_target(number * DT))
        vehicle.move(DT)
    for _ in range(800):
        vehicle.brake()
        vehicle.move(DT)
    movement = vehicle.movement()
    down = quaternion.as_rotation_matrix(quaternion.quaternion(*movement.quat))[2, 2]
    assert down > 1.0 - 1e-6
    assert max(math.hypot(*movement.vel), math.hypot(*movement.acc), math.hypot(*movement.rate)) < 0.02
