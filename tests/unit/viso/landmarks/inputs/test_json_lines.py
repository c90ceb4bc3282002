# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of one JSON object a line: each kind, several at once, times, and everything that may be wrong with them."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.landmarks.inputs.json_lines import JsonReader
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

S = math.sqrt(0.5)
HEADER = {
    "frame_id": "local_enu",
    "stamp": {"sec": 100, "nanosec": 250_000_000},
    "origin_lla": {"lat": 47.4, "lon": 8.5, "alt_m": 432.5},
}
POSE = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"x": 0.0, "y": 0.0, "z": S, "w": S}}
RAW = {
    "speed_kts": 251.5,
    "heading_deg": 87.3,
    "vertical_rate_ftmin": -640.0,
    "altitude_ft": 5000.0,
    "latitude": 47.464127,
    "longitude": 8.549031,
}


def take(*records: Any, arrival_s: float | None = None) -> list[Event]:
    reader = JsonReader()
    events = [event for record in records for event in reader.take(json.dumps(record), arrival_s)]
    assert not reader.refused
    return events


def refusals(record: Any) -> tuple[list[Event], dict[str, int]]:
    reader = JsonReader()
    return reader.take(record if isinstance(record, str) else json.dumps(record)), dict(reader.refused)


def test_landmarks_are_a_map() -> None:
    record = {"t_s": 5, "landmarks": [{"id": 0, "x": 1.0, "y": 2}, {"id": "mast", "x": -1, "y": 0.5, "z": 4}]}
    landmarks = (Landmark("0", 1.0, 2.0), Landmark("mast", -1.0, 0.5, 4.0))
    assert take(record) == [LandmarkMap(5.0, landmarks)]


def test_observations_of_landmarks_and_of_aircraft_are_those_of_one_picture() -> None:
    record = {
        "t_s": 5,
        "observations": [{"id": 0, "u": 320, "v": 256.5}, {"id": 1.0, "u": 1, "v": 2}],
        "aircraft_observations": [{"icao": "3c6dd1", "u": 10, "v": -20}],
    }
    landmarks = (Detection("0", 320.0, 256.5), Detection("1", 1.0, 2.0))
    assert take(record) == [Detections(5.0, landmarks, (Detection("3C6DD1", 10.0, -20.0),))]


def test_empty_lists_are_a_picture_without_anything() -> None:
    assert take({"observations": []}) == [Detections(0.0)]


@pytest.mark.parametrize("key", ["K", "k"])
def test_camera_info_is_read_row_by_row(key: str) -> None:
    record = {"t_s": 1, key: [1000, 0, 640, 0, 1001, 512, 0, 0, 1], "width": 1280, "height": 1024}
    assert take(record) == [CameraInfo(1.0, 1280, 1024, 1000.0, 1001.0, 640.0, 512.0)]


def test_pose_with_a_yaw_leaves_the_attitude_open() -> None:
    [pose] = take({"t_s": 1, "pose": {"x": 10, "y": -2, "yaw": 0.5}})
    assert isinstance(pose, VehiclePose)
    assert (pose.t_s, pose.x_m, pose.y_m, pose.yaw_rad, pose.z_m, pose.world_R_body) == (1, 10, -2, 0.5, None, None)


