# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stream of records: order, self-description, run-time types; read back with pymavlink."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

from ap_core.dataflash import DataFlashWriter, ParameterRecord
from ap_core.log_structure import (
    ARM,
    ATT,
    COMMON_STRUCTURES,
    EV,
    FMT,
    FMTU,
    MSG,
    MULTIPLIERS,
    ORGN,
    PARM,
    UNIT,
    UNITS,
    LogStructure,
)

PARAMETERS: list[ParameterRecord] = [
    ("VISO_TYPE", np.float32(1), np.float32(0)),
    ("VISO_POS_M_NSE", np.float32(0.2), np.float32(0.2)),
]
LENGTHS = {each.msg_type: each.length for each in COMMON_STRUCTURES}
NAMES = {each.msg_type: each.name for each in COMMON_STRUCTURES}


@pytest.fixture
def writer() -> DataFlashWriter:
    return DataFlashWriter(COMMON_STRUCTURES)


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Split a log into ids and bodies, as a reader without any resynchronisation."""
    lengths = LENGTHS.copy()
    while data:
        assert data[:2] == b"\xa3\x95"
        length = lengths[data[2]]
        yield data[2], data[3:length]
        if data[2] == FMT.msg_type:
            lengths[data[3]] = data[4]
        data = data[length:]


def outline(data: bytes) -> list[str]:
    """Name each record; FMT and FMTU with the type that they describe."""
    described = []
    names = NAMES.copy()
    for msg_type, body in records(data):
        if msg_type == FMT.msg_type:
            names[body[0]] = body[2:6].rstrip(b"\0").decode()
            described.append(f"FMT({names[body[0]]})")
        elif msg_type == FMTU.msg_type:
            described.append(f"FMTU({names[body[8]]})")
        else:
            described.append(names[msg_type])
    return described


def start_up(writer: DataFlashWriter, time_us: int = 5) -> bytes:
    return b"".join(writer.start_up(PARAMETERS, time_us=time_us))


def read(tmp_path: Path, data: bytes) -> tuple[Any, list[Any]]:
    path = tmp_path / "00000001.BIN"
    path.write_bytes(data)
    reader = DFReader_binary(str(path))
    messages = []
    while (message := reader.recv_msg()) is not None:
        messages.append(message)
    reader.filehandle.close()
    return reader, messages


def test_log_begins_with_the_format_that_describes_itself(writer: DataFlashWriter) -> None:
    assert start_up(writer)[:9] == bytes.fromhex("a395808059464d5400")


def test_start_up_writes_formats_parameters_units_multipliers_and_format_units(
    writer: DataFlashWriter,
) -> None:
    names = [each.name for each in COMMON_STRUCTURES]
    assert outline(start_up(writer)) == (
        [f"FMT({name})" for name in names]
        + ["PARM"] * len(PARAMETERS)
        + ["UNIT"] * 38
        + ["MULT"] * 15
        + [f"FMTU({name})" for name in names]
    )


# The order is that of the recorded firmware log bench_steps.BIN, which begins with a record before start-up.
def test_first_record_before_start_up_brings_its_description_along(writer: DataFlashWriter) -> None:
    assert outline(writer.record(EV, (7, 10))) == [
        "FMT(FMT)",
        "FMT(FMTU)",
        "FMTU(FMTU)",
        "FMTU(FMT)",
        "FMT(EV)",
        "FMTU(EV)",
        "EV",
    ]


def test_later_types_bring_only_their_own_description(writer: DataFlashWriter) -> None:
    writer.record(EV, (7, 10))
    assert outline(writer.record(MSG, (8, "hello"))) == ["FMT(MSG)", "FMTU(MSG)", "MSG"]


def test_described_types_are_written_alone(writer: DataFlashWriter) -> None:
    writer.record(EV, (7, 10))
    assert writer.record(EV, (8, 11)) == EV.pack((8, 11))


def test_start_up_omits_formats_already_written_and_repeats_their_units(writer: DataFlashWriter) -> None:
    early = writer.record(EV, (7, 10))
    block = outline(early + start_up(writer))[7:]
    assert [each for each in block if each in ("FMT(FMT)", "FMT(FMTU)", "FMT(EV)")] == []
    assert [each for each in block if each in ("FMTU(FMT)", "FMTU(FMTU)", "FMTU(EV)")] == [
        "FMTU(FMT)",
        "FMTU(FMTU)",
        "FMTU(EV)",
    ]


def test_record_in_the_middle_of_the_formats_brings_what_start_up_has_not_reached(
    writer: DataFlashWriter,
) -> None:
    block = writer.start_up(PARAMETERS, time_us=5)
    data = next(block) + next(block) + writer.record(EV, (7, 10)) + b"".join(block)
    names = outline(data)
    assert names[:7] == ["FMT(FMT)", "FMT(UNIT)", "FMT(EV)", "FMT(FMTU)", "FMTU(FMTU)", "FMTU(EV)", "EV"]
    assert names.count("FMT(EV)") == names.count("FMT(FMTU)") == 1


def test_record_after_the_formats_interleaves_without_description(writer: DataFlashWriter) -> None:
    block = writer.start_up(PARAMETERS, time_us=5)
    for _ in COMMON_STRUCTURES:
        next(block)
    assert writer.record(EV, (7, 10)) == EV.pack((7, 10))


def test_format_units_written_directly_are_described_once(writer: DataFlashWriter) -> None:
    record = writer.record(FMTU, (7, EV.msg_type, EV.units, EV.multipliers))
    assert outline(record) == ["FMT(FMT)", "FMT(FMTU)", "FMTU(FMTU)", "FMTU(FMT)", "FMTU(EV)"]


def test_new_log_describes_types_again(writer: DataFlashWriter) -> None:
    first = writer.record(EV, (7, 10))
    writer.new_log()
    assert writer.record(EV, (7, 10)) == first


def format_unit_times(data: bytes) -> set[int]:
    return {struct.unpack("<Q", body[:8])[0] for msg_type, body in records(data) if msg_type == FMTU.msg_type}


def test_format_units_carry_the_time_of_the_record(writer: DataFlashWriter) -> None:
    assert format_unit_times(writer.record(EV, (123, 10))) == {123}


def test_format_units_carry_the_latest_time_when_the_record_has_none() -> None:
    untimed = LogStructure(134, "REV3", "B", "Event", "-", "-")
    writer = DataFlashWriter((*COMMON_STRUCTURES, untimed))
    writer.record(EV, (99, 10))
    assert format_unit_times(writer.record(untimed, (1,))) == {99}


def test_format_units_carry_the_time_that_is_given(writer: DataFlashWriter) -> None:
    assert format_unit_times(writer.record(EV, (123, 10), time_us=120)) == {120}


def test_records_of_the_start_up_have_the_time_that_is_given(writer: DataFlashWriter) -> None:
    data = b"".join(writer.start_up(PARAMETERS, time_us=1000))
    times = [struct.unpack("<Q", body[:8])[0] for msg_type, body in records(data) if msg_type != FMT.msg_type]
    assert times == [1000] * len(times)


def test_changed_parameter_has_no_default(writer: DataFlashWriter) -> None:
    start_up(writer)
    record = writer.parameter("VISO_TYPE", np.float32(2), time_us=9)
    assert record == PARM.pack((9, "VISO_TYPE", 2.0, 0.0))[:-4] + bytes.fromhex("5241c07f")


def test_unregistered_type_is_refused(writer: DataFlashWriter) -> None:
    with pytest.raises(ValueError, match="'TEST' is not registered"):
        writer.record(LogStructure(1, "TEST", "B", "A", "-", "-"), (1,))


def test_values_that_do_not_fit_leave_the_type_undescribed(writer: DataFlashWriter) -> None:
    with pytest.raises(ValueError, match="EV"):
        writer.record(EV, (1,))
    assert outline(writer.record(EV, (7, 10)))[0] == "FMT(FMT)"


@pytest.mark.parametrize(
    ("structures", "problem"),
    [
        ((), "must begin with FMT"),
        ((UNIT, *(each for each in COMMON_STRUCTURES if each != UNIT)), "must begin with FMT"),
        ((FMT, UNIT, PARM), "lack FMTU, MULT"),
        ((*COMMON_STRUCTURES, EV), "share an id or a name"),
        ((*COMMON_STRUCTURES, LogStructure(1, "EV", "B", "A", "-", "-")), "share an id or a name"),
        ((*COMMON_STRUCTURES, LogStructure(181, "EV2", "B", "A", "-", "-")), "share an id or a name"),
    ],
)
def test_incomplete_or_ambiguous_structures_are_refused(structures: tuple[LogStructure, ...], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        DataFlashWriter(structures)


def test_run_time_types_get_ids_from_254_downwards(writer: DataFlashWriter) -> None:
    names = ("TSYN", "NVAL", "AUXF")
    assert [writer.define(name, "TimeUS,V", "Qf").msg_type for name in names] == [254, 253, 252]


def test_run_time_types_pass_over_ids_in_use() -> None:
    taken = LogStructure(254, "TAKE", "B", "A", "-", "-")
    assert DataFlashWriter((*COMMON_STRUCTURES, taken)).define("TSYN", "TimeUS,V", "Qf").msg_type == 253


def test_run_time_type_is_described_before_its_first_record(writer: DataFlashWriter) -> None:
    start_up(writer)
    tsyn = writer.define("TSYN", "TimeUS,SysID,RTT", "QBQ", "s-s", "F-F")
    assert outline(writer.record(tsyn, (1, 2, 3))) == ["FMT(TSYN)", "FMTU(TSYN)", "TSYN"]


def test_run_time_types_keep_their_ids_in_the_next_log(writer: DataFlashWriter) -> None:
    first = writer.define("TSYN", "TimeUS,V", "Qf")
    writer.new_log()
    assert writer.define("TSYN", "TimeUS,V", "Qf") is first


def test_defining_a_name_again_with_another_layout_is_refused(writer: DataFlashWriter) -> None:
    writer.define("TSYN", "TimeUS,V", "Qf")
    with pytest.raises(ValueError, match="'TSYN' is defined already"):
        writer.define("TSYN", "TimeUS,W", "Qf")


def test_defining_the_name_of_a_fixed_type_is_refused(writer: DataFlashWriter) -> None:
    with pytest.raises(ValueError, match="'EV' is defined already"):
        writer.define("EV", EV.labels, EV.format, EV.units, EV.multipliers)


def test_defining_an_invalid_layout_takes_no_id(writer: DataFlashWriter) -> None:
    with pytest.raises(ValueError, match="format"):
        writer.define("BAD", "A", "x")
    assert writer.define("TSYN", "TimeUS,V", "Qf").msg_type == 254


def test_running_out_of_ids_is_refused() -> None:
    free = [each for each in range(255) if each not in LENGTHS]
    others = [LogStructure(each, f"T{each}", "B", "A", "-", "-") for each in free if each != 0]
    with pytest.raises(ValueError, match="no message id is left"):
        DataFlashWriter((*COMMON_STRUCTURES, *others)).define("TSYN", "TimeUS,V", "Qf")


@pytest.mark.parametrize(
    ("labels", "units", "multipliers", "expected"),
    [
        ("TimeUS,V", None, None, ("s?", "F?")),
        ("Time,V", None, None, ("??", "??")),
        ("TimeUS,V", "-m", None, ("sm", "F?")),
        ("TimeUS,V", None, "-0", ("??", "-0")),
        ("TimeUS,V", "sm", "F0", ("sm", "F0")),
    ],
)
def test_units_left_out_become_unknown(
    writer: DataFlashWriter,
    labels: str,
    units: str | None,
    multipliers: str | None,
    expected: tuple[str, str],
) -> None:
    made = writer.define("TEST", labels, "Qf", units, multipliers)
    assert (made.units, made.multipliers) == expected


def test_reader_gets_the_values_back(writer: DataFlashWriter, tmp_path: Path) -> None:
    angles = [np.float32(value) for value in (0.1, -1.5, 2.25, 3.5, 359.5, 180.25)]
    data = start_up(writer) + writer.record(ATT, (1_000_000, *angles, 3))
    _, messages = read(tmp_path, data)
    attitude = messages[-1]
    assert [getattr(attitude, name) for name in ATT.fields] == [1_000_000, *map(float, angles), 3]


def test_reader_scales_by_format_character(writer: DataFlashWriter, tmp_path: Path) -> None:
    data = start_up(writer) + writer.record(ORGN, (1, 0, -353632621, 1491652374, 584.25))
    origin = read(tmp_path, data)[1][-1]
    assert (origin.Lat, origin.Lng, origin.Alt) == (-35.3632621, 149.1652374, 584.25)


def test_reader_resolves_units_of_every_type(writer: DataFlashWriter, tmp_path: Path) -> None:
    reader, _ = read(tmp_path, start_up(writer))
    labels = dict(UNITS)
    for ours in COMMON_STRUCTURES:
        found = reader.formats[ours.msg_type].units
        assert [bool(unit) for unit in found] == [bool(labels[char]) for char in ours.units]


def test_reader_names_units_with_multipliers(writer: DataFlashWriter, tmp_path: Path) -> None:
    reader, _ = read(tmp_path, start_up(writer))
    assert reader.formats[ORGN.msg_type].units == ["µs", "instance", "deglatitude", "deglongitude", "m"]


def test_reader_knows_all_units_and_multipliers(writer: DataFlashWriter, tmp_path: Path) -> None:
    reader, _ = read(tmp_path, start_up(writer))
    assert reader.unit_lookup == dict(UNITS)
    assert reader.mult_lookup == pytest.approx(dict(MULTIPLIERS))


def test_reader_finds_the_instance_field(writer: DataFlashWriter, tmp_path: Path) -> None:
    data = start_up(writer) + writer.record(ORGN, (1, 1, 0, 0, 0.0))
    reader, _ = read(tmp_path, data)
    assert reader.formats[ORGN.msg_type].instance_field == "Type"
    assert reader.messages["ORGN[1]"].Type == 1


def test_reader_collects_parameters_and_defaults(writer: DataFlashWriter, tmp_path: Path) -> None:
    data = start_up(writer) + writer.parameter("VISO_TYPE", 2.0, time_us=9)
    reader, messages = read(tmp_path, data)
    assert reader.params["VISO_TYPE"] == 2.0
    assert "Default : qnan" in str(messages[-1])


def test_reader_understands_types_described_on_demand(writer: DataFlashWriter, tmp_path: Path) -> None:
    early = writer.record(ARM, (3, 1, 0xFFFFFFFF, 0, 1))
    tsyn = writer.define("TSYN", "TimeUS,SysID,RTT", "QBQ", "s-s", "F-F")
    reader, messages = read(tmp_path, early + start_up(writer) + writer.record(tsyn, (4, 255, 1 << 40)))
    arm = next(each for each in messages if each.get_type() == "ARM")
    assert (arm.ArmChecks, messages[-1].RTT) == (0xFFFFFFFF, 1 << 40)
    assert reader.formats[tsyn.msg_type].units == ["µs", "", "µs"]
