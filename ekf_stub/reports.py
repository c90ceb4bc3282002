# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain values that every room may return: what a core knows, what it does, and its texts in words."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, IntFlag
from typing import Final, NamedTuple

from ap_core.print_format import fixed

Three = tuple[float, float, float]

UNINITIALISED_FAULT: Final = 128
_ZERO: Final = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class OdometryReport:
    """The body odometry that was tested last (XKFD): m/s and (m/s)^2, body (FRD).

    ``recalled`` counts the samples that have come due, so that whoever logs can tell a new one.
    """

    recalled: int
    innovation: Three
    variance: Three


@dataclass(frozen=True, slots=True)
class TerrainReport:
    """The ground, and what measured it (XKF5).

    Attributes:
        above, down: of the vehicle above the ground, and of the ground below the origin, m.
        sigma: standard deviation of both, m.
        range_m, range_innovation: the range that was tested last, m.
        range_ratio: of the square of its innovation to the gate.
        flow_innovation: of the flow that the filter tested last, rad/s, about x and y.
        flow_ratio: of the square of the larger one to the gate.
        ground_innovation: of the flow by which the ground was measured, rad/s.
    """

    above: float = 0.0
    down: float = 0.0
    sigma: float = 0.0
    range_m: float = 0.0
    range_innovation: float = 0.0
    range_ratio: float = 0.0
    flow_innovation: tuple[float, float] = (0.0, 0.0)
    flow_ratio: float = 0.0
    ground_innovation: float = 0.0


@dataclass(frozen=True, slots=True)
class GsfReport:
    """What the GSF knows of yaw (XKY0, XKY1): each of its five models by itself, and all together.

    Yaws are in rad, the variance in rad^2, innovations in m/s north and east.
    """

    yaw: float
    variance: float
    yaws: tuple[float, ...]
    weights: tuple[float, ...]
    innovations_north: tuple[float, ...]
    innovations_east: tuple[float, ...]


# Reports are not frozen, as none is ever changed and to make a frozen one takes three times as long.
@dataclass(slots=True)
class StillnessReport:
    """The test for standing still (XKFM): its answer and, each over its limit, what it measures.

    The lengths of turn rate and acceleration, and how fast both change.
    """

    is_still: bool
    gyro_length_ratio: float
    accel_length_ratio: float
    gyro_diff_ratio: float
    accel_diff_ratio: float


@dataclass(slots=True)
class CoreReport:
    """The state of a core, at the present time unless noted. By default it has no state yet.

    Attributes:
        rpy_rad: roll, pitch and yaw of the outputs, without the vehicle's trim.
        quat_wxyz: attitude of the outputs, body (FRD) to earth (NED).
        vel_ned, pos_ned: m/s and m, of the outputs; the position from the origin as it was set.
        height_rate: d(down)/dt of the outputs, m/s.
        gyro_bias, accel_bias: rad/s and m/s/s, body.
        origin_alt_cm: of the origin above mean sea level; 0 without one.
        vel_innovation, pos_innovation: m/s and m, NED, prediction less measurement.
        yaw_innovation: rad.
        mag_innovation: of the compass's three axes, Gauss, body.
        earth_field, body_field: magnetic fields of the earth (NED) and of the vehicle (body), Gauss.
        mag_fusion: 0 while the compass is not in use, 1 while its heading is fused, 2 while its three axes are.
        vel_ratio, pos_ratio, height_ratio, mag_ratio, yaw_ratio: squares of innovations over squares of their gates.
        tilt_error_rad: standard deviation of the direction of down.
        moved_ne: by how much the last reset moved the position, m.
        faults: bits of XKF4.FS.
        timeouts: bits of XKF4.TS.
        flags: bits of XKF4.SS.
        angle_error, vel_error, pos_error: of the outputs as they follow the filter: rad, m/s, m.
        variances: the diagonal of the covariance as the firmware's 24 states have it (XKV1, XKV2).
        odometry: None while there was none.
        terrain: the ground.
        stillness: None while the test does not run.
        source_set: the active one, 0..2.
        baro, gps: the numbers of the barometer and of the GPS that it uses, of a vehicle's own log.
        gsf: None while it is not running.
        error_score: how far the innovations are off, 1 at their gates.
        relative_error: by how much that has been more than that of the primary core, summed up.
    """

    rpy_rad: Three = _ZERO
    quat_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    vel_ned: Three = _ZERO
    pos_ned: Three = _ZERO
    height_rate: float = 0.0
    gyro_bias: Three = _ZERO
    accel_bias: Three = _ZERO
    origin_alt_cm: int = 0
    vel_innovation: Three = _ZERO
    pos_innovation: Three = _ZERO
    yaw_innovation: float = 0.0
    mag_innovation: Three = _ZERO
    earth_field: Three = _ZERO
    body_field: Three = _ZERO
    mag_fusion: int = 0
    vel_ratio: float = 0.0
    pos_ratio: float = 0.0
    height_ratio: float = 0.0
    mag_ratio: float = 0.0
    yaw_ratio: float = 0.0
    tilt_error_rad: float = 0.0
    moved_ne: tuple[float, float] = (0.0, 0.0)
    faults: int = UNINITIALISED_FAULT
    timeouts: int = 0
    flags: int = 0
    angle_error: float = 0.0
    vel_error: float = 0.0
    pos_error: float = 0.0
    variances: tuple[float, ...] = (0.0,) * 24
    odometry: OdometryReport | None = None
    terrain: TerrainReport = TerrainReport()
    stillness: StillnessReport | None = None
    source_set: int = 0
    baro: int = 0
    gps: int = 0
    gsf: GsfReport | None = None
    error_score: float = 0.0
    relative_error: float = 0.0


