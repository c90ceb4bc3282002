# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs what the filter estimates: the XKF records (AP_NavEKF3/AP_NavEKF3_Logging.cpp).

There is one filter; what it says is written for each core. What it does not estimate is 0: wind, terrain, airspeed.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import int_of_float, u32
from ap_core.fmath import degrees, f32
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.sinks import RecordSink
from ekf_stub.core_report import CoreReport, OdometryReport, Three
from ekf_stub.ekf_log_structure import XKF1, XKF2, XKF3, XKF4, XKF5, XKFD, XKFM, XKFS, XKQ, XKTV, XKV1, XKV2

UNINITIALISED_FAULT: Final = 128
COVARIANCE_INTERVAL_MS: Final = 490
TILT_INTERVAL_MS: Final = 500
STILLNESS_INTERVAL_MS: Final = 200
PERIOD_US: Final = 100_000

_ONLY_XKF4: Final = 1  # of EK3_LOG_LEVEL
_NOTHING: Final = 3
_STATES_OF_XKV1: Final = 12
_FULL_TURN_CDEG: Final = f32(36000)
_REST: Final = (0.0, 0.0, 0.0)

UNINITIALISED: Final = CoreReport(
    rpy_rad=_REST,
    quat_wxyz=(1.0, 0.0, 0.0, 0.0),
    vel_ned=_REST,
    pos_ned=_REST,
    height_rate=0.0,
    gyro_bias=_REST,
    accel_bias=_REST,
    origin_height_m=0.0,
    vel_innovation=_REST,
    pos_innovation=_REST,
    yaw_innovation=0.0,
    mag_innovation=_REST,
    earth_field=_REST,
    body_field=_REST,
    mag_fusion=0,
    vel_ratio=0.0,
    pos_ratio=0.0,
    height_ratio=0.0,
    mag_ratio=0.0,
    yaw_ratio=0.0,
    tilt_error_rad=0.0,
    moved_ne=(0.0, 0.0),
    faults=UNINITIALISED_FAULT,
    timeouts=0,
    flags=0,
    gps_bits=0,
    angle_error=0.0,
    vel_error=0.0,
    pos_error=0.0,
    variances=(0.0,) * 24,
    odometry=None,
    stillness=None,
    source_set=0,
)
"""What a core says before it has a state."""

Values = tuple[LogValue, ...]


