# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle is fitted with, as its parameters say."""

from ap_core.param import ParamTable
from ap_core.vector3 import Vector3f


def has_flow(params: ParamTable) -> bool:
    """Return whether there is to be a flow sensor (AP_OpticalFlow::enabled)."""
    return params.get_int("FLOW_TYPE") != 0


def has_compass(params: ParamTable) -> bool:
    """Return whether there is a compass, and in use."""
    return params.get_int("COMPASS_ENABLE") != 0 and params.get_int("COMPASS_USE") != 0


def imu_pos(params: ParamTable, imu: int = 0) -> Vector3f:
    """Return the place of an IMU on the vehicle, m, body (FRD)."""
    return Vector3f(*(params.get_float(f"INS_POS{imu + 1}_{axis}") for axis in "XYZ"))


def imu_mask(params: ParamTable) -> int:
    """Return which IMUs get a core; none when EK3_ENABLE is off."""
    return params.get_int("EK3_IMU_MASK") if params.get_int("EK3_ENABLE") else 0
