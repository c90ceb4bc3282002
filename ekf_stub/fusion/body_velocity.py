# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a velocity in the body frame depends on the errors, which body odometry and optical flow have in common."""

import numpy as np

from ekf_stub.filter.attitude import body_axes_by_attitude
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.states import ATT, STATES, VEL


def velocity_row(state: ErrorState, axis: int) -> Array:
    """Return how the velocity along an axis of the body, 0..2, depends on the errors, shape (22,)."""
    quat = state.quat
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    by_velocity = (
        (w * w + x * x - y * y - z * z, 2 * (w * z + x * y), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (w * x + y * z)),
        (2 * (w * y + x * z), 2 * (y * z - w * x), w * w - x * x - y * y + z * z),
    )
    row = np.zeros(STATES)
    row[ATT], row[VEL] = body_axes_by_attitude(quat, state.vel)[axis], by_velocity[axis]
    return row
