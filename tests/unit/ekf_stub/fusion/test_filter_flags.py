# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Status flags of the situations that were recorded."""

from typing import Any

import pytest

from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.fusion.filter_flags import FilterState, filter_flags

PARKED: dict[str, Any] = {
    **dict.fromkeys(("healthy", "tilt_aligned", "yaw_aligned", "uses_compass", "vel_timeout"), True),
    **dict.fromkeys(("pos_timeout", "height_timeout", "has_vertical_velocity", "odometry_in_use"), False),
    "mode": AidingMode.NONE,
}
NO_COMPASS = {"uses_compass": False}
UNALIGNED = {"yaw_aligned": False}
ABSOLUTE = {"mode": AidingMode.ABSOLUTE, "vel_timeout": False}
LOST = {"mode": AidingMode.ABSOLUTE, "pos_timeout": True}
RELATIVE = {"mode": AidingMode.RELATIVE, "odometry_in_use": True}


@pytest.mark.parametrize(("state", "flags"), [
    ({"healthy": False}, 1024),
    ({"tilt_aligned": False}, 0),
    ({}, 167),
    (UNALIGNED, 0),
    ({**UNALIGNED, **NO_COMPASS}, 167),
    ({**UNALIGNED, **NO_COMPASS, **ABSOLUTE}, 0),
    ({**NO_COMPASS, **ABSOLUTE}, 831),
    (ABSOLUTE, 831),
    ({**ABSOLUTE, "pos_timeout": True}, 39),
    (LOST, 37),
    ({**LOST, "flow_is_valid": True}, 39),
    ({**LOST, "flow_is_valid": True, "ground_is_valid": True}, 367),
    (RELATIVE, 303),
    ({"odometry_in_use": True}, 167),
    ({"height_timeout": True}, 131),
    ({**ABSOLUTE, "height_timeout": True}, 795),
    ({**ABSOLUTE, "height_timeout": True, "has_vertical_velocity": True}, 799),
    ({"height_timeout": True, "has_vertical_velocity": True}, 131),
    ({"height_needs_origin": True}, 135),
    ({"flow_is_valid": True, "pos_timeout": True}, 165),
    ({"ground_is_valid": True}, 231),
    ({"mode": AidingMode.RELATIVE, "pos_timeout": True, "flow_is_valid": True, "ground_is_valid": True}, 367),
])  # fmt: skip
def test_flags_follow_from_the_state(state: dict[str, Any], flags: int) -> None:
    assert filter_flags(FilterState(**{**PARKED, **state})) == flags
