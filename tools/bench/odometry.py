# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stream that benches send: ODOMETRY with covariance, 30 times per second, from a camera that sways."""

import math
from typing import Final

from mav_handlers.wire.messages import ODOMETRY

PERIOD_US: Final = 33_333
_COVARIANCE: Final = (1e-3, *[0.0] * 5, 1e-3, *[0.0] * 4, 1e-3, *[0.0] * 3, 1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)
_SWAY_M: Final = 0.02
_SWAY_RAD_S: Final = 1.0
_LOCAL_FRD: Final = 20
_BODY_FRD: Final = 12


def odometry_at(time_us: int) -> ODOMETRY:
    """Return what the camera sends of a moment: near the origin, level, heading north."""
    phase = _SWAY_RAD_S * time_us * 1e-6
    north, vel_north = _SWAY_M * math.sin(phase), _SWAY_M * _SWAY_RAD_S * math.cos(phase)
    pose = (north, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0))
    motion = (vel_north, 0.0, 0.0, 0.0, 0.0, 0.0)
    return ODOMETRY(time_us, _LOCAL_FRD, _BODY_FRD, *pose, *motion, _COVARIANCE, _COVARIANCE, 0, 0, 90)
