# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of the companion's side, and the only matrices that change handedness.

World: ENU (x east, y north, z up). Body: FLU (x forward, y left, z up), its origin in the IMU. Camera: x right, y down,
z along the view. At the MAVLink edge the body is FRD and the local frame NED or LOCAL_FRD.
"""

import math
from types import MappingProxyType
from typing import Final

import numpy as np

from viso.geometry.rotation import Array

GRAVITY_MSS: Final = 9.80665


def _fixed(rows: list[list[float]]) -> Array:
    matrix = np.array(rows, dtype=np.float64)
    matrix.flags.writeable = False
    return matrix


# From a body's FLU axes to its FRD axes, and from ENU to NED; each is its own inverse.
FLU_TO_FRD: Final = _fixed([[1, 0, 0], [0, -1, 0], [0, 0, -1]])
ENU_TO_NED: Final = _fixed([[0, 1, 0], [1, 0, 0], [0, 0, -1]])

# B_R_C of a camera that looks ahead, and of one that looks down with the top of its image forward.
MOUNTINGS: Final = MappingProxyType(
    {
        "forward": _fixed([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]),
        "nadir": _fixed([[0, -1, 0], [-1, 0, 0], [0, 0, -1]]),
    }
)


def yaw_of_heading(heading_rad: float) -> float:
    """Return the ENU yaw (0 = east, counter-clockwise) in (-pi, pi] of a heading (0 = north, clockwise)."""
    yaw = math.remainder(0.5 * math.pi - heading_rad, 2 * math.pi)
    return math.pi if yaw == -math.pi else yaw