class AidingMode(Enum):
    """At a constant position, by absolute position, or by relative motion."""

    NONE = "none"
    ABSOLUTE = "absolute"
    RELATIVE = "relative"


class FilterFlag(IntFlag):
    """Bits of nav_filter_status, which are those of EKF_STATUS_REPORT as far as that has them."""

    ATTITUDE = 1 << 0
    HORIZ_VEL = 1 << 1
    VERT_VEL = 1 << 2
    HORIZ_POS_REL = 1 << 3
    HORIZ_POS_ABS = 1 << 4
    VERT_POS = 1 << 5
    TERRAIN_ALT = 1 << 6
    CONST_POS_MODE = 1 << 7
    PRED_HORIZ_POS_REL = 1 << 8
    PRED_HORIZ_POS_ABS = 1 << 9
    UNINITIALISED = 1 << 10
    GPS_GLITCHING = 1 << 15


class FilterStatus(NamedTuple):
    """Flags and the square roots of test ratios of the primary core; 1.0 is at the gate."""

    flags: FilterFlag
    velocity_variance: float = 0.0
    pos_horiz_variance: float = 0.0
    pos_vert_variance: float = 0.0
    compass_variance: float = 0.0
    terrain_alt_variance: float = 0.0
    airspeed_variance: float = 0.0


class ControlLimits(NamedTuple):
    """What an estimator asks of controllers, so that its sensors see well.

    Attributes:
        speed_m_s: horizontal speed.
        gain: by which corrections of the horizontal position and velocity are multiplied.
        up_m: height above the origin; None for any.
    """

    speed_m_s: float = 400.0
    gain: float = 1.0
    up_m: float | None = None


NO_LIMITS: Final = ControlLimits()

NO_ESTIMATOR: Final = FilterStatus(FilterFlag(0))
"""Of an estimator that is chosen and does not run; no report is sent of it."""


MAV_SEVERITY_CRITICAL: Final = 2
MAV_SEVERITY_WARNING: Final = 4
MAV_SEVERITY_INFO: Final = 6
NUMBER_OF_IMUS: Final = 2

_WORDS: Final = (
    (MAV_SEVERITY_INFO, "tilt alignment complete"),
    (MAV_SEVERITY_INFO, "origin set"),
    (MAV_SEVERITY_INFO, "initialised"),
    (MAV_SEVERITY_WARNING, "forced reset"),
    (MAV_SEVERITY_WARNING, "stopped aiding"),
    (MAV_SEVERITY_INFO, "started relative aiding"),
    (MAV_SEVERITY_INFO, "is using GPS"),
    (MAV_SEVERITY_INFO, "is using external nav data"),
    (MAV_SEVERITY_INFO, "initial pos NED = %.1f,%.1f,%.1f (m)"),
    (MAV_SEVERITY_INFO, "initial vel NED = %.1f,%.1f,%.1f (m/s)"),
    (MAV_SEVERITY_INFO, "fusing odometry"),
    (MAV_SEVERITY_INFO, "fusing optical flow"),
    (MAV_SEVERITY_INFO, "switching to compass %.0f"),
    (MAV_SEVERITY_INFO, "yaw aligned"),
    (MAV_SEVERITY_INFO, "yaw aligned to GPS velocity"),
    (MAV_SEVERITY_INFO, "yaw aligned using GPS"),
    (MAV_SEVERITY_WARNING, "emergency yaw reset"),
    (MAV_SEVERITY_INFO, "MAG%.0f initial yaw alignment complete"),
    (MAV_SEVERITY_INFO, "MAG%.0f in-flight yaw alignment complete"),
    (MAV_SEVERITY_WARNING, "MAG%.0f ground mag anomaly, yaw re-aligned"),
    (MAV_SEVERITY_CRITICAL, "EKF3 lane switch %.0f"),
    (MAV_SEVERITY_WARNING, "EKF3: origin already set"),
)
"""Severity and words of each text, by its number in `ekf_stub.core.events`."""


def words_of(code: int, values: Sequence[float]) -> tuple[int, str]:
    """Return the severity of a text of the filter and its words, without the ``EKF3 IMU0 `` that names a core."""
    severity, words = _WORDS[code]
    numbers = iter(values)
    return severity, re.sub(r"%\.(\d)f", lambda found: fixed(next(numbers), int(found[1])), words)


def cores_of_mask(imu_mask: int, imus: int = NUMBER_OF_IMUS) -> tuple[int, ...]:
    """Return the IMU of each core by EK3_IMU_MASK, of as many as there are."""
    return tuple(imu for imu in range(imus) if imu_mask >> imu & 1)
