# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layouts of records: what is accepted, how a record is packed, and equality with the firmware's own tables."""

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.log_field import LogValue
from ap_core.log_structure import (
    ATT,
    COMMON_STRUCTURES,
    FMT,
    MSG,
    MULTIPLIERS,
    ORGN,
    PARM,
    QUIET_NAN,
    UNITS,
    LogStructure,
)
from tests.places import DATA

FIRMWARE_FMT = DATA / "firmware_fmt.json"

# From UNIT and MULT records of the recorded log voxl.BIN (ArduCopter 4.7.0-dev of July 2025, SITL).
RECORDED_UNITS = (
    "- ,? UNKNOWN,A A,a Ah,d deg,b B,B B/s,k deg/s,D deglatitude,e deg/s/s,E rad/s,G Gauss,h degheading,i A.s,"
    "J W.s,l l,L rad/s/s,m m,n m/s,o m/s/s,O degC,% %,S satellites,s s,t N.m,q rpm,r rad,U deglongitude,u ppm,"
    "v V,P Pa,w Ohm,W Watt,X W.h,y l/s,Y us,z Hz,# instance"
)
RECORDED_MULTIPLIERS = {
    "-": "0000000000000000",
    "?": "000000000000f03f",
    "2": "0000000000005940",
    "1": "0000000000002440",
    "0": "000000000000f03f",
    "A": "000000a09999b93f",
    "B": "00000040e17a843f",
    "C": "000000e04d62503f",
    "D": "000000e0e2361a3f",
    "E": "00000080b5f8e43e",
    "F": "000000a0f7c6b03e",
    "G": "000000a0f2d77a3e",
    "I": "000000e00b2e113e",
    "!": "000000c0cccc0c40",
    "/": "000000000020ac40",
}


def recorded_types() -> dict[str, dict[str, Any]]:
    types: dict[str, dict[str, Any]] = json.loads(FIRMWARE_FMT.read_text())["types"]
    return types


def structure(format: str, labels: str | None = None) -> LogStructure:
    count = len(format)
    names = ",".join(f"F{index}" for index in range(count)) if labels is None else labels
    return LogStructure(1, "TEST", format, names, "-" * count, "-" * count)


def test_record_begins_with_the_header() -> None:
    assert structure("B").pack([7]) == bytes([0xA3, 0x95, 1, 7])


def test_fields_follow_each_other_without_padding() -> None:
    assert structure("BQh").pack([1, 2, -1])[3:] == struct.pack("<BQh", 1, 2, -1)


def test_format_describes_itself_in_89_bytes() -> None:
    record = FMT.pack((FMT.msg_type, FMT.length, FMT.name, FMT.format, FMT.labels))
    assert record == (
        bytes.fromhex("a3958080 59")
        + b"FMT\0BBnNZ".ljust(20, b"\0")
        + b"Type,Length,Name,Format,Columns".ljust(64, b"\0")
    )


def test_origin_record_takes_raw_position_and_physical_height() -> None:
    record = ORGN.pack((1_000_000, 1, -353632621, 1491652374, np.float32(584.09)))
    assert record[3:] == struct.pack("<QBiii", 1_000_000, 1, -353632621, 1491652374, 58409)


@pytest.mark.parametrize("value", [1.25, np.float64(1.25), np.float32(1.25), 125])
def test_any_kind_of_number_goes_into_a_field_of_hundredths(value: LogValue) -> None:
    assert structure("c").pack([value])[3:] == struct.pack("<h", 125)


@pytest.mark.parametrize("value", [1e31, -1e300, np.float32(3e38), np.float32(-math.inf), math.nan, 1 << 1100])
@pytest.mark.parametrize("format", ["c", "L", "h"])
def test_what_an_integer_field_cannot_hold_becomes_the_low_bits_of_what_the_processor_makes(
    value: LogValue, format: str
) -> None:
    lowest = value if isinstance(value, int) else -(1 << 31)
    size = {"c": 2, "L": 4, "h": 2}[format]
    assert int.from_bytes(structure(format).pack([value])[3:], "little") == lowest & ((1 << 8 * size) - 1)


def test_parameter_default_marker_bytes() -> None:
    assert PARM.pack((0, "VISO_TYPE", 1.0, QUIET_NAN))[-4:] == bytes.fromhex("5241c07f")


def test_length_counts_the_header() -> None:
    assert structure("BQf").length == 3 + 1 + 8 + 4


def test_fields_are_the_labels() -> None:
    assert MSG.fields == ("TimeUS", "Message")


@pytest.mark.parametrize("values", [[], [1], [1, 2, 3]])
def test_wrong_number_of_values_is_refused(values: list[LogValue]) -> None:
    with pytest.raises(ValueError, match=r"TEST: . values for 2 fields"):
        structure("BB").pack(values)


@pytest.mark.parametrize(("format", "value"), [("B", "x"), ("f", b"x"), ("Z", 1), ("n", 1.5)])
def test_mixing_text_and_numbers_is_refused(format: str, value: LogValue) -> None:
    with pytest.raises(ValueError, match=r"TEST: .* field"):
        structure(format).pack([value])


@given(values=st.lists(st.floats() | st.integers() | st.floats(width=32).map(np.float32), min_size=16, max_size=16))
def test_any_numbers_make_a_record_of_the_stated_length(values: Sequence[LogValue]) -> None:
    wide = structure("BbMhHiIqQcCeELfd")
    assert len(wide.pack(values)) == wide.length


