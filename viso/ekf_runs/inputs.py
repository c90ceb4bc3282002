# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the replay records of a log say of the sensors, frame after frame (AP_DAL/LogStructure.h).

A value stands until another record of its kind comes: most records are written only when they differ.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from ap_core.cint import i32
from ekf_stub.filter.inertial import Array, InertialDelta
from ekf_stub.inputs.gps_sample import GpsSample
from viso.ekf_runs.gps import GpsRecords
from viso.logs.record_fields import RecordError, finite, instance, whole

ARMED: Final = 1 << 0  # of RFRN.Flags
TAKEOFF_EXPECTED: Final = 1 << 6
TOUCHDOWN_EXPECTED: Final = 1 << 7


class ReplayInputs:
    """The sensors as the records taken so far leave them.

    Attributes:
        imu: which IMU counts.
        time_us: of the frame, since boot.
        flying_ms: for how long the vehicle has been flying.
        flags: of the frame: ``ARMED``, ``TAKEOFF_EXPECTED``, ``TOUCHDOWN_EXPECTED`` and others.
        home_lat: latitude of home, 1e-7 deg.
        delta: inertial data; None before the first.
        baro: time of the reading in ms, and height in m.
        mag: time of the reading in us, and the field in mGauss, body.
        declination: of the magnetic field, rad.
        camera_frd: where the camera is on the vehicle, m; None while there is none.
        camera_delay_ms: how late it is.
        gps: the newest solution of the primary GPS; None while there is none.
        gps_lag_s: how late that GPS is; None while it cannot be said.
    """

    def __init__(self) -> None:
        self.imu = 0
        self.time_us = self.flying_ms = self.flags = self.home_lat = 0
        self.delta: InertialDelta | None = None
        self.baro: tuple[int, float] | None = None
        self.mag: tuple[int, Array] | None = None
        self.declination = 0.0
        self.camera_frd: tuple[float, float, float] | None = None
        self.camera_delay_ms = 0
        self.gps: GpsSample | None = None
        self.gps_lag_s: float | None = None
        self._primary_baro = self._usable_mag = 0
        self._gps_records = GpsRecords()
        self._handlers: dict[str, Callable[[Any], None]] = {
            "RFRH": self._take_rfrh,
            "RFRN": self._take_rfrn,
            "RISI": self._take_risi,
            "RBRH": self._take_rbrh,
            "RBRI": self._take_rbri,
            "RMGH": self._take_rmgh,
            "RMGI": self._take_rmgi,
            "RVOH": self._take_rvoh,
            **dict.fromkeys(("RGPH", "RGPI", "RGPJ"), self._take_gps),
        }

    def take(self, record: Any) -> None:
        """Take the next record of the log, whatever it is. Raises RecordError if it cannot be used."""
        handler = self._handlers.get(record.get_type())
        if handler is not None:
            handler(record)

    def _take_rfrh(self, record: Any) -> None:
        time_us, self.flying_ms = whole(record, "TimeUS", "TF")
        if time_us < self.time_us:
            raise RecordError(f"RFRH.TimeUS runs backwards, from {self.time_us} to {time_us}")
        self.time_us = time_us

    def _take_rfrn(self, record: Any) -> None:
        home_lat, self.flags = whole(record, "HLat", "Flags")
        self.home_lat = i32(home_lat)

    def _take_risi(self, record: Any) -> None:
        if instance(record) == self.imu:
            values = finite(record, "DVX", "DVY", "DVZ", "DAX", "DAY", "DAZ", "DVDT", "DADT")
            self.delta = InertialDelta(np.array(values[:3]), np.array(values[3:6]), values[6], values[7])

    def _take_rbrh(self, record: Any) -> None:
        (self._primary_baro,) = whole(record, "Primary")

    def _take_rbri(self, record: Any) -> None:
        if instance(record) == self._primary_baro:
            time_ms, height = finite(record, "LastUpdate", "Alt")
            self.baro = int(time_ms), height

    def _take_rmgh(self, record: Any) -> None:
        (self.declination,) = finite(record, "Dec")
        (self._usable_mag,) = whole(record, "FUsable")

    def _take_rmgi(self, record: Any) -> None:
        if instance(record) == self._usable_mag:
            time_us, *field = finite(record, "LU", "FX", "FY", "FZ")
            self.mag = int(time_us), np.array(field)

    def _take_rvoh(self, record: Any) -> None:
        x, y, z, enabled = finite(record, "OX", "OY", "OZ", "Ena")
        self.camera_frd = (x, y, z) if enabled else None
        (self.camera_delay_ms,) = whole(record, "Del")

    def _take_gps(self, record: Any) -> None:
        self._gps_records.take(record)
        self.gps, self.gps_lag_s = self._gps_records.newest(), self._gps_records.lag_s()
