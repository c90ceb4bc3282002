# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages that carry external navigation."""

from typing import Final

from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)

VISION_TYPES: Final[tuple[type[Message], ...]] = (
    ODOMETRY,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    VISION_POSITION_DELTA,
    VICON_POSITION_ESTIMATE,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ATT_POS_MOCAP,
)
VISION_NAMES: Final = frozenset(cls.__name__ for cls in VISION_TYPES)
