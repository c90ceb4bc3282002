# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses, fixes and aircraft from DataFlash logs: made ones, and one of the firmware."""

import lzma
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from ap_core.dataflash import DataFlashWriter
from ap_core.log_field import LogValue
from ap_core.log_structure import FMT, FMTU, MULT, PARM, UNIT
from tests.places import RECORDED
from viso.errors import InputError
from viso.landmarks.inputs.base import InputFileError
from viso.landmarks.inputs.dataflash import DataFlashFile
from viso.landmarks.types import AircraftReport, Event, GeodeticPoint, GlobalFix, VehiclePose

LOGS = RECORDED / "logs"
KNOWN = 1 << 3 | 1 << 5
Record = tuple[str, Sequence[LogValue]]

_TYPES = {
    "XKF4": ("QBIb", "TimeUS,C,SS,PI"),
    "XKF1": ("QBccCfff", "TimeUS,C,Roll,Pitch,Yaw,PN,PE,PD"),
    "POS": ("QLLf", "TimeUS,Lat,Lng,Alt"),
    "GPS": ("QBIH", "TimeUS,Status,GMS,GWk"),
    "ADSB": ("QIiiiHHhH", "TimeUS,ICAO_address,Lat,Lng,Alt,Heading,Hor_vel,Ver_vel,Squark"),
}


def status(t_s: float, core: int = 0, *, known: int = KNOWN, primary: int = 0) -> Record:
    return "XKF4", (round(t_s * 1e6), core, known, primary)


def state(t_s: float, core: int = 0, yaw_cdeg: int = 9000, north_m: float = 3.0) -> Record:
    return "XKF1", (round(t_s * 1e6), core, 100, -200, yaw_cdeg, north_m, 4.0, -5.0)


def write(path: Path, *records: Record) -> Path:
    """Write a log with records, each a name and its values."""
    writer = DataFlashWriter([FMT, UNIT, FMTU, MULT, PARM])
    types = {name: writer.define(name, labels, formats) for name, (formats, labels) in _TYPES.items()}
    data = b"".join(writer.start_up([], time_us=0))
    data += b"".join(writer.record(types[name], values) for name, values in records)
    path.write_bytes(lzma.compress(data) if path.suffix == ".xz" else data)
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "flight.BIN"


def read(path: Path) -> tuple[list[Event], DataFlashFile]:
    file = DataFlashFile(path)
    return list(file.events()), file


@pytest.mark.parametrize("name", ["flight.BIN", "flight.BIN.xz"])
def test_pose_is_that_of_one_record(tmp_path: Path, name: str) -> None:
    [pose], file = read(write(tmp_path / name, status(1), state(1)))
    assert isinstance(pose, VehiclePose)
    assert (pose.t_s, pose.x_m, pose.y_m, pose.z_m) == (1.0, 4.0, 3.0, 5.0)
    assert pose.yaw_rad == pytest.approx(0, abs=1e-9)
    assert pose.world_R_body is not None
    forward, left, _ = pose.world_R_body.T
    assert forward[2] == pytest.approx(math.sin(math.radians(-2)))  # nose down
    assert left[2] == pytest.approx(math.sin(math.radians(1)) * math.cos(math.radians(-2)))  # right side down
    assert not file.refused


def test_pose_is_that_of_the_core_which_the_autopilot_flew_with(path: Path) -> None:
    records = []
    for step, primary in enumerate((0, 1, 1)):
        for core in (0, 1):
            records += [status(step, core, primary=primary), state(step, core, north_m=10.0 * core)]
    events, _ = read(write(path, *records))
    assert [event.y_m for event in events if isinstance(event, VehiclePose)] == [0.0, 10.0, 10.0]


@pytest.mark.parametrize("known", [0, 1 << 3, 1 << 5])
def test_no_pose_before_the_position_is_known(path: Path, known: int) -> None:
    events, file = read(write(path, status(1, known=known), state(1), status(2), state(2)))
    assert [event.t_s for event in events] == [2.0]
    assert file.refused == {"a pose before the position is known": 1}