def test_pose_with_an_orientation_has_it_all() -> None:
    [pose] = take({"t_s": 1, "pose": POSE})
    assert isinstance(pose, VehiclePose)
    assert (pose.x_m, pose.y_m, pose.z_m) == (1, 2, 3)
    assert pose.yaw_rad == pytest.approx(math.pi / 2)
    assert pose.world_R_body is not None
    np.testing.assert_allclose(pose.world_R_body @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize("name", ["vehicle", "trike"])
def test_state_vectors_tell_fix_pose_and_aircraft(name: str) -> None:
    twist = {"linear": {"x": 0, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0}}
    aircraft = {"icao": "3C6DD1", "pose": POSE, "twist": twist, "raw": RAW}
    fix, pose, report = take({"header": HEADER, name: {"pose": POSE, "twist": twist}, "aircraft": [aircraft]})
    assert fix == GlobalFix(100.25, GeodeticPoint(47.4, 8.5, 432.5))
    assert isinstance(pose, VehiclePose)
    assert (pose.t_s, pose.x_m) == (100.25, 1.0)
    assert report == AircraftReport(100.25, "3C6DD1", 47.464127, 8.549031, 5000.0, 251.5, 87.3, -640.0)


def test_state_vector_without_an_altitude_is_kept() -> None:
    *_, report = take({"header": HEADER, "aircraft": [{"icao": "3C6DD1", "raw": {**RAW, "altitude_ft": None}}]})
    assert isinstance(report, AircraftReport)
    assert report.altitude_ft is None


def test_rows_of_a_decoder_are_aircraft() -> None:
    row = {"icao": "3c6dd1", "latitude": 47.4, "longitude": 8.5, "altitude": 5000, "speed": None, "heading": 87.5}
    assert take({"t_s": 7, "aircraft": [row]}) == [AircraftReport(7.0, "3C6DD1", 47.4, 8.5, 5000.0, 0.0, 87.5, 0.0)]


def test_snapshot_of_dump1090_is_known_by_its_rows() -> None:
    record = {"now": 50.0, "aircraft": [{"hex": "3c6dd1", "lat": 47.4, "lon": 8.5, "seen_pos": 0.5}]}
    assert take(record) == [AircraftReport(49.5, "3C6DD1", 47.4, 8.5)]


@pytest.mark.parametrize(
    ("record", "expected"),
    [
        ({"kf_lat": 1, "kf_lon": 2, "lat": 3, "lon": 4, "raw_lat": 5, "raw_lon": 6}, (1, 2)),
        ({"kf_lat": None, "kf_lon": 2, "lat": 3, "lon": 4, "raw_lat": 5, "raw_lon": 6}, (3, 4)),
        ({"raw_lat": 5, "raw_lon": 6}, (5, 6)),
    ],
)
def test_estimate_is_the_best_that_is_there(record: dict[str, Any], expected: tuple[float, float]) -> None:
    [estimate] = take({"t_s": 1, **record, "confidence": 0.5})
    assert isinstance(estimate, EstimatedPosition)
    assert (estimate.point.latitude_deg, estimate.point.longitude_deg) == expected


def test_estimate_that_is_no_place_gives_way_to_the_next() -> None:
    events, refused = refusals({"kf_lat": float("nan"), "kf_lon": 2, "lat": 0, "lon": 0, "raw_lat": 5, "raw_lon": 6})
    assert events == [EstimatedPosition(0.0, GeodeticPoint(5.0, 6.0))]
    assert refused == {"kf_lat is out of range": 1, "no fix: (0, 0)": 1}


def test_records_of_one_object_come_in_the_order_in_which_they_are_needed() -> None:
    record = {
        "observations": [],
        "pose": {"x": 0, "y": 0, "yaw": 0},
        "landmarks": [],
        "fix": {"lat": 1, "lon": 2, "alt_m": 3},
        "K": [1, 0, 1, 0, 1, 1, 0, 0, 1],
        "width": 2,
        "height": 2,
    }
    kinds = [type(event) for event in take(record)]
    assert kinds == [CameraInfo, LandmarkMap, GlobalFix, VehiclePose, Detections]


class TestTime:
    def times(self, *records: Any, arrival_s: float | None = None) -> list[float]:
        return [
            event.t_s for event in take(*({"observations": [], **record} for record in records), arrival_s=arrival_s)
        ]

    @pytest.mark.parametrize(
        "record",
        [
            {"t_s": 5.5, "stamp": 3, "header": {"stamp": 4}},
            {"stamp": 5.5},
            {"stamp": {"sec": 5, "nanosec": 500_000_000}, "header": {"stamp": 4}},
            {"header": {"stamp": {"sec": 5, "nanosec": 500_000_000}}},
            {"header": {"stamp": 5.5}},
        ],
    )
    def test_it_is_the_first_of_those_that_are_there(self, record: dict[str, Any]) -> None:
        assert self.times(record, arrival_s=9.0) == [5.5]

    @pytest.mark.parametrize("record", [{}, {"header": {"stamp": {"sec": 0, "nanosec": 0}}}, {"header": {}}])
    def test_without_one_it_is_that_of_arrival(self, record: dict[str, Any]) -> None:
        assert self.times(record, arrival_s=9.0) == [9.0]

    def test_without_an_arrival_it_is_that_of_the_record_before(self) -> None:
        assert self.times({}, {"t_s": 7}, {}) == [0.0, 7.0, 7.0]

    @pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1.7e18, "5", True, [5], None])
    def test_one_that_is_none_refuses_the_record(self, bad: Any) -> None:
        events, refused = refusals({"t_s": bad, "observations": []})
        assert events == []
        assert list(refused.values()) == [1]


@pytest.mark.parametrize(
    ("record", "reason"),
    [
        ("{", "not JSON"),
        ("hello", "not JSON"),
        ('{"observations": ' + "[" * 100_000, "not JSON"),
        ("7", "no object"),
        ("[]", "no object"),
        ({}, "no known record"),
        ({"unknown": 1}, "no known record"),
        ({"landmarks": 7}, "landmarks is no list"),
        ({"K": [1, 2, 3], "width": 1, "height": 1}, "K is no list of 9 numbers"),
        ({"K": ["x"] * 9, "width": 1, "height": 1}, "K is no number"),
        ({"K": [1] * 9, "height": 1}, "width is no number"),
        ({"pose": 7}, "pose: no object"),
        ({"pose": {"x": 0, "y": 0, "yaw": float("nan")}}, "yaw is out of range"),
        ({"pose": {"x": 1e12, "y": 0, "yaw": 0}}, "x is out of range"),
        ({"pose": {"position": {"x": 0, "y": 0, "z": 0}}}, "orientation: no object"),
        ({"pose": {**POSE, "orientation": {"x": 0, "y": 0, "z": 0, "w": 0}}}, "an attitude that is no rotation"),
        ({"pose": {**POSE, "orientation": {"x": 1e200, "y": 0, "z": 0, "w": 0}}}, "an attitude that is no rotation"),
        ({"pose": {**POSE, "position": {"x": 1e12, "y": 0, "z": 0}}}, "a position out of range"),
        ({"fix": {"lat": 0, "lon": 0, "alt_m": 5}}, "no fix: (0, 0)"),
        ({"fix": {"lat": 91, "lon": 0, "alt_m": 5}}, "bad latitude_deg"),
        ({"fix": {"lat": 1, "lon": 2}}, "alt_m is no number"),
        ({"kf_lat": 1}, "an estimate without a position"),
        ({"vehicle": {}}, "pose: no object"),
    ],
)
def test_record_of_no_use_is_counted(record: Any, reason: str) -> None:
    assert refusals(record) == ([], {reason: 1})


