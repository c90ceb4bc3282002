# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a core at a moment (AP_NavEKF3/AP_NavEKF3_Logging.cpp, AP_NavEKF3_Outputs.cpp)."""

import math
from typing import Final

from ekf_stub.core.core import Core
from ekf_stub.core.gps_yaw import GpsYaw
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.vectors import euler_of, scaled
from ekf_stub.reports import (
    CoreReport,
    GsfReport,
    OdometryReport,
    StillnessReport,
    TerrainReport,
)

UNINITIALISED: Final = CoreReport()
"""The report of a core before it has a state."""

_WIND: Final = (0.0, 0.0)  # of the firmware's states, and not estimated
_BAD_QUAT, _BAD_VEL = 1 << 0, 1 << 1


def report_of(lanes: Lanes, index: int) -> CoreReport:
    """Return the report of the core of an index after the last pass."""
    core = lanes.cores[index]
    if not core.initialised:
        return UNINITIALISED
    state, output, vel_pos, yaw = core.state, core.output, core.vel_pos, core.yaw
    now, per_second = output.now, 1.0 / core.dt_ekf_avg
    faults = 0 if all(map(math.isfinite, state.vel)) else _BAD_VEL
    return CoreReport(
        rpy_rad=euler_of(now.quat),
        quat_wxyz=now.quat,
        vel_ned=now.vel,
        pos_ned=core.position(),
        height_rate=output.height_rate,
        gyro_bias=scaled(state.gyro_bias, per_second),
        accel_bias=scaled(state.accel_bias, per_second),
        origin_alt_cm=core.origin_alt_cm(),
        vel_innovation=vel_pos.vel_innovation,
        pos_innovation=vel_pos.pos_innovation,
        yaw_innovation=yaw.innovation,
        mag_innovation=yaw.field.innovation,
        earth_field=state.earth_field,
        body_field=state.body_field,
        mag_fusion=yaw.mag_fusion,
        vel_ratio=vel_pos.vel_ratio,
        pos_ratio=vel_pos.pos_ratio,
        height_ratio=vel_pos.height_ratio,
        mag_ratio=max(yaw.field.ratios),
        yaw_ratio=yaw.ratio,
        tilt_error_rad=math.sqrt(state.predicted_tilt_var),
        moved_ne=core.resets.moved_ne,
        faults=faults | (0 if math.isfinite(now.quat[0]) else _BAD_QUAT),
        timeouts=core.timeouts(lanes.now_us // 1000),
        flags=core.flags,
        angle_error=output.angle_error,
        vel_error=output.vel_error,
        pos_error=output.pos_error,
        variances=(*state.cov.variances(), *_WIND),
        odometry=_odometry_of(core),
        terrain=_terrain_of(core),
        stillness=_stillness_of(core),
        source_set=core.sources.active_set,
        gsf=_gsf_of(yaw.by_gps),
        error_score=lanes.error_scores[index],
        relative_error=lanes.relative_errors[index],
    )


def _stillness_of(core: Core) -> StillnessReport | None:
    """Return the result of the test for standing still; None while it does not run."""
    test = core.stillness
    if not test.is_tested:
        return None
    return StillnessReport(
        test.is_still,
        test.gyro_length_ratio,
        test.accel_length_ratio,
        test.gyro_diff_ratio,
        test.accel_diff_ratio,
    )


def _odometry_of(core: Core) -> OdometryReport | None:
    odometry = core.odometry
    return OdometryReport(odometry.recalled, odometry.innovation, odometry.variance) if odometry.recalled else None


def _gsf_of(by_gps: GpsYaw) -> GsfReport | None:
    gsf = by_gps.gsf
    if not gsf.is_running:
        return None
    yaw, variance = gsf.estimate()
    return GsfReport(
        yaw,
        variance,
        tuple(model.yaw for model in gsf.models),
        tuple(model.weight for model in gsf.models),
        tuple(model.innovation_north for model in gsf.models),
        tuple(model.innovation_east for model in gsf.models),
    )


def _terrain_of(core: Core) -> TerrainReport:
    terrain, flow = core.height.terrain, core.flow
    return TerrainReport(
        above=terrain.above,
        down=terrain.down,
        sigma=terrain.sigma,
        range_m=terrain.ranges.distance,
        range_innovation=terrain.range_innovation,
        range_ratio=terrain.range_ratio,
        flow_innovation=flow.innovations,
        flow_ratio=max(flow.ratios),
        ground_innovation=math.hypot(*terrain.flow_innovation),
    )
