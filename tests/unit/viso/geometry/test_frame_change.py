# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion that is known comes out right whatever axes it was recorded in."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE
from tests.places import SHARED
from viso.geometry.frame_change import PRESETS, FrameChange, axes_matrix, parse_axes, parse_rotation
from viso.geometry.rotation import Array, quat_wxyz_from_rotation, rotation_from_quat_wxyz, so3_exp, so3_log
from viso.geometry.trajectory import Trajectory
from viso.streams.messages import Report, vision_position_estimate
from viso.streams.readers import Source, load_trajectory

CLIP = SHARED / "euroc_mh01_clip" / "groundtruth.tum"
NORTH, EAST, DOWN = np.eye(3)
POINTS = {"N": NORTH, "F": NORTH, "S": -NORTH, "B": -NORTH, "E": EAST, "R": EAST, "W": -EAST, "L": -EAST}
POINTS |= {"D": DOWN, "U": -DOWN}
LEVEL = np.eye(3)

vectors = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


def components(vector: Array, letters: str) -> list[float]:
    """Return the coordinates of a NED or FRD vector along axes."""
    return [float(POINTS[letter] @ vector) for letter in letters]


def recorded(preset: str, positions: list[Array], rotation: Array, velocity: Array) -> Trajectory:
    """Write down a vehicle's motion, given in NED and FRD, as somebody with the preset's axes would."""
    world, body = PRESETS[preset].world, PRESETS[preset].body
    attitude = np.array([components(rotation @ POINTS[letter], world) for letter in body]).T
    count = len(positions)
    return Trajectory(
        np.arange(count) * 100_000_000,
        np.array([components(position, world) for position in positions]),
        np.tile(quat_wxyz_from_rotation(attitude), (count, 1)),
        np.tile(components(velocity, world), (count, 1)),
    )


def change_of(preset: str, mounting: Array = LEVEL) -> FrameChange:
    return FrameChange(*parse_axes(preset), mounting)


def rotation_of(trajectory: Trajectory) -> Array:
    return rotation_from_quat_wxyz(trajectory.quats_wxyz[0])


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
@given(position=vectors, turn=vectors, velocity=vectors)
def test_known_motion_comes_out_right(preset: str, position: Array, turn: Array, velocity: Array) -> None:
    rotation = so3_exp(turn)
    trajectory = change_of(preset).apply(recorded(preset, [position, -position], rotation, velocity))
    np.testing.assert_allclose(trajectory.positions, [position, -position], atol=1e-9)
    np.testing.assert_allclose(rotation_of(trajectory), rotation, atol=1e-9)
    np.testing.assert_allclose(trajectory.world_velocities[0], velocity, atol=1e-9)


@given(turn=vectors, mounted=vectors, preset=st.sampled_from(sorted(PRESETS)))
def test_mounting_is_taken_off_the_attitude(turn: Array, mounted: Array, preset: str) -> None:
    rotation, mounting = so3_exp(turn), so3_exp(mounted)
    # A sensor that is turned by its mounting on a vehicle that is turned by its attitude.
    trajectory = change_of(preset, mounting).apply(recorded(preset, [NORTH], rotation @ mounting, EAST))
    np.testing.assert_allclose(rotation_of(trajectory), rotation, atol=1e-9)
    np.testing.assert_allclose(trajectory.positions, [NORTH], atol=1e-12)


def test_east_of_ros_is_east_of_the_autopilot() -> None:
    flown = Trajectory(np.array([0]), np.array([[2.0, 0.0, 1.0]]), np.array([[1.0, 0, 0, 0]]))
    trajectory = change_of("enu_flu").apply(flown)
    np.testing.assert_allclose(trajectory.positions, [[0.0, 2.0, -1.0]])
    np.testing.assert_allclose(so3_log(rotation_of(trajectory)), [0.0, 0.0, math.pi / 2], atol=1e-12)


def test_camera_that_looks_ahead_is_level() -> None:
    flown = Trajectory(np.array([0]), np.array([[1.0, 2.0, 3.0]]), np.array([[1.0, 0, 0, 0]]))
    trajectory = change_of("optical").apply(flown)
    assert trajectory.positions.tolist() == [[3.0, 1.0, 2.0]]
    np.testing.assert_allclose(rotation_of(trajectory), LEVEL, atol=1e-12)


def test_yaw_turns_the_world_clockwise() -> None:
    flown = recorded("ned_frd", [NORTH], LEVEL, NORTH)
    trajectory = FrameChange(LEVEL, LEVEL, LEVEL, yaw_rad=math.pi / 2).apply(flown)
    np.testing.assert_allclose(trajectory.positions, [EAST], atol=1e-12)
    np.testing.assert_allclose(trajectory.world_velocities, [EAST], atol=1e-12)
    np.testing.assert_allclose(so3_log(rotation_of(trajectory)), [0.0, 0.0, math.pi / 2], atol=1e-12)


