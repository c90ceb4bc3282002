# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a log says of texts and versions, in the layout of each release."""

import lzma
import math
from typing import Any, Final

import pytest

from ap_core.dataflash_columns import LogColumns
from ap_core.location import Location
from ap_core.log_structure import MSG
from tests.places import PARITY, RECORDED
from tests.unit.viso.log_records import records
from viso.firmware.log_releases import MSG_NUMBERED, number_and_piece
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6, Firmware
from viso.logs.filter_records import rows_of
from viso.logs.logger import STRUCTURES, MemoryLog
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import HOME, ImuOptions
from viso.vehicle.vehicle import Vehicle, VehicleConfig

LOGS: Final = {
    JULY_2025.name: RECORDED / "logs" / "t265.BIN.xz",
    FEBRUARY_2026.name: PARITY / "2026-02" / "logs" / "t265.BIN.xz",
    APRIL_2026.name: PARITY / "2026-04" / "logs" / "voxl.BIN.xz",
}

recorded_firmware = pytest.mark.parametrize(
    "firmware", [JULY_2025, FEBRUARY_2026, APRIL_2026], ids=lambda one: one.name
)
every_firmware = pytest.mark.parametrize("firmware", PROFILES.values(), ids=lambda one: one.name)


def written(firmware: Firmware, *texts: str) -> bytes:
    """Return the log of a vehicle that has booted and said something."""
    log = MemoryLog()
    vehicle = Vehicle(VehicleConfig(open_log=lambda: log, firmware=firmware))
    Scheduler(vehicle).run_until(2_600_000)
    for text in texts:
        vehicle.log.text(text)
    return bytes(log.data)


def first(data: bytes, name: str) -> dict[str, Any]:
    _kind, values, layout = next(record for record in records(data) if record[0] == name)
    return dict(zip(layout[2].split(","), values, strict=True))


def layouts(data: bytes) -> dict[str, tuple[int, str, str]]:
    """Return id, format and labels by name, of the layouts that come before the firmware's text."""
    found = {}
    for name, values, _ in records(data):
        if name != "FMT":
            break
        found[values[2]] = values[0], *values[3:]
    return found


def one_layout(data: bytes, name: str) -> tuple[str, str] | None:
    """Return format and labels of a kind of record, None if a log has none."""
    found = (values[3:] for kind, values, _ in records(data) if kind == "FMT" and values[2] == name)
    return next(found, None)


@recorded_firmware
def test_layouts_are_those_of_the_recorded_log(firmware: Firmware) -> None:
    recorded = layouts(lzma.decompress(LOGS[firmware.name].read_bytes()))
    own = map(firmware.log.own, STRUCTURES)
    ours = {one.name: (one.msg_type, one.format, one.labels) for one in own}
    common = ours.keys() & recorded.keys()
    assert {"MSG", "VER", "VISP", "REPH", "PARM"} <= common
    assert {name: ours[name] for name in common} == {name: recorded[name] for name in common}


@recorded_firmware
def test_first_text_and_version_are_those_of_the_recorded_log(firmware: Firmware) -> None:
    recorded, ours = lzma.decompress(LOGS[firmware.name].read_bytes()), written(firmware)
    assert first(ours, "MSG")["Message"] == first(recorded, "MSG")["Message"]
    versions = [first(data, "VER") for data in (ours, recorded)]
    for version in versions:
        del version["TimeUS"]
    assert versions[0] == versions[1]


@every_firmware
def test_log_describes_the_texts_that_it_holds(firmware: Firmware) -> None:
    data = written(firmware, "hello")
    layout = firmware.log.message
    assert layouts(data)["MSG"] == (layout.msg_type, layout.format, layout.labels)
    texts = [values[-1] for name, values, _ in records(data) if name == "MSG"]
    assert texts[0] == firmware.banner
    assert texts[-1] == "hello"


@pytest.mark.parametrize("firmware", [STABLE_4_6, JULY_2025], ids=lambda one: one.name)
def test_texts_have_no_numbers_before_2026(firmware: Firmware) -> None:
    assert firmware.log.message is MSG


def test_texts_are_numbered_one_after_the_other() -> None:
    data = written(FEBRUARY_2026, "a", "b")
    heads = [values[1:-1] for name, values, _ in records(data) if name == "MSG"]
    assert [number for number, _ in heads] == list(range(1, 1 + len(heads)))
    assert {piece for _, piece in heads} == {0}


def test_number_of_a_text_is_a_byte_but_0() -> None:
    assert [number_and_piece(before) for before in (0, 254, 255, 256)] == [(1, 0), (255, 0), (1, 0), (2, 0)]


@every_firmware
def test_text_is_cut_to_its_field(firmware: Firmware) -> None:
    values = [values for name, values, _ in records(written(firmware, "x" * 70)) if name == "MSG"]
    assert values[-1][-1] == "x" * 64


def test_layouts_of_a_release_are_all_of_them_in_the_same_order() -> None:
    assert tuple(map(JULY_2025.log.own, STRUCTURES)) == STRUCTURES
    later = [APRIL_2026.log.own(one) for one in STRUCTURES]
    assert [one.name for one in later] == [one.name for one in STRUCTURES]
    assert MSG_NUMBERED in later


def test_4_6_has_ranges_in_centimetres() -> None:
    own = {one.name: one for one in map(STABLE_4_6.log.own, STRUCTURES)}
    assert [own[name].format for name in ("RFND", "RRNH", "RRNI")] == ["QBCBBb", "hhB", "fffHBBB"]
    assert {name for name, one in own.items() if one not in STRUCTURES} == {"RFND", "RRNH", "RRNI", "RFRN"}


def test_truth_of_a_vehicle_that_flies_is_logged_as_a_simulator_does() -> None:
    log = MemoryLog()
    params = {"LOG_DISARMED": 1.0}
    make_ahrs = by_ekf3(FlyingSource, ImuOptions(heading_rad=math.radians(-30.005)))
    vehicle = Vehicle(VehicleConfig(make_ahrs=make_ahrs, open_log=lambda: log, overrides=params))
    scheduler = Scheduler(vehicle)
    scheduler.run_until(6_000_000)
    vehicle.ahrs.set_origin(Location(520_000_000, 40_000_000, 0))
    scheduler.run_until(9_000_000)
    labels = "TimeUS", "Roll", "Pitch", "Yaw", "Alt", "Lat", "Lng"
    last = list(rows_of(LogColumns(bytes(log.data)), "SIM", *labels[1:]))[-3:]
    assert [row[0] for row in last] == [8_800_000, 8_900_000, 9_000_000]
    place = 1e-7 * HOME.lat, 1e-7 * HOME.lng
    assert last[-1][1:] == pytest.approx((0.0, 0.0, 329.99, 584.09, *place), abs=1e-9, rel=1e-7)
    assert one_layout(bytes(log.data), "SIM") == ("QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4")


def test_truth_of_a_vehicle_that_stands_is_not_logged() -> None:
    assert one_layout(written(STABLE_4_6), "SIM") is None
