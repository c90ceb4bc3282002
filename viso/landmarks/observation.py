# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Projection of points of the world into a forward-looking pinhole camera on a vehicle, by its yaw or its attitude.

The camera's axes are x to the right, y down and z along the view. Sums are taken element by element, so that a point's
pixel does not depend, even in its last bit, on the other points projected with it.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.companion.vio.frames import MOUNTINGS
from viso.geometry.rotation import Array
from viso.landmarks.types import Camera, VehiclePose

LANDMARK_NEAREST_M: Final = 1e-6
"""Along the view; a landmark that is nearer, or behind, is not projected."""
AIRCRAFT_NEAREST_M: Final = 0.1
"""The same of an aircraft."""


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """Points in the picture.

    Attributes:
        uv_px: [N, 2], right and down of the picture's corner; NaN where there is no projection.
        depth_m: [N], along the view; negative behind the camera.
        in_image: bool [N], whether the pixel is inside the picture.
    """

    uv_px: Array
    depth_m: Array
    in_image: npt.NDArray[np.bool_]


def turned(rotation: Array, vectors: Array) -> Array:
    """Return rotations [..., 3, 3] times vectors [..., 3]."""
    x, y, z = vectors[..., 0:1], vectors[..., 1:2], vectors[..., 2:3]
    product: Array = rotation[..., 0] * x + rotation[..., 1] * y + rotation[..., 2] * z
    return product


def rotation_about_up(angle_rad: float) -> Array:
    """Return the matrix [3, 3] that turns a vector counter-clockwise about z."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def camera_centre(camera: Camera, pose: VehiclePose) -> Array:
    """Return the camera's position, ENU [3] in m; its offset rotates with the vehicle's yaw only, not with a trim."""
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    forward, left = camera.offset_forward_m, camera.offset_left_m
    x_m, y_m = pose.x_m + c * forward - s * left, pose.y_m + s * forward + c * left
    return np.array([x_m, y_m, camera.height_m + (pose.z_m or 0.0)])


def camera_R_body(camera: Camera) -> Array:
    """Return the matrix [3, 3] from the body (FLU) to the camera: heading offset and yaw trim, then the pitch trim."""
    c, s = math.cos(camera.pitch_trim_rad), math.sin(camera.pitch_trim_rad)
    nose_up = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    mounting = rotation_about_up(-(camera.heading_offset_rad + camera.yaw_trim_rad))
    rotation: Array = MOUNTINGS["forward"].T.dot(nose_up).dot(mounting)
    return rotation


def world_R_body(pose: VehiclePose) -> Array:
    """Return the attitude [3, 3] of a pose; level if only its yaw is known."""
    return rotation_about_up(pose.yaw_rad) if pose.world_R_body is None else pose.world_R_body


def to_pixels(camera: Camera, points_camera: Array, nearest_m: float = LANDMARK_NEAREST_M) -> Projection:
    """Project points [N, 3], in m in the camera's axes; NaN for unknown coordinates.

    Points at most ``nearest_m`` along the view have no projection.
    """
    depth_m = points_camera[:, 2]
    with np.errstate(over="ignore", invalid="ignore"):
        ahead = np.where(depth_m > nearest_m, depth_m, np.nan)[:, np.newaxis]
        uv_px = points_camera[:, :2] / ahead * (camera.fx_px, camera.fy_px) + (camera.cx_px, camera.cy_px)
    uv_px[~np.isfinite(uv_px).all(axis=1)] = np.nan
    inside = (uv_px >= 0) & (uv_px < (camera.width_px, camera.height_px))
    return Projection(uv_px, depth_m, inside[:, 0] & inside[:, 1])


def project(
    camera: Camera, pose: VehiclePose, points_xyz: npt.ArrayLike, nearest_m: float = LANDMARK_NEAREST_M
) -> Projection:
    """Return the projections of points.

    A pose with an attitude rotates points by it, and the mounting's heading and trims act in the body; without one the
    body is level. Points [N, 3] are ENU in m; one with NaN, as of an unknown coordinate, has no projection, as those at
    most ``nearest_m`` along the view.
    """
    points = np.asarray(points_xyz, dtype=np.float64).reshape(-1, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        in_body = turned(world_R_body(pose).T, points - camera_centre(camera, pose))
        in_camera = turned(camera_R_body(camera), in_body)
    return to_pixels(camera, in_camera, nearest_m)


def back_project(camera: Camera, pose: VehiclePose, uv_px: npt.ArrayLike) -> Array:
    """Return the directions in which pixels [N, 2] look, unit vectors [N, 3], ENU."""
    in_body = turned(camera_R_body(camera).T, rays(camera, uv_px))
    return turned(world_R_body(pose), in_body)


def rays(camera: Camera, uv_px: npt.ArrayLike) -> Array:
    """Return the directions of pixels [N, 2] in the camera's axes, unit vectors [N, 3]."""
    pixels = np.asarray(uv_px, dtype=np.float64).reshape(-1, 2)
    across = (pixels - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)
    directions = np.column_stack([across, np.ones(len(pixels))])
    unit: Array = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit
