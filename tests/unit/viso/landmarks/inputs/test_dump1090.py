# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Snapshots of dump1090: new names and old ones, ages, ground, repeats, folders, and rows that are broken."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.landmarks.inputs.base import InputFileError
from viso.landmarks.inputs.dump1090 import Dump1090Folder, Dump1090Reader
from viso.landmarks.types import AircraftReport

NOW_S = 1_700_000_000.2
ROW = {
    "hex": "3c6dd1",
    "flight": "TEST123 ",
    "lat": 47.464127,
    "lon": 8.549031,
    "alt_baro": 5000,
    "alt_geom": 5350,
    "gs": 251.5,
    "track": 87.31,
    "baro_rate": -640,
    "geom_rate": -704,
    "seen_pos": 1.3,
    "seen": 0.2,
}


def snapshot(*rows: Any, now_s: float = NOW_S) -> str:
    return json.dumps({"now": now_s, "messages": 7, "aircraft": list(rows)})


def reports(reader: Dump1090Reader, *texts: str, arrival_s: float | None = None) -> list[AircraftReport]:
    events = [event for text in texts for event in reader.take(text, arrival_s)]
    return [event for event in events if isinstance(event, AircraftReport)]


def row(**fields: Any) -> dict[str, Any]:
    """Return a row with other fields; None takes one out."""
    return {key: value for key, value in {**ROW, **fields}.items() if value is not None}


def report(**fields: Any) -> AircraftReport:
    reader = Dump1090Reader()
    [found] = reports(reader, snapshot(row(**fields)))
    assert not reader.refused
    return found


def test_report_has_the_time_of_the_position() -> None:
    expected = AircraftReport(NOW_S - 1.3, "3C6DD1", 47.464127, 8.549031, 5000.0, 251.5, 87.31, -640.0, True)
    assert report() == expected


def test_names_of_older_versions_are_known() -> None:
    old = {"alt_baro": None, "alt_geom": None, "gs": None, "baro_rate": None, "geom_rate": None}
    found = report(**old, altitude=4975, speed=250, vert_rate=64)
    assert (found.altitude_ft, found.speed_kt, found.vertical_rate_ft_min, found.is_baro) == (4975, 250, 64, True)


def test_geometric_altitude_helps_out() -> None:
    found = report(alt_baro=None)
    assert (found.altitude_ft, found.is_baro) == (5350, False)


def test_geometric_rate_helps_out() -> None:
    assert report(baro_rate=None).vertical_rate_ft_min == -704


@pytest.mark.parametrize("name", ["alt_baro", "altitude"])
def test_aircraft_on_the_ground_has_no_altitude(name: str) -> None:
    fields: dict[str, Any] = {"alt_baro": None, "alt_geom": None, name: "ground"}
    assert report(**fields).altitude_ft is None


def test_all_that_may_be_missing_is_none_or_0() -> None:
    names = set(ROW) - {"hex", "lat", "lon"}
    expected = AircraftReport(NOW_S, "3C6DD1", 47.464127, 8.549031)
    assert report(**dict.fromkeys(names, None)) == expected


def test_age_of_the_aircraft_stands_in_for_that_of_its_position() -> None:
    assert report(seen_pos=None).t_s == NOW_S - 0.2


def test_position_that_was_told_before_is_not_told_again() -> None:
    reader = Dump1090Reader()
    texts = [snapshot(row(seen_pos=0.4 + step + jitter), now_s=NOW_S + step) for step, jitter in ((0, 0), (1, -0.1))]
    assert len(reports(reader, *texts)) == 1
    assert not reader.refused


def test_new_position_is_told_and_so_is_a_new_time_of_the_same_place() -> None:
    texts = [
        snapshot(row(seen_pos=0.1)),
        snapshot(row(seen_pos=0.1, lat=47.465), now_s=NOW_S + 0.1),
        snapshot(row(seen_pos=0.1, lat=47.465), now_s=NOW_S + 1),
        snapshot(row(seen_pos=5, lat=47.463), now_s=NOW_S + 1),
    ]
    times = [found.t_s for found in reports(Dump1090Reader(), *texts)]
    assert times == pytest.approx([NOW_S - 0.1, NOW_S, NOW_S + 0.9])


