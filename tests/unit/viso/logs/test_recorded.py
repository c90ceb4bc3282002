# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitude and position are taken from a log: of one core, and only positions that were valid."""

import gc
import lzma
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from ap_core.dataflash import DataFlashWriter
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import ATT, COMMON_STRUCTURES, FMT, MSG
from ekf_stub.ahrs.ahrs_base import AHRS_START_US
from tests.dfreader import read_log
from tests.places import DATA, RECORDED
from viso.errors import InputError
from viso.logs.recorded import read_columns, read_recorded_states, records_in

FIRMWARE_LOG = RECORDED / "logs" / "t265.BIN.xz"

XKF1 = ("XKF1", "TimeUS,C,PN,PE,PD,VN,VE,VD", "QBffffff")
XKF4 = ("XKF4", "TimeUS,C,SS", "QBI")
STILL = (0, 0, 0)
HAS_POSITION = 1 << 3 | 1 << 5
HAS_ABSOLUTE_POSITION = 1 << 4 | 1 << 5

Record = tuple[str, Sequence[LogValue]]


def att(time_us: int, roll: float, pitch: float, yaw: float) -> Record:
    return "ATT", (time_us, 0.0, roll, 0.0, pitch, 0.0, yaw, 3)


def log_bytes(*records: Record) -> bytes:
    writer = DataFlashWriter(COMMON_STRUCTURES)
    types = {"ATT": ATT} | {definition[0]: writer.define(*definition) for definition in (XKF1, XKF4)}
    start_up = b"".join(writer.start_up([], time_us=0))
    return start_up + b"".join(writer.record(types[name], values) for name, values in records)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "recorded.BIN"


def error_of(path: Path) -> str:
    with pytest.raises(InputError) as raised:
        read_recorded_states(path)
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_start_of_the_ahrs_is_two_seconds_before_its_filter_was_initialised(path: Path) -> None:
    text = MSG, (4_444_055, "EKF3 IMU0 initialised")
    path.write_bytes(log_bytes(att(1000, 0, 0, 0)) + text[0].pack(text[1]))
    assert read_recorded_states(path).start_us == 2_442_000
    path.write_bytes(log_bytes(att(1000, 0, 0, 0)))
    assert read_recorded_states(path).start_us == AHRS_START_US


def test_attitudes_are_read(path: Path) -> None:
    path.write_bytes(log_bytes(att(1000, 1, -2, 350), att(2000, 3, -4, 10)))
    states = read_recorded_states(path)
    assert states.att_time_us.tolist() == [1000, 2000]
    assert states.att_rpy_deg.tolist() == [[1, -2, 350], [3, -4, 10]]


def test_log_may_hold_no_position(path: Path) -> None:
    path.write_bytes(log_bytes(att(1000, 0, 0, 0)))
    states = read_recorded_states(path)
    assert (states.pos_time_us.shape, states.pos_ned.shape) == ((0,), (0, 3))


@pytest.mark.parametrize(("status", "read"), [
    (HAS_POSITION, True),
    (HAS_ABSOLUTE_POSITION, True),
    (1 << 3, False),
    (1 << 5, False),
    (0, False),
])  # fmt: skip
def test_position_counts_when_the_status_says_so(path: Path, status: int, read: bool) -> None:
    path.write_bytes(log_bytes(att(1, 0, 0, 0), ("XKF4", (1000, 0, status)), ("XKF1", (1000, 0, 1, 2, -3, *STILL))))
    assert read_recorded_states(path).pos_ned.tolist() == ([[1, 2, -3]] if read else [])


@pytest.mark.parametrize(("text_us", "start_us"), [(960_000, 960_000), (800_000, 1_000_000), (1_000_001, 1_000_000)])
def test_position_is_valid_from_the_text_just_before_its_first_record(path: Path, text_us: int, start_us: int) -> None:
    records: list[Record] = [
        att(1, 0, 0, 0),
        ("XKF4", (1_000_000, 0, HAS_POSITION)),
        ("XKF1", (1_000_000, 0, 1, 2, -3, *STILL)),
    ]
    path.write_bytes(log_bytes(*records) + MSG.pack((text_us, "EKF3 IMU0 is using GPS")))
    assert read_recorded_states(path).pos_start_us == start_us


