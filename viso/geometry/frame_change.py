# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of a recorded trajectory's axes to those of the autopilot.

Axes are three letters, the directions of x, y and z: N, E, S, W for a world with a north, or F, R, B, L
(forward, right, back, left), and U or D. FLU/URF is a world whose z points up, with a body whose x points up, y to the
right and z forward.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from viso.geometry.rotation import (
    ORTHONORMAL,
    Array,
    inverse,
    product,
    quat_wxyz_from_rotation,
    rotation_from_quat_wxyz,
    rotations_from_euler,
)
from viso.geometry.trajectory import Trajectory

# North and forward are x of the autopilot, east and right y, down z.
_DIRECTIONS: Final[Mapping[str, tuple[int, int]]] = MappingProxyType(
    {"N": (0, 1), "F": (0, 1), "S": (0, -1), "B": (0, -1), "E": (1, 1), "R": (1, 1), "W": (1, -1), "L": (1, -1)}
    | {"D": (2, 1), "U": (2, -1)}
)


@dataclass(frozen=True, slots=True)
class AxesPreset:
    """Named axes of positions and attitudes, and who uses them."""

    world: str
    body: str
    summary: str


PRESETS: Final[Mapping[str, AxesPreset]] = MappingProxyType(
    {
        "enu_flu": AxesPreset("ENU", "FLU", "ROS, where x of the world is east (REP 103)"),
        "flu_flu": AxesPreset("FLU", "FLU", "z up, x forward: odometry of ROS, Vicon"),
        "ned_frd": AxesPreset("NED", "FRD", "the autopilot's own"),
        "optical": AxesPreset("RDF", "RDF", "a camera in the world of its first picture: ORB-SLAM, KITTI"),
        "zup_optical": AxesPreset("FLU", "RDF", "a camera in a world with z up"),
        "euroc": AxesPreset("FLU", "URF", "z up, and the IMU of EuRoC's drones as body"),
        "zed_image": AxesPreset("RDF", "RDF", "ZED SDK, IMAGE, its default"),
        "zed_left_handed_y_up": AxesPreset("RUF", "RUF", "ZED SDK, LEFT_HANDED_Y_UP (Unity)"),
        "zed_right_handed_y_up": AxesPreset("RUB", "RUB", "ZED SDK, RIGHT_HANDED_Y_UP (OpenGL)"),
        "zed_right_handed_z_up": AxesPreset("RFU", "RFU", "ZED SDK, RIGHT_HANDED_Z_UP"),
        "zed_left_handed_z_up": AxesPreset("FRU", "FRU", "ZED SDK, LEFT_HANDED_Z_UP (Unreal)"),
        "zed_right_handed_z_up_x_fwd": AxesPreset("FLU", "FLU", "ZED SDK, RIGHT_HANDED_Z_UP_X_FWD; its ROS nodes"),
        "mocap_y_up": AxesPreset("FUR", "FUR", "OptiTrack with y up, its rigid body facing x"),
    }
)  # fmt: skip


def axes_matrix(letters: str) -> Array:
    """Return the matrix [3, 3] that maps coordinates in these axes to NED, or FRD.

    Raises ValueError if they are not three letters for three perpendicular directions.
    """
    directions = [_DIRECTIONS.get(letter) for letter in letters.upper()]
    matrix = np.zeros((3, 3))
    for column, direction in enumerate(directions[:3]):
        if direction is not None:
            matrix[direction[0], column] = direction[1]
    if len(directions) != 3 or not matrix.any(axis=1).all():
        raise ValueError(f"{letters!r} are not three perpendicular axes, such as ENU or FRD")
    return matrix


def parse_axes(text: str) -> tuple[Array, Array]:
    """Return the matrices of the world and of the body of a preset, or of WORLD/BODY in letters.

    Raises ValueError if there is no such preset, or one of the two is mirrored and the other is not.
    """
    preset = PRESETS.get(text.lower())
    world, slash, body = (preset.world, "/", preset.body) if preset else text.partition("/")
    if not slash:
        raise ValueError(f"{text!r} is neither WORLD/BODY, such as ENU/FLU, nor one of {', '.join(PRESETS)}")
    matrices = axes_matrix(world), axes_matrix(body)
    if _handedness(matrices[0]) != _handedness(matrices[1]):
        raise ValueError(f"{text!r}: of world and body one is right-handed and one left-handed")
    return matrices


def parse_rotation(text: str) -> Array:
    """Return the rotation matrix [3, 3] of a text with numbers between commas.

    They are roll, pitch and yaw in degrees (about x, then y, then z, all fixed), a quaternion w, x, y, z, or a matrix
    row by row. Raises ValueError for another text.
    """
    numbers = [float(part) for part in text.split(",")]
    if len(numbers) not in (3, 4, 9):
        raise ValueError(f"{text!r}: 3, 4 or 9 numbers make a rotation, not {len(numbers)}")
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"{text!r} is no rotation")
    if len(numbers) == 4:
        return rotation_from_quat_wxyz(numbers)
    matrix = np.array(numbers).reshape(3, 3) if len(numbers) == 9 else rotations_from_euler(np.radians(numbers))
    if not np.abs(matrix @ matrix.T - np.eye(3)).max() < 1000 * ORTHONORMAL or _handedness(matrix) < 0:
        raise ValueError(f"{text!r} is no rotation")
    return rotation_from_quat_wxyz(quat_wxyz_from_rotation(matrix))  # exactly orthonormal


def _handedness(matrix: Array) -> float:
    return math.copysign(1.0, float(np.linalg.det(matrix)))


@dataclass(frozen=True, slots=True, eq=False)
class FrameChange:
    """The conversion of a recorded trajectory to the vehicle's, north-east-down or forward-right-down.

    Attributes:
        world: maps the recording's world to NED, or to FRD at the start, [3, 3].
        body: maps the recording's body to FRD, [3, 3], as mirrored as ``world``.
        mounting: maps the FRD axes of the recording's body to the vehicle's, [3, 3].
        yaw_rad: rotation of the world, clockwise seen from above.
        from_zero: whether the first position becomes the origin.
        scale: factor for positions and velocities, positive.
    """

    world: Array
    body: Array
    mounting: Array
    yaw_rad: float = 0.0
    from_zero: bool = False
    scale: float = 1.0

    def apply(self, trajectory: Trajectory) -> Trajectory:
        """Return the trajectory of the vehicle: attitudes from FRD, positions and velocities in NED or FRD."""
        sign = _handedness(self.world)
        world = rotations_from_euler((0.0, 0.0, self.yaw_rad)) @ self.world
        origin = trajectory.positions[0] if self.from_zero else np.zeros(3)
        velocities = trajectory.velocities
        # Two mirrored matrices make a rotation together, and so do the two that are left without their mirrors.
        left, right = (quat_wxyz_from_rotation(sign * matrix) for matrix in (world, self.mounting @ self.body))
        return replace(
            trajectory,
            positions=(trajectory.positions - origin) @ world.T * self.scale,
            quats_wxyz=product(product(left, trajectory.quats_wxyz), inverse(right)),
            velocities=None if velocities is None else velocities @ world.T * self.scale,
            covariances=self._covariances(trajectory.covariances, world, sign),
        )

    def _covariances(self, covariances: Array | None, world: Array, sign: float) -> Array | None:
        if covariances is None:
            return None
        change = np.zeros((6, 6))
        change[:3, :3], change[3:, 3:] = self.scale * world, sign * world  # a rotation vector is an axial one
        changed: Array = change @ covariances @ change.T
        return changed