def test_list_alone_has_the_time_of_its_arrival() -> None:
    text = json.dumps([{"hex": "3c6dd1", "flight": "", "lat": 47.4, "lon": 8.5, "altitude": 100, "speed": 7}])
    [found] = reports(Dump1090Reader(), text, arrival_s=12.5)
    assert (found.t_s, found.altitude_ft, found.speed_kt) == (12.5, 100, 7)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"hex": "~3c6dd"}, "not an ICAO address"),
        ({"hex": "~3c6dd1"}, "not an ICAO address"),
        ({"hex": 3}, "not an ICAO address"),
        ({"lat": None}, "aircraft without a position"),
        ({"lon": None}, "aircraft without a position"),
        ({"lat": 0, "lon": 0}, "no fix: (0, 0)"),
        ({"lat": "47"}, "lat is no number"),
        ({"lat": True}, "lat is no number"),
        ({"lat": float("nan")}, "lat is out of range"),
        ({"lat": 10**400}, "lat is out of range"),
        ({"lon": 200}, "bad longitude_deg"),
    ],
)
def test_row_of_no_use_is_counted_and_the_others_stay(fields: dict[str, Any], reason: str) -> None:
    reader = Dump1090Reader()
    assert [found.icao for found in reports(reader, snapshot(row(**fields), row(hex="abcdef")))] == ["ABCDEF"]
    assert reader.refused == {reason: 1}


@pytest.mark.parametrize("name", ["gs", "track", "baro_rate", "seen_pos", "alt_baro"])
def test_number_that_is_none_is_counted_and_the_aircraft_stays(name: str) -> None:
    reader = Dump1090Reader()
    [found] = reports(reader, snapshot(row(**{name: "?"})))
    assert found.latitude_deg == 47.464127
    assert reader.refused == {f"{name} is no number": 1}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("7", "no list of aircraft"),
        ('{"aircraft": 7}', "no list of aircraft"),
        ('{"aircraft": []}', "no time"),
        ('{"now": 1e300, "aircraft": []}', "now is out of range"),
        ('{"now": 1, "aircraft": [7]}', "an aircraft that is no object"),
    ],
)
def test_snapshot_of_no_use_is_counted(text: str, reason: str) -> None:
    reader = Dump1090Reader()
    assert reader.take(text) == []
    assert reader.refused == {reason: 1}


def test_folder_is_read_in_the_order_of_time(tmp_path: Path) -> None:
    # Copies are kept in a ring: the one with the lowest number may be the newest.
    for name, step in (("history_0", 2), ("history_1", 0), ("history_2", 1)):
        text = json.dumps(json.loads(snapshot(row(lat=47 + 0.001 * step), now_s=NOW_S + step)), indent=1)
        (tmp_path / f"{name}.json").write_text(text)
    (tmp_path / "receiver.json").write_text('{"version": "x", "history": 3}')
    (tmp_path / "stats.json").write_text("[]")
    (tmp_path / "notes.txt").write_text("none of these")
    folder = Dump1090Folder(tmp_path)
    latitudes = [event.latitude_deg for event in folder.events() if isinstance(event, AircraftReport)]
    assert latitudes == [47.0, 47.001, 47.002]
    assert not folder.refused


def test_lines_of_a_file_in_a_folder_are_snapshots_too(tmp_path: Path) -> None:
    lines = [snapshot(row(), now_s=NOW_S), "{", snapshot(row(lat=47.5), now_s=NOW_S + 1)]
    (tmp_path / "day.jsonl").write_text("\n".join(lines))
    folder = Dump1090Folder(tmp_path)
    assert len(list(folder.events())) == 2
    assert folder.refused == {"not JSON": 1}


def test_folder_without_snapshots_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputFileError) as raised:
        list(Dump1090Folder(tmp_path).events())
    assert str(raised.value) == f"{tmp_path}: no snapshots of aircraft (*.json)"


_VALUES = st.sampled_from(
    [None, True, 0, -1, 10**400, float("nan"), float("-inf"), 1e300, "", "ground", "3c6dd1", [], [7], {}, {"lat": 1}]
)


@given(now=_VALUES, fields=st.dictionaries(st.sampled_from([*ROW, "altitude", "speed"]), _VALUES, max_size=4))
def test_nothing_makes_it_raise(now: Any, fields: dict[str, Any]) -> None:
    reader = Dump1090Reader()
    reader.take(json.dumps({"now": now, "aircraft": [{**ROW, **fields}, fields, now]}), 1.0)
    reader.take(json.dumps([{**ROW, **fields}, now]), 1.0)
    reader.take(json.dumps(now), 1.0)
