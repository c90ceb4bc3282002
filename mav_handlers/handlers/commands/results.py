# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of commands and of their results, and the conversion of command parameters to integers."""

import math
from enum import IntEnum
from typing import Final

from ap_core.cint import u32, u64

_I64_LIMIT: Final = 1 << 63


class MavResult(IntEnum):
    """MAV_RESULT values that the firmware uses here."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5


class MavCmd(IntEnum):
    """MAV_CMD values that have a handler, or that carry a location."""

    NAV_LOITER_UNLIM = 17
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_VTOL_TAKEOFF = 84
    NAV_VTOL_LAND = 85
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_REPOSITION = 192
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI = 201
    DO_AUX_FUNCTION = 218
    DO_SET_MISSION_CURRENT = 224
    PREFLIGHT_CALIBRATION = 241
    PREFLIGHT_STORAGE = 245
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    GET_HOME_POSITION = 410
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    DO_JUMP_TAG = 601
    DO_SET_GLOBAL_ORIGIN = 611
    SET_EKF_SOURCE_SET = 42007
    DO_SEND_BANNER = 42428
    EXTERNAL_POSITION_ESTIMATE = 43003
    EXTERNAL_WIND_ESTIMATE = 43004


def accepted_if(ok: bool) -> MavResult:
    """Return ACCEPTED if ``ok``, else FAILED."""
    return MavResult.ACCEPTED if ok else MavResult.FAILED


def u32_of_float(value: float) -> int:
    """Return a parameter as the firmware's uint32_t."""
    # x86-64 converts to uint32_t through a 64-bit register; NaN and values out of range give 0.
    return u32(math.trunc(value)) if -_I64_LIMIT <= value < _I64_LIMIT else 0


def u64_of_float(value: float) -> int:
    """Return a parameter as the firmware's uint64_t."""
    # x86-64 converts the upper half after taking 2**63 off; values out of range become its sign bit.
    if value >= 2 * _I64_LIMIT:
        return 0
    return u64(math.trunc(value)) if value >= -_I64_LIMIT else _I64_LIMIT
