# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The data of all sensors but IMUs in the replay records of a log (AP_DAL/LogStructure.h).

A value holds until the next record of its kind: most records are written only when they differ.
"""

from collections.abc import Callable
from typing import Any, Final, Generic, NamedTuple, TypeVar

from ap_core.cint import i32
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.core.core import AFFINITY_BARO, AFFINITY_GPS, AFFINITY_MAG
from ekf_stub.core.imus import MAX_IMUS
from ekf_stub.core.inertial import LOOP_DT
from ekf_stub.core.inputs import Compasses, CompassReading
from ekf_stub.inputs.measurements import FIX_3D, FinderState, FlowMeasurement, GpsSample, RangeState, RangeStatus
from ekf_stub.reports import Three
from viso.logs.recorded import finite, instance, numbers, whole

_VERTICAL_VELOCITY, _HORIZONTAL, _VERTICAL, _LAG, _SPEED, _YAW = (1 << bit for bit in range(6))  # of RGPI.Flags

T = TypeVar("T")


class Reading(NamedTuple, Generic[T]):
    """The value of one of several sensors, and whether it can be used."""

    value: T
    is_healthy: bool


_NO_RANGE: Final = FinderState((0.0, 0.0, 0.0), 0.0, 0, RangeStatus.NOT_CONNECTED)


def flow_of(record: Any) -> FlowMeasurement:
    """Return the measurement of a flow sensor in ROFH; its offset is its position on the vehicle."""
    flow_x, flow_y, gyro_x, gyro_y, x, y, z = numbers(record, "FX", "FY", "GX", "GY", "PX", "PY", "PZ")
    (quality,) = whole(record, "Qual")
    return FlowMeasurement(quality, (flow_x, flow_y), (gyro_x, gyro_y), (x, y, z))


def _metres_of(record: Any, label: str) -> float:
    """Return a range in m; up to 4.6 a log has them in whole centimetres, which the filter made metres of."""
    (value,) = finite(record, label)
    return float(f32(value) * f32(0.01)) if isinstance(getattr(record, label), int) else value


class GpsRecords:
    """The GPS receivers by RGPH, RGPI and RGPJ."""

    def __init__(self) -> None:
        self._count = self._primary = 0
        self._slow: dict[int, list[int]] = {}
        self._lags_s: dict[int, float] = {}
        self._antennas: dict[int, Three] = {}
        self._fast: dict[int, Any] = {}
        self._last_fix_ms: dict[int, int] = {}

    def take(self, record: Any) -> None:
        """Read a record: RGPH has the number of receivers, RGPI the slowly changing values, RGPJ a solution."""
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
        """Return the lag of the primary GPS, s; None while it is unknown."""
        flags, *_ = self._slow.get(self._primary, (0,))
        return self._lags_s[self._primary] if flags & _LAG else None

    def newest(self, receiver: int | None = None) -> GpsSample | None:
        """Return the newest solution of a receiver, the primary one if none is named, or None without one.

        Its antenna offset is the position on the vehicle.
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


