# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs what a filter estimates: the XKF records (AP_NavEKF3/AP_NavEKF3_Logging.cpp).

They are written for each core that it stands for. What it does not estimate is 0: wind, airspeed.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import int_of_float
from ap_core.fmath import RAD_TO_DEG, f32, ieee754
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.sinks import RecordSink
from ekf_stub.core.core import Core
from ekf_stub.core.vectors import limited
from ekf_stub.log.ekf_log_structure import (
    XKF1,
    XKF2,
    XKF3,
    XKF4,
    XKF5,
    XKFD,
    XKFM,
    XKFS,
    XKQ,
    XKTV,
    XKV1,
    XKV2,
    XKY0,
    XKY1,
)
from ekf_stub.reports import CoreReport, GsfReport

COVARIANCE_INTERVAL_MS: Final = 490
PERIOD_US: Final = 100_000

_ONLY_XKF4: Final = 1  # of EK3_LOG_LEVEL
_NOTHING: Final = 3
_STATES_OF_XKV1: Final = 12
_U32: Final = 0xFFFFFFFF  # of times in ms, which wrap
_100: Final = f32(100)
_HIGHEST_M: Final = 327.67  # of a height in cm, of 16 bits
_FULL_TURN_CDEG: Final = f32(36000)
_ANGLES, _OTHERS, _FIELDS = 7, 9, 9  # of what XKF1 to XKF3 have scaled in single precision, and by what
_SCALES: Final = np.repeat(np.array((RAD_TO_DEG, 1, 1000), np.float32), (_ANGLES, _OTHERS, _FIELDS))

Values = tuple[LogValue, ...]


