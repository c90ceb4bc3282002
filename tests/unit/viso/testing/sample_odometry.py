# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A message that the autopilot accepts."""

from dataclasses import replace
from typing import Any

from mav_handlers.wire.messages import ODOMETRY


def odometry(time_usec: int = 1, **fields: Any) -> ODOMETRY:
    """Return a message that the autopilot accepts: level, at rest, heading north, unless told otherwise."""
    zeros = (0.0,) * 21
    still = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    message = ODOMETRY(time_usec, 20, 12, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), *still, zeros, zeros, quality=90)
    return replace(message, **fields)
