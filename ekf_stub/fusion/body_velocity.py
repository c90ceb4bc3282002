# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a velocity in the body frame depends on the errors, which body odometry and optical flow have in common."""

import numpy as np

from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.states import ATT, STATES, VEL


def velocity_row(state: ErrorState, axis: int) -> Array:
    """Return how the velocity along an axis of the body, 0..2, depends on the errors, shape (22,)."""
    quat, (north, east, down) = state.quat, 2.0 * state.vel
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    along = w * north + z * east - y * down
    across = x * north + y * east + z * down
    over = w * down - x * east + y * north
    aside = w * east + x * down - z * north
    by_attitude = ((along, across, -over, aside), (aside, over, across, -along), (over, -aside, along, across))
    by_velocity = (
        (w * w + x * x - y * y - z * z, 2 * (w * z + x * y), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (w * x + y * z)),
        (2 * (w * y + x * z), 2 * (y * z - w * x), w * w - x * x - y * y + z * z),
    )
    row = np.zeros(STATES)
    row[ATT], row[VEL] = by_attitude[axis], by_velocity[axis]
    return row
