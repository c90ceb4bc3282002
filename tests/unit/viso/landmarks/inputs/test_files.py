# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which reader a file gets."""

import json
from pathlib import Path

import pytest

from viso.landmarks.inputs.bags import BagFile
from viso.landmarks.inputs.base import InputFileError
from viso.landmarks.inputs.dataflash import DataFlashFile
from viso.landmarks.inputs.dump1090 import Dump1090Folder
from viso.landmarks.inputs.files import InputOptions, line_reader, open_file
from viso.landmarks.inputs.json_lines import JsonReader
from viso.landmarks.inputs.sbs1 import Sbs1Reader
from viso.landmarks.inputs.vehicle import TlogFile
from viso.landmarks.types import AircraftReport, Event, LandmarkMap

SBS1 = "MSG,3,1,1,3C6DD1,1,2025/07/14,12:00:00.000,2025/07/14,12:00:00.000,,5000,,,47.4,8.5,,,,,,0"
SNAPSHOT = {"now": 50.0, "aircraft": [{"hex": "3c6dd1", "lat": 47.4, "lon": 8.5}]}
OPTIONS = InputOptions()
LANDMARKS = {"landmarks": [{"id": 0, "x": 1, "y": 2}]}


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.tlog", TlogFile),
        ("A.TLOG.GZ", TlogFile),
        ("a.BIN", DataFlashFile),
        ("a.bin.xz", DataFlashFile),
        ("a.bag", BagFile),
        ("a.mcap", BagFile),
        ("a.db3", BagFile),
    ],
)
def test_logs_are_known_by_their_ending(tmp_path: Path, name: str, kind: type) -> None:
    assert isinstance(open_file(tmp_path / name, OPTIONS), kind)


def test_folder_is_a_bag_if_it_says_so_and_else_one_of_snapshots(tmp_path: Path) -> None:
    assert isinstance(open_file(tmp_path, OPTIONS), Dump1090Folder)
    (tmp_path / "metadata.yaml").write_text("")
    assert isinstance(open_file(tmp_path, OPTIONS), BagFile)


def events_of(path: Path, text: str) -> list[Event]:
    path.write_text(text)
    file = open_file(path, OPTIONS)
    events = list(file.events())
    assert not file.refused
    return events


@pytest.mark.parametrize("indent", [None, 2])
def test_text_in_json_may_be_one_record_over_several_lines(tmp_path: Path, indent: int | None) -> None:
    [event] = events_of(tmp_path / "map.json", json.dumps(LANDMARKS, indent=indent))
    assert isinstance(event, LandmarkMap)


@pytest.mark.parametrize("indent", [None, 2])
def test_snapshot_of_dump1090_may_be_so_too(tmp_path: Path, indent: int | None) -> None:
    [event] = events_of(tmp_path / "aircraft.json", json.dumps(SNAPSHOT, indent=indent))
    assert isinstance(event, AircraftReport)


def test_lines_of_json_may_be_of_different_kinds(tmp_path: Path) -> None:
    lines = [LANDMARKS, SNAPSHOT, {**SNAPSHOT, "now": 51.0}]
    events = events_of(tmp_path / "records.jsonl", "\n".join(map(json.dumps, lines)))
    assert [type(event) for event in events] == [LandmarkMap, AircraftReport, AircraftReport]


def test_lines_of_basestation_are_known_even_behind_a_piece_of_one(tmp_path: Path) -> None:
    path = tmp_path / "port30003.txt"
    path.write_text(f"{SBS1[40:]}\n{SBS1}\n")
    file = open_file(path, InputOptions(utc_offset_s=3600.0))
    [event] = file.events()
    utc = events_of(tmp_path / "utc.txt", SBS1)[0]
    assert isinstance(event, AircraftReport)
    assert isinstance(utc, AircraftReport)
    assert event.t_s == utc.t_s - 3600
    assert sum(file.refused.values()) == 1


def test_frames_are_known_by_their_digits() -> None:
    pytest.importorskip("pyModeS", reason="pyModeS is not installed")
    from viso.landmarks.inputs.mode_s import ModeSReader

    digits = "8D3C6DD1" + "0" * 20
    for line in (f"*{digits};", digits, f"1.5,{digits}", f"@{'0' * 12}{digits};"):
        assert isinstance(line_reader(line), ModeSReader)


@pytest.mark.parametrize("line", ["hello", "1,2,3", "deadbeef", ""])
def test_line_of_no_kind_has_no_reader(line: str) -> None:
    assert line_reader(line) is None


def test_line_in_braces_and_one_of_basestation_have_theirs() -> None:
    assert isinstance(line_reader("{"), JsonReader)
    assert isinstance(line_reader("STA,,5,179,3C6DD1"), Sbs1Reader)


@pytest.mark.parametrize(
    ("text", "reason"), [("", "empty"), ("\n \n", "empty"), ("hello\n", "none of JSON lines, aircraft.json")]
)
def test_file_of_no_kind_is_one_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "notes"
    path.write_text(text)
    with pytest.raises(InputFileError) as raised:
        open_file(path, OPTIONS)
    assert str(raised.value).startswith(f"{path}: {reason}")
    assert len(str(raised.value).splitlines()) == 1


def test_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="No such file or directory"):
        open_file(tmp_path / "none.txt", OPTIONS)
