# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts together what a core says of itself (AP_NavEKF3/AP_NavEKF3_Logging.cpp, AP_NavEKF3_Outputs.cpp)."""

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from ekf_stub.core_report import CoreReport, Three
from ekf_stub.error_state import euler_of
from ekf_stub.inertial import Array

if TYPE_CHECKING:
    from ekf_stub.ekf3_core import Ekf3Core

_FIRMWARE_STATES: Final = 24  # with magnetic field and wind, which are not estimated here
_BAD_QUAT, _BAD_VEL = 1 << 0, 1 << 1


def three(vector: Array) -> Three:
    """Return a vector as plain floats."""
    x, y, z = vector.tolist()
    return x, y, z


def report_of(core: "Ekf3Core", now_ms: int) -> CoreReport:
    """Return what a core that has a state knows at a time."""
    output, state, innovations = core.output, core.state, core.fusion.innovations
    quat, dt = output.now.quat, core.dt_ekf_avg
    moved = core.resets.moved_ne
    faults = 0 if np.isfinite(state.vel).all() else _BAD_VEL
    return CoreReport(
        rpy_rad=euler_of(quat),
        quat_wxyz=(quat.w, quat.x, quat.y, quat.z),
        vel_ned=three(output.now.vel),
        pos_ned=three(core.position()),
        height_rate=output.height_rate,
        gyro_bias=three(state.gyro_bias / dt),
        accel_bias=three(state.accel_bias / dt),
        origin_height_m=core.origin_alt_m(),
        vel_innovation=three(innovations.vel),
        pos_innovation=three(innovations.pos),
        yaw_innovation=core.yaw.innovation,
        mag_innovation=three(core.yaw.field.innovation),
        earth_field=three(state.earth_field),
        body_field=three(state.body_field),
        mag_fusion=core.yaw.mag_fusion,
        vel_ratio=innovations.vel_ratio,
        pos_ratio=innovations.pos_ratio,
        height_ratio=innovations.height_ratio,
        mag_ratio=float(core.yaw.field.ratios.max()),
        yaw_ratio=core.yaw.ratio,
        tilt_error_rad=math.sqrt(state.predicted_tilt_variance),
        moved_ne=(float(moved[0]), float(moved[1])),
        faults=faults | (0 if math.isfinite(quat.w) else _BAD_QUAT),
        timeouts=core.control.timeouts(now_ms),
        flags=core.control.flags,
        gps_bits=0,
        angle_error=output.angle_error,
        vel_error=output.vel_error,
        pos_error=output.pos_error,
        variances=(*state.cov.diagonal().tolist(), *[0.0] * (_FIRMWARE_STATES - state.cov.shape[0])),
        odometry=core.odometry.report(),
        stillness=core.stillness.report,
        source_set=core.sources.active_set,
    )
