# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's pose and fix, and aircraft, from a DataFlash log (.BIN).

Poses are the XKF1 records of the primary core (PI of XKF4), and only while that core reports a valid position (SS of
XKF4): one record has position and attitude of the same instant, and the position is in m
from the EKF's origin, as LOCAL_POSITION_NED's is. ATT has no position; POS has one on the globe, rounded to 1 cm, and
may be that of the GPS or of DCM. Fixes are POS, the content of GLOBAL_POSITION_INT. ADSB records are aircraft; the log
does not have the reference of their altitude, so it counts as pressure altitude.
"""

import math
import statistics
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from mav_handlers.wire.messages import ADSB_VEHICLE
from viso.landmarks.adsb_vehicle import AdsbFlags, AltitudeType, from_message
from viso.landmarks.inputs.base import InputFileError, Refused, counted, ned_R_frd, not_null_island, pose_from_ned
from viso.landmarks.types import Event, GeodeticPoint, GlobalFix
from viso.logs.recorded import read_columns, records_in

GPS_EPOCH_S: Final = 315_964_800
WEEK_S: Final = 604_800
LEAP_S: Final = 18
"""GPS time less UTC, since 2017."""
FIX_3D: Final = 3
_HORIZONTAL_POSITION: Final = 1 << 3 | 1 << 4  # relative or absolute
_VERTICAL_POSITION: Final = 1 << 5
_AIRCRAFT_FLAGS: Final = AdsbFlags.COORDS | AdsbFlags.ALTITUDE | AdsbFlags.HEADING | AdsbFlags.VELOCITY
_KINDS: Final = ("XKF4", "XKF1", "POS", "GPS", "ADSB")


class DataFlashFile:
    """A log; its events are held in memory, their times are seconds since the autopilot's boot.

    Attributes:
        utc_minus_boot_s: offset from these times to UTC, from the GPS; None before the events, or without a fix.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.refused: Counter[str] = Counter()
        self.utc_minus_boot_s: float | None = None
        self._core = 0
        self._has_position: dict[int, bool] = {}
        self._offsets_s: list[float] = []

    def events(self) -> Iterator[Event]:
        """Yield the log's events.

        Raises InputFileError if it holds no poses of an EKF3, and InputError if it cannot be read.
        """
        events: list[Event] = []
        for record in records_in(read_columns(self._path), _KINDS):
            with counted(self.refused):
                events += self._of_record(record)
        if self._offsets_s:
            self.utc_minus_boot_s = statistics.median(self._offsets_s)
        if not self._has_position:
            raise InputFileError(f"{self._path}: holds no XKF1 and XKF4 records to take poses from")
        yield from events

    def _of_record(self, record: Any) -> list[Event]:
        kind, t_s = record.get_type(), record.TimeUS * 1e-6
        if kind == "XKF4":
            self._core = getattr(record, "PI", self._core)
            self._has_position[record.C] = bool(record.SS & _HORIZONTAL_POSITION and record.SS & _VERTICAL_POSITION)
        elif kind == "XKF1" and self._core == record.C:
            if not self._has_position.get(record.C, False):
                raise Refused("a pose before the position is known")
            attitude = ned_R_frd(*(math.radians(angle) for angle in (record.Roll, record.Pitch, record.Yaw)))
            return [pose_from_ned(t_s, (record.PN, record.PE, record.PD), attitude)]
        elif kind == "POS":
            not_null_island(record.Lat, record.Lng)
            return [GlobalFix(t_s, GeodeticPoint(record.Lat, record.Lng, record.Alt))]
        elif kind == "GPS" and record.Status >= FIX_3D and record.GWk > 0:
            self._offsets_s.append(GPS_EPOCH_S + record.GWk * WEEK_S + record.GMS * 1e-3 - LEAP_S - t_s)
        elif kind == "ADSB":
            return [from_message(_adsb_vehicle(record), t_s)]
        return []


def _adsb_vehicle(record: Any) -> ADSB_VEHICLE:
    return ADSB_VEHICLE(
        record.ICAO_address,
        record.Lat,
        record.Lng,
        AltitudeType.PRESSURE_QNH,
        record.Alt,
        record.Heading,
        record.Hor_vel,
        record.Ver_vel,
        callsign="",
        emitter_type=0,
        tslc=0,
        flags=int(_AIRCRAFT_FLAGS),
        squawk=0,
    )
