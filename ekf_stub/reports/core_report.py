# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a filter core says of itself at a moment: the source of its log records and of telemetry."""

from dataclasses import dataclass

Three = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class OdometryReport:
    """The body odometry that was tested last (XKFD): m/s and (m/s)^2, body (FRD).

    ``recalled`` counts the samples that have come due, so that whoever logs can tell a new one.
    """

    recalled: int
    innovation: Three
    variance: Three


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
class RunReport:
    """What a core says of itself as it runs: the attributes of `CoreReport` that have the same names."""

    tilt_error_rad: float
    stillness: StillnessReport | None


@dataclass(slots=True)
class CoreReport:
    """What a core knows, at the present time unless said otherwise.

    Attributes:
        rpy_rad: roll, pitch and yaw of the outputs, without the vehicle's trim.
        quat_wxyz: attitude of the outputs, body (FRD) to earth (NED).
        vel_ned, pos_ned: m/s and m, of the outputs; the position from the origin as it was set.
        height_rate: d(down)/dt of the outputs, m/s.
        gyro_bias, accel_bias: rad/s and m/s/s, body.
        origin_height_m: of the origin above mean sea level; 0 without one.
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
        gps_bits: bits of XKF4.GPS.
        angle_error, vel_error, pos_error: of the outputs as they follow the filter: rad, m/s, m.
        variances: the diagonal of the covariance as the firmware's 24 states have it (XKV1, XKV2).
        odometry: None while there was none.
        stillness: None while the test does not run.
        source_set: the active one, 0..2.
    """

    rpy_rad: Three
    quat_wxyz: tuple[float, float, float, float]
    vel_ned: Three
    pos_ned: Three
    height_rate: float
    gyro_bias: Three
    accel_bias: Three
    origin_height_m: float
    vel_innovation: Three
    pos_innovation: Three
    yaw_innovation: float
    mag_innovation: Three
    earth_field: Three
    body_field: Three
    mag_fusion: int
    vel_ratio: float
    pos_ratio: float
    height_ratio: float
    mag_ratio: float
    yaw_ratio: float
    tilt_error_rad: float
    moved_ne: tuple[float, float]
    faults: int
    timeouts: int
    flags: int
    gps_bits: int
    angle_error: float
    vel_error: float
    pos_error: float
    variances: tuple[float, ...]
    odometry: OdometryReport | None
    stillness: StillnessReport | None
    source_set: int