class EkfLog:
    """Writes the records of all cores, each core's after the other's.

    Args:
        logger: where the records go.
        get_int: returns an integer parameter by its full name.
        cores: returns the numbers of the cores, 0 first.
    """

    def __init__(self, logger: RecordSink, get_int: Callable[[str], int], cores: Callable[[], tuple[int, ...]]) -> None:
        self._logger = logger
        self._get_int = get_int
        self._get_cores = cores
        self._set_up: tuple[int, ...] = ()
        self._covariance_ms = self._tilt_ms = self._stillness_ms = 0
        self._was_still = False
        self._odometry_recalled = 0

    # Whatever EK3_LOG_LEVEL says

    def is_due(self, now_us: int, is_still: bool | None, *, is_step: bool) -> bool:
        """Tell whether :meth:`update` would write anything: not in every frame is it worth making a report.

        Args:
            now_us: time of the frame.
            is_still: the answer of the test for standing still, None while the test does not run.
            is_step: whether the filter has made a step.
        """
        now_ms = now_us // 1000
        if is_still is None:
            self._was_still = False
        elif self._stillness_is_due(now_ms, is_still):
            return True
        return is_step and self._tilt_is_due(now_ms)

    def update(self, report: CoreReport, now_us: int, *, is_step: bool = True) -> None:
        """Write what the filter itself writes as it runs; called after it, in any frame in which something is due.

        XKFM comes when its answer changes or after more than 200 ms, XKTV in the first step after more than 500 ms.
        """
        now_ms = now_us // 1000
        still = report.stillness
        if still is not None and self._stillness_is_due(now_ms, still.is_still):
            self._stillness_ms, self._was_still = now_ms, still.is_still
            lengths = still.gyro_length_ratio, still.accel_length_ratio
            self._write_all(XKFM, now_us, (still.is_still, *lengths, still.gyro_diff_ratio, still.accel_diff_ratio))
        if is_step and self._tilt_is_due(now_ms):
            self._tilt_ms = now_ms
            self._write_all(XKTV, now_us, (report.tilt_error_rad**2,) * 2)

    def _cores(self) -> tuple[int, ...]:
        # What EK3_IMU_MASK says later counts from the next boot on.
        self._set_up = self._set_up or self._get_cores() or (0,)
        return self._set_up

    def _stillness_is_due(self, now_ms: int, is_still: bool) -> bool:
        return is_still != self._was_still or u32(now_ms - self._stillness_ms) > STILLNESS_INTERVAL_MS

    def _tilt_is_due(self, now_ms: int) -> bool:
        return u32(now_ms - self._tilt_ms) > TILT_INTERVAL_MS

    def _write_all(self, structure: LogStructure, now_us: int, values: Values) -> None:
        for core in self._cores():
            self._logger.write(structure, (now_us, core, *values))

    # As EK3_LOG_LEVEL says

    def write_streaming(self, report: CoreReport, now_us: int) -> None:
        """Write the records of a moment; called by the task that logs attitude, after ATT."""
        level = self._get_int("EK3_LOG_LEVEL")
        if level >= _NOTHING:
            return
        with np.errstate(over="ignore", invalid="ignore"):
            records = self._records(report, now_us // 1000, only_xkf4=level >= _ONLY_XKF4)
        primary = self._primary()
        for core in self._cores():
            for structure, values, is_of_primary in records:
                if core == primary or not is_of_primary:
                    self._logger.write(structure, (now_us, core, *values))

    def _primary(self) -> int:
        primary, cores = self._get_int("EK3_PRIMARY"), self._cores()
        return primary if primary in cores else cores[0]

    def _records(self, report: CoreReport, now_ms: int, *, only_xkf4: bool) -> list[tuple[LogStructure, Values, bool]]:
        """Return what is to be written for a core, and what of it for the primary one alone."""
        records = [(XKF4, _xkf4(report, self._primary()), False)]
        if only_xkf4:
            return records
        records += [
            (XKF1, _xkf1(report), False),
            (XKF2, _xkf2(report), False),
            (XKF3, _xkf3(report), False),
            (XKF5, _xkf5(report), True),
            (XKFS, (0, 0, 0, 0, report.source_set, 0, 0, report.mag_fusion), False),
            (XKQ, report.quat_wxyz, False),
        ]
        if report.odometry is not None and report.odometry.recalled != self._odometry_recalled:
            self._odometry_recalled = report.odometry.recalled
            records.append((XKFD, _xkfd(report.odometry), True))
        if u32(now_ms - self._covariance_ms) > COVARIANCE_INTERVAL_MS:
            self._covariance_ms = now_ms
            records.append((XKV1, report.variances[:_STATES_OF_XKV1], True))
            records.append((XKV2, report.variances[_STATES_OF_XKV1:], True))
        return records


def _single(*values: float) -> Values:
    """Return values in the single precision in which the firmware scales them."""
    return tuple(map(f32, values))


def _deg(angles_rad: Three) -> Values:
    return tuple(degrees(f32(angle)) for angle in angles_rad)


def _milli(field_gauss: Three) -> Values:
    return tuple(int_of_float(float(f32(1000) * f32(part))) for part in field_gauss)


def _heading_cdeg(yaw_rad: float) -> int:
    cdeg = np.fmod(f32(100) * degrees(f32(yaw_rad)), _FULL_TURN_CDEG)
    return int_of_float(float(cdeg + _FULL_TURN_CDEG if cdeg < 0 else cdeg))


def _xkf1(report: CoreReport) -> Values:
    roll, pitch, _ = _deg(report.rpy_rad)
    attitude = (roll, pitch, _heading_cdeg(report.rpy_rad[2]))
    motion = (*report.vel_ned, report.height_rate, *report.pos_ned)
    return (*attitude, *motion, *_deg(report.gyro_bias), round(100 * report.origin_height_m))


def _xkf2(report: CoreReport) -> Values:
    return (*_single(*report.accel_bias), 0, 0, *_milli(report.earth_field), *_milli(report.body_field), 0.0, 0.0, 0.0)


def _xkf3(report: CoreReport) -> Values:
    innovations = _single(*report.vel_innovation, *report.pos_innovation)
    error_score = max(0.5 * (report.vel_ratio + report.pos_ratio), report.height_ratio)
    return (*innovations, *_milli(report.mag_innovation), degrees(f32(report.yaw_innovation)), 0, 0.0, error_score)


def _xkf4(report: CoreReport, primary: int) -> Values:
    ratios = (report.vel_ratio, report.pos_ratio, report.height_ratio, max(report.mag_ratio, report.yaw_ratio))
    health = (report.faults, report.timeouts, report.flags, report.gps_bits)
    return (*_single(*map(math.sqrt, ratios)), 0, report.tilt_error_rad, *report.moved_ne, *health, primary)


def _xkf5(report: CoreReport) -> Values:
    return (*(0,) * 9, report.angle_error, report.vel_error, report.pos_error)


def _xkfd(odometry: OdometryReport) -> Values:
    return (*odometry.innovation, *odometry.variance)