@given(bits=st.lists(st.integers(0, 0xFFFFFFFF), min_size=6, max_size=6))
def test_attitude_floats_round_trip_bit_for_bit(bits: list[int]) -> None:
    values = [np.uint32(each).view(np.float32) for each in bits]
    assert struct.unpack("<6I", ATT.pack([0, *values, 0])[11:35]) == tuple(bits)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"msg_type": 255}, "message id 255"),
        ({"msg_type": -1}, "message id -1"),
        ({"name": ""}, "name needs"),
        ({"name": "LONGN"}, "name needs"),
        ({"name": "É"}, "ASCII"),
        ({"labels": "TimeUS,É"}, "ASCII"),
        ({"labels": "TimeUS"}, "differ in number"),
        ({"labels": "Same,Same"}, "not unique"),
        ({"labels": "TimeUS,"}, "a label is empty"),
        ({"labels": "TimeUS," + "x" * 58}, "longer than 64"),
        ({"format": "Qx"}, "unknown character in format"),
        ({"format": "Q"}, "differ in number"),
        ({"format": ""}, "0 fields"),
        ({"units": "s"}, "differ in number"),
        ({"units": "sx"}, "unknown unit"),
        ({"multipliers": "F--"}, "differ in number"),
        ({"multipliers": "Fx"}, "unknown multiplier"),
    ],
)
def test_invalid_layouts_are_refused(changes: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        replace(MSG, **changes)


def test_more_than_16_fields_are_refused() -> None:
    with pytest.raises(ValueError, match="17 fields"):
        structure("B" * 17)


def test_the_longest_labels_fit_without_terminator() -> None:
    assert len(structure("BB", "A," + "x" * 62).labels) == 64


def test_records_longer_than_255_bytes_are_refused() -> None:
    with pytest.raises(ValueError, match="259 bytes"):
        structure("ZZZZ")


def test_records_of_255_bytes_are_accepted() -> None:
    assert structure("ZZZQQQQQQQI").length == 255


def test_units_are_those_of_a_firmware_log() -> None:
    assert ",".join(f"{char} {label}" for char, label in UNITS) == RECORDED_UNITS


def test_multipliers_are_those_of_a_firmware_log_bit_for_bit() -> None:
    packed = [(char, struct.pack("<d", factor).hex()) for char, factor in MULTIPLIERS]
    assert packed == list(RECORDED_MULTIPLIERS.items())


@pytest.mark.parametrize("name", sorted(recorded_types().keys() & {each.name for each in COMMON_STRUCTURES}))
def test_common_structures_are_those_of_a_firmware_log(name: str) -> None:
    ours = next(each for each in COMMON_STRUCTURES if each.name == name)
    assert recorded_types()[name] == {
        "id": ours.msg_type,
        "length": ours.length,
        "format": ours.format,
        "labels": ours.labels,
        "units": ours.units,
        "mults": ours.multipliers,
    }


# MAVC, DSF and MAV are left out of the recorded logs; lengths as in the firmware's structs.
@pytest.mark.parametrize(("name", "msg_type", "length"), [("MAVC", 78, 48), ("DSF", 177, 33), ("MAV", 183, 27)])
def test_structures_that_are_not_recorded_have_the_firmware_size(name: str, msg_type: int, length: int) -> None:
    ours = next(each for each in COMMON_STRUCTURES if each.name == name)
    assert (ours.msg_type, ours.length) == (msg_type, length)


def test_common_structures_come_in_the_order_of_a_firmware_log() -> None:
    recorded = list(recorded_types())
    positions = [recorded.index(each.name) for each in COMMON_STRUCTURES if each.name in recorded]
    assert positions == sorted(positions)


NUMERIC = "bBMhHiIqQcCeELgfd"
NUMBERS = (
    st.integers(-(1 << 65), 1 << 65)
    | st.integers(-300, 300)
    | st.floats()
    | st.floats(-1000, 1000)
    | st.integers(0, (1 << 32) - 1).map(lambda bits: np.uint32(bits).view(np.float32))
    | st.floats(-300, 300, width=32).map(np.float32)
    | st.booleans()
)


def structure_of(format: str) -> LogStructure:
    labels = ",".join(f"F{number}" for number in range(len(format)))
    return LogStructure(200, "TEST", format, labels, "-" * len(format), "-" * len(format))


@given(data=st.data(), format=st.text(NUMERIC, min_size=1, max_size=15))
def test_record_packed_at_once_is_the_one_packed_field_by_field(data: st.DataObject, format: str) -> None:
    values = data.draw(st.lists(NUMBERS, min_size=len(format), max_size=len(format)))
    with np.errstate(all="ignore"):
        with_text = structure_of(format + "n").pack([*values, "text"])  # a record with a text is packed field by field
        assert structure_of(format).pack(values) + b"text" == with_text


def test_plain_numbers_are_packed_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    values: tuple[LogValue, ...] = (1_000_000, *(np.float32(angle) for angle in range(6)), 3)
    expected = ATT.pack(values)
    monkeypatch.setattr(LogStructure, "_pack_each", lambda *_: pytest.fail("packed field by field"))
    assert ATT.pack(values) == expected
