# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of points, by hand and back again."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.geometry.rotation import so3_exp
from viso.landmarks.observation import (
    AIRCRAFT_NEAREST_M,
    LANDMARK_NEAREST_M,
    back_project,
    camera_centre,
    project,
)
from viso.landmarks.types import Camera, VehiclePose

angles = st.floats(-math.pi, math.pi)
trims = st.floats(math.radians(-30), math.radians(30))
metres = st.floats(-1000, 1000)
offsets = st.floats(-2, 2)

cameras = st.builds(
    Camera,
    fx_px=st.floats(300, 3000),
    fy_px=st.floats(300, 3000),
    offset_forward_m=offsets,
    offset_left_m=offsets,
    height_m=st.floats(0, 100),
    heading_offset_rad=angles,
    yaw_trim_rad=trims,
    pitch_trim_rad=trims,
)
level_poses = st.builds(VehiclePose, t_s=st.just(0.0), x_m=metres, y_m=metres, yaw_rad=angles, z_m=st.none() | metres)
rotations = st.lists(angles, min_size=3, max_size=3).map(lambda vector: so3_exp(np.array(vector)))
poses = level_poses | st.builds(
    VehiclePose, t_s=st.just(0.0), x_m=metres, y_m=metres, yaw_rad=angles, z_m=metres, world_R_body=rotations
)


def at(x_m: float, y_m: float, yaw_deg: float) -> VehiclePose:
    return VehiclePose(0.0, x_m, y_m, math.radians(yaw_deg))


@pytest.mark.parametrize(
    ("pose", "pitch_deg", "point", "pixel"),
    [
        (at(0, 0, 0), 0, (10, 0, 0), (640, 632)),
        (at(0, 0, 0), 0, (10, 2, 0), (440, 632)),
        (at(0, 0, 90), 0, (0, 10, 0), (640, 632)),
        (at(0, 0, 30), 0, (10, 10, 0), (372.0508, 599.8461)),
        (at(0, 0, 0), 0, (3000, 500, 1000), (473.3333, 179.0667)),
        (at(0, 0, 0), 5, (1e6, 0, 1.2), (640, 599.4887)),
        (at(2, 1, -10), -5, (20, -3, 0), (684.0822, 489.7805)),
    ],
)
def test_points_appear_where_they_should(
    pose: VehiclePose, pitch_deg: float, point: tuple[float, float, float], pixel: tuple[float, float]
) -> None:
    camera = Camera(pitch_trim_rad=math.radians(pitch_deg))
    assert project(camera, pose, [point]).uv_px[0] == pytest.approx(pixel, abs=1e-3)


def test_the_offset_turns_with_the_vehicle() -> None:
    camera = Camera(offset_forward_m=0.5, offset_left_m=0.2)
    assert camera_centre(camera, at(5, 7, 90)) == pytest.approx([4.8, 7.5, 1.2])


def test_the_offset_does_not_turn_with_the_trims() -> None:
    plain = Camera(offset_forward_m=0.5, offset_left_m=0.2)
    trimmed = Camera(offset_forward_m=0.5, offset_left_m=0.2, heading_offset_rad=1.0, yaw_trim_rad=0.3)
    assert camera_centre(trimmed, at(5, 7, 40)).tolist() == camera_centre(plain, at(5, 7, 40)).tolist()


def test_the_camera_is_above_the_vehicle_where_its_height_is_known() -> None:
    assert camera_centre(Camera(height_m=0.5), VehiclePose(0.0, 0.0, 0.0, 0.0, z_m=20.0))[2] == 20.5


def test_heading_offset_and_yaw_trim_turn_the_view_to_the_left() -> None:
    camera = Camera(heading_offset_rad=math.radians(60), yaw_trim_rad=math.radians(30))
    assert project(camera, at(0, 0, 0), [(0, 10, 0)]).uv_px[0] == pytest.approx([640, 632])


def test_the_defaults_have_the_fields_of_view_that_their_numbers_say() -> None:
    assert math.degrees(Camera().hfov_rad) == pytest.approx(65.24, abs=0.005)
    assert math.degrees(Camera().vfov_rad) == pytest.approx(54.22, abs=0.005)


@given(trims, st.floats(-math.radians(30), math.radians(30)))
def test_a_point_far_away_at_the_cameras_height_is_on_the_horizon(pitch_rad: float, aside_rad: float) -> None:
    camera = Camera(pitch_trim_rad=pitch_rad)
    row_px = camera.cy_px + camera.fy_px * math.tan(pitch_rad)
    ahead = project(camera, at(0, 0, 0), [(1e9, 0.0, camera.height_m)])
    assert ahead.uv_px[0, 1] == pytest.approx(row_px, abs=1e-6)
    # The camera is not rolled, so the whole line has one row.
    aside = project(camera, at(0, 0, 0), [(1e9, 1e9 * math.tan(aside_rad), camera.height_m)])
    assert aside.uv_px[0, 1] == pytest.approx(row_px, abs=1e-6)