class EkfLog:
    """Writes the records of the cores that a filter stands for, each core's after the other's.

    ``get_int`` takes a parameter's full name.
    """

    def __init__(
        self,
        logger: RecordSink,
        get_int: Callable[[str], int],
        cores: tuple[int, ...],
        primary: Callable[[], int],
    ) -> None:
        self._logger = logger
        self._get_int = get_int
        self._cores = cores
        self._primary = primary
        self._covariance_ms = 0
        self._odometry_recalled = 0

    # Whatever EK3_LOG_LEVEL says

    def log_pass(self, core: Core, now_us: int) -> None:
        """Write what the filter itself writes as it runs, after a pass in which it has something to log."""
        if core.logs_stillness:
            test = core.stillness
            lengths = test.gyro_length_ratio, test.accel_length_ratio
            self._write_all(XKFM, now_us, (test.is_still, *lengths, test.gyro_diff_ratio, test.accel_diff_ratio))
        if core.logs_tilt:
            variance = core.state.predicted_tilt_var
            self._write_all(XKTV, now_us, (variance, variance))

    def _write_all(self, structure: LogStructure, now_us: int, values: Values) -> None:
        for core in self._cores:
            self._logger.write(structure, (now_us, core, *values))

    # As EK3_LOG_LEVEL says

    def write_streaming(self, report: CoreReport, now_us: int) -> None:
        """Write the records of a moment; called by the task that logs attitude, after ATT."""
        level = self._get_int("EK3_LOG_LEVEL")
        if level >= _NOTHING:
            return
        primary, cores = self._primary(), self._cores
        records = [(XKF4, _xkf4(report, primary), False)]
        if level != _ONLY_XKF4 and report.gsf is not None:
            innovations = (*report.gsf.innovations_north, *report.gsf.innovations_east)
            records += [(XKY0, _xky0(report.gsf), False), (XKY1, innovations, False)]
        if level < _ONLY_XKF4:
            records += self._further_records(report, now_us // 1000, of_primary=primary in cores)
        for core in cores:
            for structure, values, is_of_primary in records:
                if core == primary or not is_of_primary:
                    self._logger.write(structure, (now_us, core, *values))

    def _further_records(
        self, report: CoreReport, now_ms: int, *, of_primary: bool
    ) -> list[tuple[LogStructure, Values, bool]]:
        """Return the records of a core after XKF4, and which of them only the primary one has."""
        xkf1, xkf2, xkf3 = _xkf1_to_3(report)
        records = [
            (XKF1, xkf1, False),
            (XKF2, xkf2, False),
            (XKF3, xkf3, False),
            (XKF5, _xkf5(report), True),
            (XKFS, (0, report.baro, report.gps, 0, report.source_set, 0, 0, report.mag_fusion), False),
            (XKQ, report.quat_wxyz, False),
        ]
        if not of_primary:
            return records
        if report.odometry is not None and report.odometry.recalled != self._odometry_recalled:
            self._odometry_recalled = report.odometry.recalled
            records.append((XKFD, (*report.odometry.innovation, *report.odometry.variance), True))
        if (now_ms - self._covariance_ms) & _U32 > COVARIANCE_INTERVAL_MS:
            self._covariance_ms = now_ms
            records.append((XKV1, report.variances[:_STATES_OF_XKV1], True))
            records.append((XKV2, report.variances[_STATES_OF_XKV1:], True))
        return records


@ieee754
def _xkf1_to_3(report: CoreReport) -> tuple[Values, Values, Values]:
    """Return XKF1, XKF2 and XKF3; what the firmware scales in single precision is scaled all at once."""
    angles = *report.rpy_rad, *report.gyro_bias, report.yaw_innovation
    others = *report.accel_bias, *report.vel_innovation, *report.pos_innovation
    fields = *report.mag_innovation, *report.earth_field, *report.body_field
    scaled = np.array((*angles, *others, *fields), np.float32) * _SCALES
    milligauss = list(map(int_of_float, scaled[-_FIELDS:].tolist()))
    roll, pitch, yaw, gx, gy, gz, yaw_innovation, ax, ay, az, *innovations = scaled[:-_FIELDS]
    motion = (*report.vel_ned, report.height_rate, *report.pos_ned)
    return (
        (roll, pitch, _heading_cdeg(yaw), *motion, gx, gy, gz, report.origin_alt_cm),
        (ax, ay, az, 0, 0, *milligauss[3:], 0.0, 0.0, 0.0),
        (*innovations, *milligauss[:3], yaw_innovation, 0, report.relative_error, report.error_score),
    )


def _heading_cdeg(yaw_deg: np.float32) -> int:
    cdeg = np.fmod(_100 * yaw_deg, _FULL_TURN_CDEG)
    return int_of_float(float(cdeg + _FULL_TURN_CDEG if cdeg < 0 else cdeg))


@ieee754
def _xkf4(report: CoreReport, primary: int) -> Values:
    ratios = (report.vel_ratio, report.pos_ratio, report.height_ratio, max(report.mag_ratio, report.yaw_ratio))
    roots = [f32(math.sqrt(ratio)) for ratio in ratios]  # single precision, in which the firmware scales them
    health = (report.faults, report.timeouts, report.flags)
    return (*roots, 0, report.tilt_error_rad, *report.moved_ne, *health, 0, primary)


def _xkf5(report: CoreReport) -> Values:
    terrain = report.terrain
    x, y = terrain.flow_innovation
    above = limited(terrain.above, -_HIGHEST_M, _HIGHEST_M)
    heights = above, terrain.down, terrain.range_innovation, terrain.range_m, terrain.sigma
    return (
        int_of_float(min(100 * terrain.flow_ratio, 255.0)),
        int_of_float(1000 * x),
        int_of_float(1000 * y),
        int_of_float(1000 * terrain.ground_innovation),
        *heights,
        report.angle_error,
        report.vel_error,
        report.pos_error,
    )


def _xky0(gsf: GsfReport) -> Values:
    yaw, *yaws = (math.degrees(yaw) % 360 for yaw in (gsf.yaw, *gsf.yaws))
    return (yaw, math.sqrt(math.degrees(gsf.variance)), *yaws, *gsf.weights)
