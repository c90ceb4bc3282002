# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's sensors feel the flight that the camera sees."""

import math

import numpy as np
import pytest
import quaternion

from ekf_stub.filter.inertial import GRAVITY_MSS, quat_of_rotation
from viso.companion.trials.scripted_flight import Flight
from viso.demo.flight import flight_source
from viso.sensors.options import ImuOptions

FLIGHT = Flight(start_s=2.0, climb_s=2.0, loop_s=8.0, heading_rad=0.5)
LOOP_US = 2500


@pytest.mark.parametrize("time_s", [0.0, 3.0, 7.7, 11.0, 30.0])
def test_truth_is_the_flight(time_s: float) -> None:
    truth = flight_source(FLIGHT, ImuOptions(heading_rad=0.5)).truth(round(time_s * 1e6))
    assert truth.pos_ned == pytest.approx(FLIGHT.position_ned(time_s), abs=1e-9)
    assert truth.vel_ned == pytest.approx(FLIGHT.velocity_ned(time_s), abs=1e-9)
    roll, pitch, yaw = (quaternion.from_rotation_vector(v) for v in np.diag(FLIGHT.attitude_rpy_rad(time_s)))
    assert quaternion.rotation_intrinsic_distance(yaw * pitch * roll, quaternion.quaternion(*truth.quat_wxyz)) < 1e-7


@pytest.mark.slow
def test_inertial_data_add_up_to_the_flight() -> None:
    source = flight_source(FLIGHT, ImuOptions(heading_rad=0.5))
    source.sense(0)
    quat, vel, pos = quaternion.from_rotation_vector([0.0, 0.0, 0.5]), np.zeros(3), np.zeros(3)
    errors = []
    for time_us in range(LOOP_US, 15_000_000, LOOP_US):
        sensors = source.sense(time_us)
        assert sensors is not None
        delta = sensors.delta
        halfway = quat * quat_of_rotation(0.5 * delta.del_ang)
        before = vel
        vel = vel + quaternion.rotate_vectors(halfway, delta.del_vel) + [0.0, 0.0, GRAVITY_MSS * delta.del_vel_dt]
        pos = pos + 0.5 * (before + vel) * delta.del_vel_dt
        quat = quat * quat_of_rotation(delta.del_ang)
        errors.append(np.linalg.norm(pos - FLIGHT.position_ned(1e-6 * time_us)))
    assert max(errors) < 0.01


def test_height_and_heading_are_those_of_the_flight() -> None:
    source = flight_source(FLIGHT, ImuOptions(heading_rad=0.5, has_compass=lambda: True))
    for time_us in range(0, 5_000_001, LOOP_US):
        sensors = source.sense(time_us)
    assert sensors is not None
    assert sensors.baro is not None
    assert list(sensors.baro) == pytest.approx([4950, 3.0])
    assert sensors.mag is not None
    assert source.yaw_rad() == pytest.approx(0.5)


def test_it_flies_unarmed_too() -> None:
    source = flight_source(FLIGHT, ImuOptions())
    source.set_armed(False)
    assert math.isclose(source.truth(6_000_000).pos_ned[2], -3.0, abs_tol=1e-6)