def test_bad_part_of_an_object_leaves_the_others() -> None:
    events, refused = refusals({"t_s": 1, "pose": 7, "observations": [{"id": 3, "u": 1, "v": 2}]})
    assert events == [Detections(1.0, (Detection("3", 1.0, 2.0),))]
    assert refused == {"pose: no object": 1}


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        (7, "landmarks: no object"),
        ({"x": 1, "y": 2}, "an id that is neither text nor a whole number"),
        ({"id": True, "x": 1, "y": 2}, "an id that is neither text nor a whole number"),
        ({"id": 1.5, "x": 1, "y": 2}, "an id that is neither text nor a whole number"),
        ({"id": "", "x": 1, "y": 2}, "an id that is neither text nor a whole number"),
        ({"id": 1, "y": 2}, "x is no number"),
        ({"id": 1, "x": 1, "y": float("inf")}, "y is out of range"),
        ({"id": 1, "x": 1, "y": 2, "z": "high"}, "z is no number"),
        ({"id": 0, "x": 5, "y": 6}, "a landmark whose id is there already"),
    ],
)
def test_bad_landmark_leaves_the_others(row: Any, reason: str) -> None:
    events, refused = refusals({"landmarks": [{"id": 0, "x": 1, "y": 2}, row, {"id": 9, "x": 3, "y": 4}]})
    assert events == [LandmarkMap(0.0, (Landmark("0", 1.0, 2.0), Landmark("9", 3.0, 4.0)))]
    assert refused == {reason: 1}


def test_bad_detections_leave_the_others() -> None:
    record = {
        "observations": [{"id": 0, "u": float("nan"), "v": 2}, {"id": 1, "u": 1, "v": 2}],
        "aircraft_observations": [{"icao": "3C6DD", "u": 1, "v": 2}, 7],
    }
    events, refused = refusals(record)
    assert events == [Detections(0.0, (Detection("1", 1.0, 2.0),))]
    assert refused == {"u is out of range": 1, "not an ICAO address": 1, "aircraft_observations: no object": 1}


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"icao": "XYZ"}, "not an ICAO address"),
        ({"raw": {**RAW, "latitude": None}}, "aircraft without a position"),
        ({"raw": {**RAW, "latitude": 0, "longitude": 0}}, "no fix: (0, 0)"),
        ({"raw": 7}, "raw: no object"),
    ],
)
def test_bad_aircraft_is_counted(fields: dict[str, Any], reason: str) -> None:
    assert refusals({"aircraft": [{"icao": "3C6DD1", "raw": RAW, **fields}]}) == ([], {reason: 1})


def test_speed_that_is_no_number_is_counted_and_the_aircraft_stays() -> None:
    events, refused = refusals({"aircraft": [{"icao": "3C6DD1", "raw": {**RAW, "speed_kts": float("nan")}}]})
    assert [type(event) for event in events] == [AircraftReport]
    assert refused == {"speed_kts is out of range": 1}


_KEYS = [
    "t_s",
    "header",
    "stamp",
    "pose",
    "K",
    "landmarks",
    "observations",
    "aircraft",
    "vehicle",
    "fix",
    "kf_lat",
    "now",
]
_INNER = ["id", "x", "u", "icao", "raw", "position", "orientation", "stamp", "hex", "lat", "lon", "sec", "yaw", "pose"]
_VALUES: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, 0, -1, 10**400, float("nan"), 1e300, "", "3c6dd1", [], [7], {}]
)
_OBJECTS = st.dictionaries(st.sampled_from(_INNER), _VALUES, max_size=4)
_PARTS = _VALUES | _OBJECTS | st.lists(_OBJECTS, max_size=2)


@given(st.dictionaries(st.sampled_from(_KEYS), _PARTS, max_size=4))
def test_nothing_makes_it_raise(record: Any) -> None:
    reader = JsonReader()
    reader.take(json.dumps(record))
    reader.take(json.dumps(record), 5.0)


def test_blank_lines_are_passed_over() -> None:
    reader = JsonReader()
    assert reader.take(" \n") == []
    assert not reader.refused
