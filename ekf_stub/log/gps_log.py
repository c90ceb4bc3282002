# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the replay records of a GPS hold, with one and without (AP_DAL/AP_DAL_GPS.cpp, AP_GPS/AP_GPS.cpp)."""

from typing import Final

from ap_core.log_field import LogValue
from ekf_stub.inputs.gps_sample import GpsSample

Values = tuple[LogValue, ...]

YAW_ACCURACY_DEG: Final = 10.0

_UNKNOWN_DOP: Final = 65535
_VERTICAL_VELOCITY, _HORIZONTAL, _VERTICAL, _LAG, _SPEED, _YAW = (1 << bit for bit in range(6))  # of RGPI.Flags
_NOWHERE: Final = (0.0, 0.0, 0.0)


def _absent(instance: int, flags: int, hdop: int, lag_s: float = 0.0) -> tuple[Values, Values]:
    slow = (*_NOWHERE, lag_s, flags, 0, 0, instance)
    return slow, (0, *_NOWHERE, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0.0, 0.0, hdop, instance)


UNUSED: Final = (_absent(1, _LAG, _UNKNOWN_DOP), _absent(2, 0, 0))
"""RGPI and RGPJ of the second receiver, and of what the firmware would blend of the two."""


def gps_values(gps: GpsSample | None, lag_s: float = 0.0) -> tuple[Values, tuple[Values, Values]]:
    """Return RGPH, and RGPI with RGPJ of the first receiver; ``lag_s`` is of one that is not there."""
    if gps is None:
        return (0, 0), _absent(0, _LAG, _UNKNOWN_DOP, lag_s)
    known = (
        (_VERTICAL_VELOCITY, gps.has_vertical_velocity),
        (_HORIZONTAL, gps.horizontal_accuracy is not None),
        (_VERTICAL, gps.vertical_accuracy is not None),
        (_LAG, True),
        (_SPEED, gps.speed_accuracy is not None),
        (_YAW, gps.yaw_deg is not None),
    )
    flags = sum(bit for bit, is_known in known if is_known)
    yaw = (0.0, 0.0, 0) if gps.yaw_deg is None else (gps.yaw_deg, YAW_ACCURACY_DEG, gps.time_ms)
    place = gps.location.lat, gps.location.lng, gps.location.alt_cm
    accuracies = gps.horizontal_accuracy or 0.0, gps.vertical_accuracy or 0.0
    motion = *gps.vel_ned.to_tuple(), gps.speed_accuracy or 0.0
    slow = (*_NOWHERE, gps.lag_s, flags, gps.fix_type, gps.num_sats, 0)
    return (1, 0), (slow, (gps.time_ms, *motion, *yaw, *place, *accuracies, gps.hdop, 0))
