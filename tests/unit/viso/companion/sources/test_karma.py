# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a drone has told, as truth and as a state to start from."""

import math

import numpy as np
import pytest

from viso.companion.sources.karma import DELAY_S, DroneTrack, drone_track
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.types import ImuSample
from viso.geometry.rotation import yaw_of

Z = np.array([0.0, 0.0, 1.0])


def straight(heading_rad: float = 0.0, acceleration_m_s2: float = 0.0) -> DroneTrack:
    """Return a flight that begins 5 s after boot, where its heading points, at 2 m/s."""
    times = np.arange(9) * 0.25
    along = np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])
    speed = 2.0 + acceleration_m_s2 * times
    positions = np.outer(2.0 * times + 0.5 * acceleration_m_s2 * times**2, along)
    attitudes = np.column_stack([times + 5, np.zeros((9, 2)), np.full(9, heading_rad)])
    spans = [(0.0, 2.0, 5.0, 7.0)]
    return drone_track(attitudes, np.column_stack([times + 5, positions, np.outer(speed, along)]), spans)


def samples(accel: list[float], gyro: tuple[float, ...] | list[float] = (0, 0, 0)) -> list[ImuSample]:
    return [ImuSample(index * 10_000_000, np.array(accel), np.array(gyro)) for index in range(200)]


def test_north_is_y_and_a_heading_of_0() -> None:
    track = straight()
    np.testing.assert_allclose(track.velocity_w[0], [0, 2, 0])
    assert track.yaw_rad[0] == pytest.approx(0.5 * math.pi)
    assert yaw_of(track.poses().se3(0).R) == pytest.approx(0.5 * math.pi)


def test_airframe_that_leans_right_and_looks_up_does_so_in_enu() -> None:
    attitudes = np.array([[0.0, 0.1, 0.2, 0.0], [1.0, 0.1, 0.2, 0.0]])
    positions = np.column_stack([[0.0, 1.0], np.zeros((2, 6))])
    rotation = drone_track(attitudes, positions, [(0.0, 1.0, 0.0, 1.0)]).poses().se3(0).R
    assert rotation[2, 0] == pytest.approx(math.sin(0.2))  # forward points up
    assert rotation[2, 1] > 0  # left points up


def test_times_that_do_not_increase_are_refused() -> None:
    rows = np.zeros((2, 7))
    with pytest.raises(ValueError, match="times since boot do not increase"):
        drone_track(rows[:, :4], rows, [(0.0, 1.0, 0.0, 0.0)])


def test_times_of_another_world_are_refused() -> None:
    positions = np.zeros((2, 7))
    positions[:, 0] = [1e7, 1e7 + 1]
    with pytest.raises(ValueError, match="more than eleven days"):
        drone_track(positions[:, :4], positions, [(0.0, 1.0, 1e7, 1e7 + 1)])


def test_messages_tell_of_what_was_a_little_before() -> None:
    assert straight().t_s[0] == pytest.approx(-DELAY_S)


def test_camera_starts_level_with_the_drone_s_heading_and_velocity() -> None:
    start = straight(heading_rad=0.3).start_at(0.5, samples([0, 0, GRAVITY_MSS]))
    world_T_body = start.body_T_world.inverse()
    np.testing.assert_allclose(world_T_body.R @ Z, Z, atol=1e-12)
    assert yaw_of(world_T_body.R) == pytest.approx(0.5 * math.pi - 0.3)
    np.testing.assert_allclose(start.velocity_b, [2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(world_T_body.t, 1.4 * np.array([math.sin(0.3), math.cos(0.3), 0]), atol=1e-12)


def test_what_the_imu_shows_beyond_the_drone_s_acceleration_is_bias() -> None:
    moving = straight(heading_rad=-1.0, acceleration_m_s2=3.0)
    bias = moving.start_at(0.0, samples([3.1, -0.2, GRAVITY_MSS + 0.3], [0.01, -0.02, 0.5])).bias
    np.testing.assert_allclose(bias.accel, [0.1, -0.2, 0.3], atol=1e-9)
    np.testing.assert_allclose(bias.gyro, [0.01, -0.02, 0.0], atol=1e-12)  # it may well turn about the vertical


def test_start_without_inertial_data_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no inertial data at 0\.5 s"):
        straight().start_at(0.5, [])