def test_first_position_may_be_the_origin() -> None:
    flown = recorded("enu_flu", [np.array([5.0, 6.0, 7.0]), np.array([6.0, 6.0, 7.0])], LEVEL, NORTH)
    trajectory = FrameChange(*parse_axes("enu_flu"), LEVEL, from_zero=True).apply(flown)
    np.testing.assert_allclose(trajectory.positions, [np.zeros(3), NORTH], atol=1e-12)


def test_scale_counts_for_positions_velocities_and_their_covariance() -> None:
    flown = recorded("ned_frd", [NORTH], LEVEL, EAST).with_sigmas((1.0, 1.0))
    trajectory = FrameChange(LEVEL, LEVEL, LEVEL, scale=2.0).apply(flown)
    assert trajectory.positions.tolist() == [[2.0, 0.0, 0.0]]
    assert trajectory.world_velocities.tolist() == [[0.0, 2.0, 0.0]]
    assert trajectory.covariances is not None
    np.testing.assert_allclose(np.diagonal(trajectory.covariances[0]), [4.0] * 3 + [1.0] * 3)


@pytest.mark.parametrize("preset", PRESETS)
def test_covariance_turns_with_the_axes(preset: str) -> None:
    # The errors of a pose that was disturbed in NED, seen in the axes of the recording.
    moved, turned = np.array([0.1, 0.2, -0.3]), np.array([0.01, -0.02, 0.03])
    still = recorded(preset, [np.zeros(3)], LEVEL, NORTH)
    there = recorded(preset, [moved], so3_exp(turned), NORTH)
    twist = so3_log(rotation_of(there) @ rotation_of(still).T)
    error = np.concatenate([there.positions[0], twist])
    flown = Trajectory(still.times_ns, still.positions, still.quats_wxyz, covariances=np.outer(error, error)[None])
    covariances = change_of(preset).apply(flown).covariances
    assert covariances is not None
    expected = np.concatenate([moved, turned])
    np.testing.assert_allclose(covariances[0], np.outer(expected, expected), atol=1e-12)


def test_letters_may_be_small_and_presets_large() -> None:
    np.testing.assert_array_equal(axes_matrix("enu"), axes_matrix("ENU"))
    np.testing.assert_array_equal(parse_axes("ENU_FLU")[0], axes_matrix("ENU"))


@pytest.mark.parametrize("letters", ["", "EN", "ENUU", "ENN", "NSU", "EXU", "FNU"])
def test_letters_that_are_no_axes_are_refused(letters: str) -> None:
    with pytest.raises(ValueError, match="three perpendicular axes"):
        axes_matrix(letters)


@pytest.mark.parametrize(("text", "reason"), [("nosuch", "neither"), ("ENU/FRU", "left-handed"), ("ENU/", "''")])
def test_axes_that_are_none_are_refused(text: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        parse_axes(text)


@pytest.mark.parametrize(
    "text",
    ["0,0,90", "1,0,0,1", "0.70710678,0,0,0.70710678", "0,-1,0,1,0,0,0,0,1", "0.0001,-1,0,1,0.0001,0,0,0,1"],
)
def test_rotation_may_be_angles_a_quaternion_or_a_matrix(text: str) -> None:
    rotation = parse_rotation(text)
    np.testing.assert_allclose(rotation @ NORTH, EAST, atol=2e-4)
    np.testing.assert_allclose(rotation @ rotation.T, LEVEL, atol=1e-12)


def test_sensor_pitched_down_looks_down() -> None:
    np.testing.assert_allclose(parse_rotation("0,-90,0") @ NORTH, DOWN, atol=1e-12)


@pytest.mark.parametrize(
    "text",
    ["", "1", "1,2", "a,b,c", "0,0,0,0", "nan,0,0", "inf,0,0", "nan,0,0,0", "1,0,0,0,1,0,0,0,-1", "2,0,0,0,2,0,0,0,2"],
)
def test_text_that_is_no_rotation_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        parse_rotation(text)


@pytest.mark.skipif(not CLIP.exists(), reason=f"{CLIP.parent.name} is not there")
def test_sensor_of_the_euroc_drone_looks_ahead_and_down() -> None:
    trajectory = change_of("euroc").apply(load_trajectory(Source(CLIP)))
    (message,) = vision_position_estimate(Report(0, trajectory.pose(0)))
    assert isinstance(message, VISION_POSITION_ESTIMATE)
    assert abs(message.roll) < math.radians(5)
    assert -math.radians(30) < message.pitch < -math.radians(15)
