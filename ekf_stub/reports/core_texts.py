# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter tells the ground station, in the firmware's words."""

from collections.abc import Sequence
from typing import Final

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
    (MAV_SEVERITY_INFO, "initial pos NED = {:3.1f},{:3.1f},{:3.1f} (m)"),
    (MAV_SEVERITY_INFO, "initial vel NED = {:3.1f},{:3.1f},{:3.1f} (m/s)"),
    (MAV_SEVERITY_INFO, "fusing odometry"),
    (MAV_SEVERITY_INFO, "fusing optical flow"),
    (MAV_SEVERITY_INFO, "switching to compass {:.0f}"),
    (MAV_SEVERITY_INFO, "yaw aligned"),
    (MAV_SEVERITY_INFO, "yaw aligned to GPS velocity"),
    (MAV_SEVERITY_INFO, "yaw aligned using GPS"),
    (MAV_SEVERITY_WARNING, "emergency yaw reset"),
    (MAV_SEVERITY_INFO, "MAG{:.0f} initial yaw alignment complete"),
    (MAV_SEVERITY_INFO, "MAG{:.0f} in-flight yaw alignment complete"),
    (MAV_SEVERITY_WARNING, "MAG{:.0f} ground mag anomaly, yaw re-aligned"),
    (MAV_SEVERITY_CRITICAL, "EKF3 lane switch {:.0f}"),
    (MAV_SEVERITY_WARNING, "EKF3: origin already set"),
)
"""Severity and words of each text, by its number in `ekf_stub.core.events`."""


def words_of(code: int, values: Sequence[float]) -> tuple[int, str]:
    """Return the severity of a text of the filter and its words, without the ``EKF3 IMU0 `` that names a core."""
    severity, words = _WORDS[code]
    return severity, words.format(*values)


def cores_of_mask(imu_mask: int, imus: int = NUMBER_OF_IMUS) -> tuple[int, ...]:
    """Return the IMU of each core by EK3_IMU_MASK, of as many as there are."""
    return tuple(imu for imu in range(imus) if imu_mask >> imu & 1)