class ReplayInputs:
    """The sensors by the records taken so far.

    Attributes:
        flags: of the frame, as ``replay_log`` names some.
        home_lat: latitude of home, 1e-7 deg.
        imu_count: how many IMUs there are.
        first_gyro, first_accel: the first ones that may be used.
        loop_dt: of the main loop, s.
        baros: time of the reading in ms, and height in m, by barometer.
        primary_baro: the one in use.
        compasses: the readings of the compasses; the same object until one changes.
        declination: of the magnetic field, rad.
        camera_frd: the place of the camera on the vehicle, m; None while there is none.
        camera_delay_ms: its delay.
        ranges: the state of the range finders, with their places on the vehicle; None before the first record.
        gps: the newest solution of the primary GPS; None while there is none.
        gps_lag_s: the lag of that GPS; None while it is unknown.
    """

    def __init__(self) -> None:
        self.flags = self.home_lat = 0
        self.imu_count = MAX_IMUS
        self.first_gyro = self.first_accel = 0
        self.loop_dt = LOOP_DT
        self.primary_baro = 0
        self.baros: dict[int, Reading[tuple[int, float]]] = {}
        self.compasses = Compasses([])
        self._compasses: dict[int, CompassReading] = {}
        self._compass_count = 0
        self.declination = 0.0
        self.camera_frd: tuple[float, float, float] | None = None
        self.camera_delay_ms = 0
        self.ranges: RangeState | None = None
        self.gps: GpsSample | None = None
        self.gps_lag_s: float | None = None
        self._gps_records = GpsRecords()
        self._solutions: dict[int, GpsSample | None] = {}
        self._handlers: dict[str, Callable[[Any], None]] = {
            "RFRN": self._take_rfrn,
            "RISH": self._take_rish,
            "RBRH": self._take_rbrh,
            "RBRI": self._take_rbri,
            "RMGH": self._take_rmgh,
            "RMGI": self._take_rmgi,
            "RVOH": self._take_rvoh,
            "RRNH": self._take_rrnh,
            "RRNI": self._take_rrni,
            **dict.fromkeys(("RGPH", "RGPI", "RGPJ"), self._take_gps),
        }

    def take(self, record: Any) -> bool:
        """Read a record; return whether it is one of a sensor. Raises RecordError if it cannot be used."""
        handler = self._handlers.get(record.get_type())
        if handler is not None:
            handler(record)
        return handler is not None

    def _take_rfrn(self, record: Any) -> None:
        home_lat, self.flags = whole(record, "HLat", "Flags")
        self.home_lat = i32(home_lat)

    def _take_rish(self, record: Any) -> None:
        self.first_gyro, self.first_accel, count = whole(record, "PG", "PA", "AC")
        self.imu_count = min(count, MAX_IMUS)
        (self.loop_dt,) = finite(record, "LD")

    def _take_rbrh(self, record: Any) -> None:
        (self.primary_baro,) = whole(record, "Primary")

    def _take_rbri(self, record: Any) -> None:
        time_ms, height, is_healthy = finite(record, "LastUpdate", "Alt", "H")
        self.baros[instance(record)] = Reading((int(time_ms), height), bool(is_healthy))

    def _take_rmgh(self, record: Any) -> None:
        (self.declination,) = finite(record, "Dec")
        first, self._compass_count = whole(record, "FUsable", "NumInst")
        are_consistent, are_available, finds_declination = map(bool, whole(record, "C", "Avail", "AutoDec"))
        self.compasses = Compasses(
            self._compass_readings(), first, -1, are_consistent, are_available, finds_declination
        )

    def _take_rmgi(self, record: Any) -> None:
        time_us, field_x, field_y, field_z, x, y, z = finite(record, "LU", "FX", "FY", "FZ", "OX", "OY", "OZ")
        is_used, is_healthy, has_scale = map(bool, whole(record, "UFY", "H", "HSF"))
        self._compasses[instance(record)] = CompassReading(
            int(time_us), (field_x, field_y, field_z), (x, y, z), is_healthy, is_used, has_scale
        )
        now = self.compasses
        self.compasses = Compasses(
            self._compass_readings(),
            now.first_usable,
            -1,
            now.are_consistent,
            now.are_available,
            now.finds_declination,
        )

    def _compass_readings(self) -> list[CompassReading]:
        known = self._compasses
        return [known[i] for i in range(min(self._compass_count, len(known))) if i in known]

    def _take_rvoh(self, record: Any) -> None:
        x, y, z, enabled = finite(record, "OX", "OY", "OZ", "Ena")
        self.camera_frd = (x, y, z) if enabled else None
        (self.camera_delay_ms,) = whole(record, "Del")

    def _take_rrnh(self, record: Any) -> None:
        clearance, max_distance = _metres_of(record, "GCl"), _metres_of(record, "MaxD")
        (count,) = whole(record, "NumSensors")
        before = () if self.ranges is None else self.ranges.finders
        self.ranges = RangeState((before + (_NO_RANGE,) * count)[:count], clearance, max_distance)

    def _take_rrni(self, record: Any) -> None:
        x, y, z = finite(record, "PX", "PY", "PZ")
        distance = _metres_of(record, "Dist")
        orientation, status = whole(record, "Orient", "Status")
        index = instance(record)
        if self.ranges is not None and index < len(self.ranges.finders):
            finders = list(self.ranges.finders)
            finders[index] = FinderState((x, y, z), distance, orientation, status)
            self.ranges = self.ranges._replace(finders=tuple(finders))

    def _take_gps(self, record: Any) -> None:
        self._gps_records.take(record)
        self.gps, self.gps_lag_s = self._gps_records.newest(), self._gps_records.lag_s()
        self._solutions.clear()

    def gps_of(self, receiver: int) -> GpsSample | None:
        """Return the newest solution of a receiver, or None without one."""
        if receiver not in self._solutions:
            self._solutions[receiver] = self._gps_records.newest(receiver)
        return self._solutions[receiver]


class CoreInputs:
    """The sensors of a core: with affinity (EK3_AFFINITY) those of its number (update_sensor_selection)."""

    def __init__(self, inputs: ReplayInputs, number: int) -> None:
        self._inputs = inputs
        self._number = number
        self._compasses: Compasses | None = None
        self._own_compasses: Compasses | None = None

    def baro(self, affinity: int) -> tuple[int, float] | None:
        """Return the barometer's reading (update_baro_selection)."""
        baros = self._inputs.baros
        own = affinity & AFFINITY_BARO and baros.get(self._number)
        if own and own.is_healthy:
            return own.value
        primary = baros.get(self._inputs.primary_baro)
        return None if primary is None else primary.value

    def compasses(self, affinity: int) -> Compasses:
        """Return the readings of the compasses and the core's own one: the same object until one changes."""
        given = self._inputs.compasses
        if not affinity & AFFINITY_MAG:
            return given
        if self._own_compasses is None or self._compasses is not given:
            self._compasses, self._own_compasses = given, given.of_core(self._number)
        return self._own_compasses

    def gps(self, affinity: int) -> GpsSample | None:
        """Return the newest solution of a receiver (update_gps_selection)."""
        if affinity & AFFINITY_GPS:
            own = self._inputs.gps_of(self._number)
            if own is not None and own.fix_type >= FIX_3D:
                return own
        return self._inputs.gps
