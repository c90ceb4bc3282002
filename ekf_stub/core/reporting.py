# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts together what a core says of itself (AP_NavEKF3/AP_NavEKF3_Logging.cpp, AP_NavEKF3_Outputs.cpp)."""

import math
from typing import Final

from ekf_stub.core.ekf3_core import Ekf3Core
from ekf_stub.filter.attitude import euler_of
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.states import STATES
from ekf_stub.reports.core_report import CoreReport, RunReport, TerrainReport, Three

_NOT_ESTIMATED: Final = (0.0,) * (24 - STATES)  # of the firmware's states: wind
_BAD_QUAT, _BAD_VEL = 1 << 0, 1 << 1


def three(vector: Array) -> Three:
    """Return a vector as plain floats."""
    x, y, z = vector.tolist()
    return x, y, z


def run_report_of(core: Ekf3Core) -> RunReport:
    """Return what a core that has a state says of itself as it runs: a tenth of the work of all that it knows."""
    return RunReport(math.sqrt(core.state.predicted_tilt_variance), core.stillness.report)


def report_of(core: Ekf3Core, now_ms: int) -> CoreReport:
    """Return what a core that has a state knows at a time; not how it compares with others (see ``Lanes``)."""
    output, state, innovations, yaw = core.output, core.state, core.fusion.innovations, core.yaw
    now, moved = output.now, core.resets.moved_ne
    quat = now.quat
    gyro_bias, accel_bias = state.bias_rates(core.dt_ekf_avg)
    faults = 0 if all(map(math.isfinite, state.vel.tolist())) else _BAD_VEL
    return CoreReport(
        rpy_rad=euler_of(quat),
        quat_wxyz=(quat.w, quat.x, quat.y, quat.z),
        vel_ned=three(now.vel),
        pos_ned=three(core.position()),
        height_rate=output.height_rate,
        gyro_bias=gyro_bias,
        accel_bias=accel_bias,
        origin_alt_cm=core.origin_alt_cm(),
        vel_innovation=three(innovations.vel),
        pos_innovation=three(innovations.pos),
        yaw_innovation=yaw.innovation,
        mag_innovation=three(yaw.field.innovation),
        earth_field=three(state.earth_field),
        body_field=three(state.body_field),
        mag_fusion=yaw.mag_fusion,
        vel_ratio=innovations.vel_ratio,
        pos_ratio=innovations.pos_ratio,
        height_ratio=innovations.height_ratio,
        mag_ratio=float(yaw.field.ratios.max()),
        yaw_ratio=yaw.ratio,
        tilt_error_rad=math.sqrt(state.predicted_tilt_variance),
        moved_ne=(float(moved[0]), float(moved[1])),
        faults=faults | (0 if math.isfinite(quat.w) else _BAD_QUAT),
        timeouts=core.control.timeouts(now_ms),
        flags=core.control.flags,
        angle_error=output.angle_error,
        vel_error=output.vel_error,
        pos_error=output.pos_error,
        variances=(*state.cov.diagonal().tolist(), *_NOT_ESTIMATED),
        odometry=core.odometry.report(),
        terrain=_terrain_of(core),
        stillness=core.stillness.report,
        source_set=core.sources.active_set,
        gsf=yaw.by_gps.report(),
    )


def _terrain_of(core: Ekf3Core) -> TerrainReport:
    terrain, flow = core.height.terrain, core.flow
    x, y = flow.innovations
    return TerrainReport(
        above=terrain.above,
        down=terrain.down,
        sigma=math.sqrt(terrain.variance),
        range_m=terrain.ranges.distance,
        range_innovation=terrain.range_innovation,
        range_ratio=terrain.range_ratio,
        flow_innovation=(x, y),
        flow_ratio=max(flow.ratios),
        ground_innovation=math.hypot(*terrain.flow_innovation),
    )
