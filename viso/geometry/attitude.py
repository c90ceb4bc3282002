# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitudes, body (FRD) to earth (NED), as angles."""

from ekf_stub.core import vectors
from viso.geometry import quaternions as quaternion


def euler_of(quat: quaternion.quaternion) -> tuple[float, float, float]:
    """Return roll, pitch and yaw (3-2-1) in rad."""
    return vectors.euler_of((quat.w, quat.x, quat.y, quat.z))
