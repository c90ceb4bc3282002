# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of one JSON object a line, of a file, a pipe, or messages that hold them as text.

An object may hold several of these; they come out in this order:

- ``K`` (or ``k``; 9 numbers, row by row), ``width``, ``height``: a camera's intrinsics;
- ``landmarks``: a list of ``{"id", "x", "y"}`` and perhaps ``"z"``, in m east, north and up;
- ``fix``: ``{"lat", "lon", "alt_m"}``, where the vehicle is on the globe;
- ``kf_lat``/``kf_lon``, else ``lat``/``lon``, else ``raw_lat``/``raw_lon``: where the receiver is thought to be;
- ``pose``: ``{"x", "y", "yaw"}`` and perhaps ``"z"``, ENU in m and rad, or ``{"position", "orientation"}`` of
  ``{"x", "y", "z"}`` and ``{"x", "y", "z", "w"}``, FLU to ENU;
- ``vehicle`` (or ``trike``) with a ``pose`` like that, and ``header`` with ``origin_lla``, a fix;
- ``aircraft``: a list of rows with ``icao`` and ``raw``; with ``icao``, ``latitude``, ``longitude``, ``altitude``,
  ``speed``, ``heading``, ``vertical_rate``; or a snapshot of dump1090, with ``now`` and ``hex``;
- ``observations``: a list of ``{"id", "u", "v"}``, and ``aircraft_observations``: of ``{"icao", "u", "v"}``, in px.

The time is ``t_s`` in s, else ``stamp`` or ``stamp`` of ``header``: a number in s, or ``{"sec", "nanosec"}``, where all
0 is none. Without any of these it is the time of arrival, else that of the object before, and 0 at the start.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

from viso.landmarks.inputs.base import (
    LARGEST_M,
    LARGEST_S,
    NO_POSITION,
    LineReader,
    Refused,
    counted,
    icao_of,
    not_null_island,
    number,
    optional_number,
    pose_from_enu,
    rotation_of_quat,
)
from viso.landmarks.inputs.dump1090 import Dump1090Reader, json_record
from viso.landmarks.types import (
    AircraftReport,
    CameraInfo,
    Detection,
    Detections,
    EstimatedPosition,
    Event,
    GeodeticPoint,
    GlobalFix,
    Landmark,
    LandmarkMap,
    VehiclePose,
)

ESTIMATE_KEYS: Final = (("kf_lat", "kf_lon"), ("lat", "lon"), ("raw_lat", "raw_lon"))
TWICE: Final = "a landmark whose id is there already"
_RAW_KEYS: Final = ("latitude", "longitude", "altitude_ft", "speed_kts", "heading_deg", "vertical_rate_ftmin")
_ROW_KEYS: Final = ("latitude", "longitude", "altitude", "speed", "heading", "vertical_rate")

Record = Mapping[str, Any]