def test_only_the_first_core_counts(path: Path) -> None:
    records: list[Record] = [
        att(1, 0, 0, 0),
        ("XKF4", (1000, 0, HAS_POSITION)),
        ("XKF1", (1000, 0, 1, 2, -3, *STILL)),
        ("XKF4", (1000, 1, 0)),
        ("XKF1", (1000, 1, 9, 9, 9, *STILL)),
        ("XKF1", (1100, 0, 4, 5, -6, *STILL)),
    ]
    path.write_bytes(log_bytes(*records))
    states = read_recorded_states(path)
    assert states.pos_time_us.tolist() == [1000, 1100]
    assert states.pos_ned.tolist() == [[1, 2, -3], [4, 5, -6]]


def test_log_of_an_old_release_has_one_core_in_a_type(path: Path) -> None:
    """Copter 3.6: XKF1 and XKF4 have no C, and other cores are of other types."""
    writer = DataFlashWriter(COMMON_STRUCTURES)
    xkf1, xkf4 = writer.define("XKF1", "TimeUS,PN,PE,PD,VN,VE,VD", "Qffffff"), writer.define("XKF4", "TimeUS,SS", "QI")
    kinds = (ATT, att(1, 0, 0, 0)[1]), (xkf4, (1000, HAS_POSITION)), (xkf1, (1000, 1, 2, -3, *STILL))
    path.write_bytes(b"".join(writer.start_up([], time_us=0)) + b"".join(writer.record(*one) for one in kinds))
    assert read_recorded_states(path).pos_ned.tolist() == [[1, 2, -3]]


def test_packed_log_is_read(path: Path) -> None:
    packed = path.with_suffix(".BIN.xz")
    packed.write_bytes(lzma.compress(log_bytes(att(1000, 1, 2, 3))))
    assert read_recorded_states(packed).att_rpy_deg.tolist() == [[1, 2, 3]]


def test_log_of_the_firmware_is_read() -> None:
    states = read_recorded_states(FIRMWARE_LOG)
    assert len(states.att_time_us) > 300
    assert states.att_time_us[0] == pytest.approx(2.55e6, abs=1e4)
    assert len(states.pos_time_us) > 300


def test_log_that_is_cut_short_is_read_to_its_end(path: Path) -> None:
    path.write_bytes(log_bytes(att(1000, 0, 0, 1), att(2000, 0, 0, 2))[:-5])
    assert read_recorded_states(path).att_time_us.tolist() == [1000]


def test_log_without_attitudes_is_refused(path: Path) -> None:
    path.write_bytes(log_bytes())
    assert error_of(path) == f"{path}: holds no ATT records to take the attitude from"


def test_missing_log_is_an_error(path: Path) -> None:
    assert error_of(path) == f"{path}: No such file or directory"


def test_missing_packed_log_is_an_error(path: Path) -> None:
    packed = path.with_suffix(".xz")
    assert error_of(packed) == f"{packed}: No such file or directory"


def test_damaged_packed_log_is_an_error(path: Path) -> None:
    packed = path.with_suffix(".xz")
    packed.write_bytes(lzma.compress(b"x" * 1000)[:-20])
    assert error_of(packed).startswith(f"{packed}: damaged xz file: ")