def test_position_that_is_not_finite_is_counted(path: Path) -> None:
    events, file = read(write(path, status(1), state(1, north_m=math.nan)))
    assert events == []
    assert file.refused == {"a position out of range": 1}


def test_fixes_are_those_of_the_vehicle(path: Path) -> None:
    places = [("POS", (1_000_000, 0, 0, 5.0)), ("POS", (2_000_000, 474_000_000, 85_000_000, 432.5))]
    events, file = read(write(path, status(0), *places))
    assert events == [GlobalFix(2.0, GeodeticPoint(47.4, 8.5, 432.5))]
    assert file.refused == {"no fix: (0, 0)": 1}


def test_aircraft_have_the_units_of_their_message(path: Path) -> None:
    record = ("ADSB", (5_000_000, 0x3C6DD1, 474_641_270, 85_490_310, 1_524_000, 8731, 12938, -325, 7000))
    [report], _ = read(write(path, status(0), record))
    assert isinstance(report, AircraftReport)
    assert (report.t_s, report.icao) == (5.0, "3C6DD1")
    assert (report.latitude_deg, report.longitude_deg) == pytest.approx((47.464127, 8.549031), abs=1e-9)
    assert report.altitude_ft == pytest.approx(5000)
    assert report.heading_deg == pytest.approx(87.31)
    assert (report.speed_kt, report.vertical_rate_ft_min) == pytest.approx((251.5, -640), abs=1)


def test_gps_tells_how_far_the_clock_is_from_utc(path: Path) -> None:
    # Week 2375 began on 2025-07-13 00:00:00 of GPS, 18 s before midnight UTC.
    week = [("GPS", (2_000_000 + 200_000 * i, 3, 86_400_000 + 200 * i, 2375)) for i in range(5)]
    file = DataFlashFile(write(path, status(0), ("GPS", (1_000_000, 1, 0, 0)), *week))
    assert file.utc_minus_boot_s is None
    assert list(file.events()) == []
    assert file.utc_minus_boot_s == pytest.approx(1_752_451_200 - 18 - 2)


def complaint(path: Path) -> str:
    with pytest.raises(InputFileError) as raised:
        list(DataFlashFile(path).events())
    assert len(str(raised.value).splitlines()) == 1
    return str(raised.value)


def test_log_of_another_estimator_says_what_it_lacks(path: Path) -> None:
    write(path, ("POS", (1, 474_000_000, 85_000_000, 432.5)))
    assert complaint(path) == f"{path}: holds no XKF1 and XKF4 records to take poses from"


def test_log_that_cannot_be_opened_is_left_to_who_opens_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file or directory"):
        read(tmp_path / "none.BIN")


@pytest.mark.parametrize("lost_bytes", [1, 37, 500])
def test_log_that_is_cut_short_ends_early(path: Path, lost_bytes: int, capsys: pytest.CaptureFixture[str]) -> None:
    records = [record for step in range(50) for record in (status(step), state(step))]
    path.write_bytes(write(path, *records).read_bytes()[:-lost_bytes])
    events, _ = read(path)
    assert 30 < len(events) < 50
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_log_of_the_firmware_agrees_with_its_attitude_records() -> None:
    events, file = read(LOGS / "t265.BIN.xz")
    poses = [event for event in events if isinstance(event, VehiclePose)]
    fixes = [event for event in events if isinstance(event, GlobalFix)]
    assert len(poses) > 300
    assert len(fixes) > 300
    assert set(file.refused) == {"a pose before the position is known"}
    # The last ATT of the log: 0.7616 deg; the last POS: 5 mm below the EKF's origin.
    assert math.degrees(poses[-1].yaw_rad) == pytest.approx(90 - 0.7616, abs=0.006)
    assert poses[-1].z_m is not None
    assert poses[-1].z_m == pytest.approx(-0.00504, abs=1e-4)
    assert fixes[-1].point.alt_m - poses[-1].z_m == pytest.approx(584, abs=0.02)
    assert np.all(np.diff([event.t_s for event in poses]) > 0)