@given(cameras, poses, st.floats(-500, 2000), st.floats(-500, 2000), st.floats(0.5, 1e4))
def test_projection_and_back_projection_agree(
    camera: Camera, pose: VehiclePose, u_px: float, v_px: float, distance_m: float
) -> None:
    direction = back_project(camera, pose, [(u_px, v_px)])
    assert np.linalg.norm(direction) == pytest.approx(1)
    there = project(camera, pose, camera_centre(camera, pose) + distance_m * direction)
    assert there.uv_px[0] == pytest.approx([u_px, v_px], abs=1e-5)
    assert 0 < there.depth_m[0] <= distance_m * (1 + 1e-9)


@given(cameras, level_poses, st.tuples(metres, metres, metres))
def test_a_level_attitude_is_the_same_as_a_yaw(
    camera: Camera, pose: VehiclePose, point: tuple[float, float, float]
) -> None:
    upright = so3_exp(np.array([0.0, 0.0, pose.yaw_rad]))
    full = VehiclePose(0.0, pose.x_m, pose.y_m, pose.yaw_rad, pose.z_m, upright)
    by_yaw, by_attitude = project(camera, pose, [point]), project(camera, full, [point])
    assert by_attitude.depth_m == pytest.approx(by_yaw.depth_m, abs=1e-9)
    if by_yaw.depth_m[0] > 1:
        assert by_attitude.uv_px == pytest.approx(by_yaw.uv_px, rel=1e-9, abs=1e-6)


def test_a_vehicle_on_its_right_side_sees_what_is_above_to_its_left() -> None:
    rolled = VehiclePose(0.0, 0.0, 0.0, 0.0, 0.0, so3_exp(np.array([math.pi / 2, 0.0, 0.0])))
    assert project(Camera(), rolled, [(10, 0, 2.2)]).uv_px[0] == pytest.approx([540, 512])


@given(trims)
def test_a_vehicle_with_its_nose_up_sees_as_with_a_pitch_trim(pitch_rad: float) -> None:
    nose_up = VehiclePose(0.0, 0.0, 0.0, 0.0, 0.0, so3_exp(np.array([0.0, -pitch_rad, 0.0])))
    by_attitude = project(Camera(), nose_up, [(20, 3, 1)])
    by_trim = project(Camera(pitch_trim_rad=pitch_rad), at(0, 0, 0), [(20, 3, 1)])
    assert by_attitude.uv_px == pytest.approx(by_trim.uv_px)


@pytest.mark.parametrize("nearest_m", [LANDMARK_NEAREST_M, AIRCRAFT_NEAREST_M])
def test_what_is_too_near_or_behind_has_no_pixel(nearest_m: float) -> None:
    points = [(nearest_m, 0, 1.2), (2 * nearest_m, 0, 1.2), (-5, 0, 1.2)]
    projection = project(Camera(), at(0, 0, 0), points, nearest_m)
    assert np.isnan(projection.uv_px).all(axis=1).tolist() == [True, False, True]
    assert projection.in_image.tolist() == [False, True, False]
    assert projection.depth_m == pytest.approx([nearest_m, 2 * nearest_m, -5])


def test_a_coordinate_that_is_not_known_gives_no_pixel() -> None:
    projection = project(Camera(), at(0, 0, 0), [(10, 0, math.nan), (10, 0, 0)])
    assert np.isnan(projection.uv_px[0]).all()
    assert projection.in_image.tolist() == [False, True]


def test_points_outside_the_picture_are_kept_and_marked() -> None:
    points = [(1, y, z) for y, z in [(0.64, 1.2), (-0.64, 1.2), (0.0, 1.712), (0.0, 0.688), (0.7, 1.2)]]
    projection = project(Camera(), at(0, 0, 0), points)
    assert projection.uv_px == pytest.approx(np.array([(0, 512), (1280, 512), (640, 0), (640, 1024), (-60, 512)]))
    assert projection.in_image.tolist() == [True, False, True, False, False]


def test_no_points_have_no_pixels() -> None:
    assert project(Camera(), at(0, 0, 0), []).uv_px.shape == (0, 2)


@pytest.mark.slow
@given(cameras, poses, st.lists(st.tuples(metres, metres, metres), min_size=2, max_size=9))
def test_a_pixel_does_not_depend_on_the_company(
    camera: Camera, pose: VehiclePose, points: list[tuple[float, float, float]]
) -> None:
    together = project(camera, pose, points).uv_px
    alone = np.vstack([project(camera, pose, [point]).uv_px for point in points])
    np.testing.assert_array_equal(together, alone)