@pytest.mark.parametrize("data", [b"", b"text\n" * 100, bytes(1000), bytes(range(256)) * 8])
def test_file_that_is_no_log_is_refused(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    assert error_of(path) == f"{path}: not a DataFlash log"


@pytest.mark.slow
def test_log_that_cannot_be_understood_is_refused(path: Path) -> None:
    path.write_bytes(bytes.fromhex("a3 95 80 80") + b"\xff" * 300)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pymavlink leaves the file open when it fails
        error = error_of(path)
        gc.collect()
    assert error.startswith(f"{path}: not a DataFlash log: ")


def test_damage_is_passed_over_without_a_word_on_standard_output(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path.write_bytes(log_bytes(att(1000, 0, 0, 1)) + b"damage" + log_bytes(att(2000, 0, 0, 2)))
    assert read_recorded_states(path).att_time_us.tolist() == [1000, 2000]
    assert capfd.readouterr().out == ""


def test_reader_says_nothing_of_damage(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    sound = log_bytes(att(1000, 0, 0, 1))
    path.write_bytes(sound + b"damage" * 100 + sound + bytes((0xA3, 0x95, 250)) + b"damage" + sound[:-5])
    assert records_of(path) == ["ATT 1000", "ATT 1000"]
    assert capfd.readouterr() == ("", "")


def records_of(path: Path) -> list[str]:
    return [f"{one.get_type()} {one.TimeUS}" for one in records_in(read_columns(path), ["ATT", "XKF4"])]


def kinds_of(log: Any) -> list[str]:
    found = []
    while (record := log.recv_match(type=["ATT", "XKF4"])) is not None:
        found.append(f"{record.get_type()} {record.TimeUS}")
    return found


def test_records_of_some_kinds_come_in_the_order_of_the_log(path: Path) -> None:
    path.write_bytes(
        log_bytes(att(1, 0, 0, 0.5), ("XKF4", (2, 0, 7)), ("XKF1", (3, 0, 1, 2, -3, *STILL)), att(4, 0, 0, 0))
    )
    found = list(records_in(read_columns(path), ["XKF4", "VISP", "ATT"]))
    assert [(one.get_type(), one.TimeUS) for one in found] == [("ATT", 1), ("XKF4", 2), ("ATT", 4)]
    assert (found[0].Yaw, found[1].SS) == (0.5, 7)


@pytest.mark.slow
def test_kinds_are_read_as_dfreader_reads_them() -> None:
    counts = read_columns(FIRMWARE_LOG).counts
    kept = records_of(FIRMWARE_LOG)
    assert kept == read_log(FIRMWARE_LOG, kinds_of)
    assert len(kept) == counts["ATT"] + counts["XKF4"]


def test_kinds_are_read_past_damage(path: Path) -> None:
    path.write_bytes(log_bytes(att(1000, 0, 0, 1)) + bytes((0xA3, 0x95, 1)) + log_bytes(att(2000, 0, 0, 2)))
    columns = read_columns(path)
    assert [lost.size for lost in columns.lost] == [3]
    assert records_of(path) == ["ATT 1000", "ATT 2000"]


def test_log_with_a_type_without_length_is_read(path: Path) -> None:
    # DFReader reads a record of such a type for ever.
    described = FMT.pack((200, 0, "NONE", "", "")) + bytes((0xA3, 0x95, 200))
    path.write_bytes(log_bytes(att(1000, 0, 0, 1)) + described + log_bytes(att(2000, 0, 0, 2)))
    assert records_of(path) == ["ATT 1000", "ATT 2000"]


def test_log_as_columns_is_refused_like_any_other(path: Path) -> None:
    path.write_bytes(b"text")
    with pytest.raises(InputError, match="not a DataFlash log"):
        read_columns(path)


def test_log_without_a_needed_field_is_refused(path: Path) -> None:
    writer = DataFlashWriter([one for one in COMMON_STRUCTURES if one.name != "ATT"])
    other = writer.define("ATT", "TimeUS,Roll", "Qf")
    path.write_bytes(b"".join(writer.start_up([], time_us=0)) + writer.record(other, (1, 2.0)))
    assert error_of(path) == f"{path}: not a DataFlash log: 'Pitch'"


@pytest.mark.parametrize(
    ("labels", "values"),
    [("TimeUS,Type,Lat,Lng", (1000, 0, 1, 2)), ("TimeUS,Type,Lat,Lng,Alt", (1000, 0, 1, 2, math.nan))],
)
def test_origin_that_cannot_be_read_leaves_the_attitude(path: Path, labels: str, values: Sequence[LogValue]) -> None:
    writer = DataFlashWriter([structure for structure in COMMON_STRUCTURES if structure.name != "ORGN"])
    origin = writer.define("ORGN", labels, "QBffff"[: len(values)])
    records = writer.record(ATT, att(1000, 0, 0, 0)[1]), writer.record(origin, values)
    path.write_bytes(b"".join((*writer.start_up([], time_us=0), *records)))
    states = read_recorded_states(path)
    assert (states.att_time_us.tolist(), states.gps_origin) == ([1000], None)


def test_origin_is_read_where_gps_gave_it() -> None:
    found = read_recorded_states(DATA / "reflown" / "gps_extnav_t265.BIN.xz").gps_origin
    assert found is not None
    time_us, place = found
    assert time_us == pytest.approx(20e6, abs=1e5)
    assert place == Location(-353_632_610, 1_491_652_299, 58_409)
    assert read_recorded_states(FIRMWARE_LOG).gps_origin is None  # a client set it
