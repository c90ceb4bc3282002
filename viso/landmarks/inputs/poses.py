# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of vehicles that tell them in ENU, or in NED as the autopilot does."""

import math

from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.geometry.rotation import Array, rotation_from_quat_wxyz, rotations_from_euler, yaw_of
from viso.landmarks.inputs.base import LARGEST_M, Refused
from viso.landmarks.types import VehiclePose

_UNIT_LENGTH = 0.05


def rotation_of_quat(quat_wxyz: tuple[float, float, float, float]) -> Array:
    """Return the rotation matrix [3, 3] of a quaternion. Raises Refused if its length is not 1 within 5 %."""
    if not abs(math.hypot(*quat_wxyz) - 1) <= _UNIT_LENGTH:
        raise Refused("an attitude that is no rotation")
    return rotation_from_quat_wxyz(quat_wxyz)


def ned_R_frd(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Return the attitude [3, 3] of the autopilot's angles, which turn about z, then y, then x.

    Raises Refused if one is not finite.
    """
    if not math.isfinite(roll_rad + pitch_rad + yaw_rad):
        raise Refused("an attitude that is no rotation")
    return rotations_from_euler((roll_rad, pitch_rad, yaw_rad))


def pose_from_enu(t_s: float, position_enu: tuple[float, float, float], enu_R_flu: Array) -> VehiclePose:
    """Return a pose with full attitude. Raises Refused if the position is not finite, or far off any map."""
    if not all(abs(value) <= LARGEST_M for value in position_enu):
        raise Refused("a position out of range")
    x_m, y_m, z_m = position_enu
    return VehiclePose(t_s, x_m, y_m, yaw_of(enu_R_flu), z_m, enu_R_flu)


def pose_from_ned(t_s: float, position_ned: tuple[float, float, float], attitude: Array) -> VehiclePose:
    """Return the pose of a position in NED and an attitude [3, 3] from FRD to NED, as :func:`pose_from_enu`."""
    north_m, east_m, down_m = position_ned
    return pose_from_enu(t_s, (east_m, north_m, -down_m), ENU_TO_NED.T.dot(attitude).dot(FLU_TO_FRD))
