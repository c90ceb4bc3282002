# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's sensors feel the flight that the companion's sensors feel."""

import numpy as np
import pytest
import quaternion

from ekf_stub.core.inertial import GRAVITY_MSS
from tests.unit.viso.companion.world.from_ground import from_ground
from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.companion.world.motion import nadir_survey
from viso.geometry.rotation import Array, rotation_from_quat_wxyz
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.world_flight import WorldFlight, WorldLeg, flight_source

FLIGHT = from_ground(nadir_survey(8.0, 20.0), still_s=1.0, climb_s=4.0, ramp_s=2.0)
START_S = 2.0
LOOP_US = 2500


def true_ned(t_s: float) -> tuple[Array, Array]:
    """Return position from the start and attitude, straight from the world's."""
    pose = FLIGHT.pose(t_s)
    start = FLIGHT.position_w(np.zeros(1))[0]
    return ENU_TO_NED.dot(pose.t - start), ENU_TO_NED.dot(pose.R).dot(FLU_TO_FRD)


@pytest.mark.parametrize("time_s", [2.0, 4.25, 8.0013, 15.0])
def test_truth_is_the_worlds(time_s: float) -> None:
    truth = flight_source(FLIGHT, START_S, ImuOptions()).truth(round(time_s * 1e6))
    position, rotation = true_ned(time_s - START_S)
    assert truth.pos_ned == pytest.approx(position, abs=1e-9)
    assert truth.vel_ned == pytest.approx(ENU_TO_NED.dot(FLIGHT.velocity_w(time_s - START_S)), abs=1e-6)
    assert rotation_from_quat_wxyz(truth.quat_wxyz) == pytest.approx(rotation, abs=1e-9)


def test_vehicle_stands_in_the_origin_before_the_start() -> None:
    truth = flight_source(FLIGHT, START_S, ImuOptions()).truth(0)
    assert truth.pos_ned == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert truth.vel_ned == (0.0, 0.0, 0.0)


def test_passes_of_the_loop_are_the_same_one_by_one() -> None:
    at_once, alone = WorldLeg(WorldFlight(FLIGHT)), WorldLeg(WorldFlight(FLIGHT))
    for tick in (0, 1, 399, 400, 2801, 17):
        one = alone.at(tick / 400 + 1e-9)
        assert np.array(at_once.at(tick / 400)) == pytest.approx(np.array(one), abs=1e-6)


@pytest.mark.slow
def test_inertial_data_add_up_to_the_flight() -> None:
    source = flight_source(FLIGHT, START_S, ImuOptions())
    source.sense(0)
    quat = quaternion.from_rotation_matrix(true_ned(0.0)[1])
    vel, pos, errors = np.zeros(3), np.zeros(3), []
    for time_us in range(LOOP_US, 10_000_001, LOOP_US):
        sensors = source.sense(time_us)
        assert sensors is not None
        delta = sensors.delta
        halfway = quat * quaternion.from_rotation_vector(0.5 * delta.del_ang)
        before = vel
        vel = vel + quaternion.rotate_vectors(halfway, delta.del_vel) + [0.0, 0.0, GRAVITY_MSS * delta.del_vel_dt]
        pos = pos + 0.5 * (before + vel) * delta.del_vel_dt
        quat = quat * quaternion.from_rotation_vector(delta.del_ang)
        if time_us % 50_000 == 0:  # the truth takes longer than the sensors
            errors.append(np.linalg.norm(pos - true_ned(max(1e-6 * time_us - START_S, 0.0))[0]))
    assert max(errors) < 0.02


def test_barometer_tells_the_height() -> None:
    source = flight_source(FLIGHT, START_S, ImuOptions())
    for time_us in range(0, 9_000_001, LOOP_US):
        sensors = source.sense(time_us)
    assert sensors is not None
    assert sensors.baro is not None
    assert list(sensors.baro) == pytest.approx([8950, -true_ned(6.95)[0][2]], abs=1e-4)
