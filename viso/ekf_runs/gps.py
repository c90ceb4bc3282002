# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the replay records of a log say of the GPS (AP_DAL/AP_DAL_GPS.cpp)."""

from typing import Any

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.gps_sample import FIX_3D, GpsSample
from ekf_stub.reports.core_report import Three
from viso.logs.record_fields import finite, instance, numbers, whole

_VERTICAL_VELOCITY, _HORIZONTAL, _VERTICAL, _LAG, _SPEED, _YAW = (1 << bit for bit in range(6))  # of RGPI.Flags


class GpsRecords:
    """The primary GPS as RGPH, RGPI and RGPJ leave it."""

    def __init__(self) -> None:
        self._count = self._primary = 0
        self._slow: dict[int, list[int]] = {}
        self._lags_s: dict[int, float] = {}
        self._antennas: dict[int, Three] = {}
        self._fast: dict[int, Any] = {}
        self._last_fix_ms: dict[int, int] = {}

    def take(self, record: Any) -> None:
        """Take how many there are and which is the primary one, what changes seldom, or a solution."""
        kind = record.get_type()
        if kind == "RGPH":
            self._count, self._primary = whole(record, "NumInst", "Primary")
        elif kind == "RGPI":
            self._slow[instance(record)] = whole(record, "Flags", "Stat", "NSats")
            self._lags_s[instance(record)], x, y, z = finite(record, "Lg", "OX", "OY", "OZ")
            self._antennas[instance(record)] = x, y, z
        else:
            self._fast[instance(record)] = record

    def lag_s(self) -> float | None:
        """Return how late the primary GPS is, s; None while it cannot be said."""
        flags, *_ = self._slow.get(self._primary, (0,))
        return self._lags_s[self._primary] if flags & _LAG else None

    def newest(self, receiver: int | None = None) -> GpsSample | None:
        """Return the newest solution of a receiver, the primary one if none is named, or None without one.

        Its antenna is where it is on the vehicle.
        """
        which = self._primary if receiver is None else receiver
        slow, fast = self._slow.get(which), self._fast.get(which)
        if not self._count or (receiver is not None and receiver >= self._count) or slow is None or fast is None:
            return None
        flags, fix_type, num_sats = slow
        time_ms, lat, lng, alt_cm, hdop = whole(fast, "TS", "Lat", "Lon", "Alt", "HD")
        speed, horizontal, vertical, yaw = numbers(fast, "SA", "HA", "VA", "Y")
        if fix_type >= FIX_3D:
            self._last_fix_ms[which] = time_ms
        return GpsSample(
            time_ms,
            fix_type,
            Location(lat, lng, alt_cm),
            Vector3f(*finite(fast, "VX", "VY", "VZ")),
            num_sats,
            hdop,
            has_vertical_velocity=bool(flags & _VERTICAL_VELOCITY),
            speed_accuracy=speed if flags & _SPEED else None,
            horizontal_accuracy=horizontal if flags & _HORIZONTAL else None,
            vertical_accuracy=vertical if flags & _VERTICAL else None,
            yaw_deg=yaw if flags & _YAW else None,
            last_fix_ms=self._last_fix_ms.get(which, 0),
            lag_s=self._lags_s[which],
            antenna=self._antennas[which],
        )