class JsonReader(LineReader):
    """Reads the records that the module describes; a bad element of a list is left out, the others are not."""

    def __init__(self) -> None:
        super().__init__()
        self._snapshots = Dump1090Reader(self.refused)
        self._last_s = 0.0
        self._kinds: tuple[tuple[frozenset[str], Callable[[float, Record], list[Event]]], ...] = (
            (frozenset({"K", "k"}), self._camera_info),
            (frozenset({"landmarks"}), self._landmarks),
            (frozenset({"fix"}), lambda t_s, record: [_fix(t_s, record["fix"])]),
            (frozenset(key for pair in ESTIMATE_KEYS for key in pair), self._estimate),
            (frozenset({"pose"}), lambda t_s, record: [_pose(t_s, record["pose"])]),
            (frozenset({"vehicle", "trike"}), self._vehicle),
            (frozenset({"aircraft"}), self._aircraft),
            (frozenset({"observations", "aircraft_observations"}), self._detections),
        )

    def _events(self, line: str, arrival_s: float | None) -> list[Event]:
        record = json_record(line)
        if not isinstance(record, dict):
            raise Refused("no object")
        kinds = [events_of for keys, events_of in self._kinds if keys & record.keys()]
        if not kinds:
            raise Refused("no known record")
        self._last_s = t_s = self._time_s(record, arrival_s)
        events: list[Event] = []
        for events_of in kinds:
            with counted(self.refused):
                events += events_of(t_s, record)
        return events

    def _time_s(self, record: Record, arrival_s: float | None) -> float:
        if "t_s" in record:
            return number(record, "t_s", LARGEST_S)
        header = record.get("header")
        stamp = record.get("stamp", header.get("stamp") if isinstance(header, dict) else None)
        stamp_s = None
        if isinstance(stamp, dict):
            stamp_s = number(stamp, "sec", LARGEST_S) + number(stamp, "nanosec", LARGEST_S) * 1e-9
        elif stamp is not None:
            stamp_s = number(record if "stamp" in record else header, "stamp", LARGEST_S)  # type: ignore[arg-type]
        return stamp_s or (self._last_s if arrival_s is None else arrival_s)

    def _camera_info(self, t_s: float, record: Record) -> list[Event]:
        matrix = record.get("K", record.get("k"))
        if not isinstance(matrix, list) or len(matrix) != 9:
            raise Refused("K is no list of 9 numbers")
        fx_px, cx_px, fy_px, cy_px = (number({"K": matrix[index]}, "K") for index in (0, 2, 4, 5))
        width_px, height_px = (int(number(record, key)) for key in ("width", "height"))
        return [CameraInfo(t_s, width_px, height_px, fx_px, fy_px, cx_px, cy_px)]

    def _landmarks(self, t_s: float, record: Record) -> list[Event]:
        landmarks: dict[str, Landmark] = {}
        for row in _rows(record, "landmarks"):
            with counted(self.refused):
                name = _id_of(_object(row, "landmarks").get("id"))
                z_m = number(row, "z", LARGEST_M) if row.get("z") is not None else 0.0
                landmark = Landmark(name, number(row, "x", LARGEST_M), number(row, "y", LARGEST_M), z_m)
                if landmarks.setdefault(name, landmark) is not landmark:
                    raise Refused(TWICE)
        return [LandmarkMap(t_s, tuple(landmarks.values()))]

    def _estimate(self, t_s: float, record: Record) -> list[Event]:
        for latitude, longitude in ESTIMATE_KEYS:
            if record.get(latitude) is not None and record.get(longitude) is not None:
                with counted(self.refused):
                    return [EstimatedPosition(t_s, _point(record, latitude, longitude))]
        raise Refused("an estimate without a position")

    def _vehicle(self, t_s: float, record: Record) -> list[Event]:
        events: list[Event] = []
        header = record.get("header")
        origin = header.get("origin_lla") if isinstance(header, dict) else None
        if origin is not None:
            with counted(self.refused):
                events.append(_fix(t_s, origin))
        vehicle = record.get("vehicle", record.get("trike"))
        return [*events, _pose(t_s, _object(vehicle, "vehicle").get("pose"))]

    def _aircraft(self, t_s: float, record: Record) -> list[Event]:
        rows = _rows(record, "aircraft")
        if any(isinstance(row, dict) and "hex" in row for row in rows):
            return self._snapshots.take_snapshot(record, t_s)
        events: list[Event] = []
        for row in rows:
            with counted(self.refused):
                events.append(self._report(t_s, _object(row, "aircraft")))
        return events

    def _report(self, t_s: float, row: Record) -> AircraftReport:
        icao = icao_of(row.get("icao"))
        report, keys = (_object(row["raw"], "raw"), _RAW_KEYS) if "raw" in row else (row, _ROW_KEYS)
        latitude, longitude, altitude, *motion = keys
        if report.get(latitude) is None or report.get(longitude) is None:
            raise Refused(NO_POSITION)
        latitude_deg, longitude_deg = number(report, latitude), number(report, longitude)
        not_null_island(latitude_deg, longitude_deg)
        altitude_ft = optional_number(report, altitude, self.refused)
        speed_kt, heading_deg, rate_ft_min = (optional_number(report, key, self.refused) or 0.0 for key in motion)
        return AircraftReport(t_s, icao, latitude_deg, longitude_deg, altitude_ft, speed_kt, heading_deg, rate_ft_min)

    def _detections(self, t_s: float, record: Record) -> list[Event]:
        landmarks = self._seen(record, "observations", lambda row: _id_of(row.get("id")))
        aircraft = self._seen(record, "aircraft_observations", lambda row: icao_of(row.get("icao")))
        return [Detections(t_s, landmarks, aircraft)]

    def _seen(self, record: Record, key: str, name_of: Callable[[Record], str]) -> tuple[Detection, ...]:
        found: list[Detection] = []
        for row in _rows(record, key) if key in record else []:
            with counted(self.refused):
                name = name_of(_object(row, key))
                found.append(Detection(name, number(row, "u", LARGEST_M), number(row, "v", LARGEST_M)))
        return tuple(found)


def _object(value: Any, key: str) -> Record:
    if not isinstance(value, dict):
        raise Refused(f"{key}: no object")
    return value


def _rows(record: Record, key: str) -> list[Any]:
    rows = record.get(key)
    if not isinstance(rows, list):
        raise Refused(f"{key} is no list")
    return rows


def _id_of(value: object) -> str:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int | str) or value == "":
        raise Refused("an id that is neither text nor a whole number")
    return str(value)


def _point(record: Record, latitude: str, longitude: str, alt_m: float = 0.0) -> GeodeticPoint:
    point = GeodeticPoint(number(record, latitude), number(record, longitude), alt_m)
    not_null_island(point.latitude_deg, point.longitude_deg)
    return point


def _fix(t_s: float, value: Any) -> GlobalFix:
    place = _object(value, "fix")
    return GlobalFix(t_s, _point(place, "lat", "lon", number(place, "alt_m", LARGEST_M)))


def _pose(t_s: float, value: Any) -> VehiclePose:
    pose = _object(value, "pose")
    if "yaw" in pose:
        z_m = number(pose, "z", LARGEST_M) if pose.get("z") is not None else None
        return VehiclePose(
            t_s, number(pose, "x", LARGEST_M), number(pose, "y", LARGEST_M), number(pose, "yaw", LARGEST_M), z_m
        )
    position, quat = (_object(pose.get(key), key) for key in ("position", "orientation"))
    attitude = rotation_of_quat((number(quat, "w"), number(quat, "x"), number(quat, "y"), number(quat, "z")))
    return pose_from_enu(t_s, (number(position, "x"), number(position, "y"), number(position, "z")), attitude)
