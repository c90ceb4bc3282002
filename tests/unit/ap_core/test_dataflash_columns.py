# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs read as columns hold what pymavlink's DFReader reads record by record, and tell what is lost of damaged ones."""

import array
import lzma
import math
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.DFReader import DFReader_binary

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_columns import LogColumns
from ap_core.dataflash_scan import CUT_SHORT, NO_HEADER, Lost
from ap_core.log_structure import COMMON_STRUCTURES, EV, FMT, MSG, LogStructure
from tests.places import PARITY

RECORDED = sorted(PARITY.glob("*/logs/*.BIN.xz"))
HEAD_RECORDS, TAIL_RECORDS = 6000, 1500
SIZES = dict(
    zip("abBMhHiIqQcCeELgfdnNZ", (64, 1, 1, 1, 2, 2, 4, 4, 8, 8, 2, 2, 4, 4, 4, 2, 4, 8, 4, 16, 64), strict=True)
)


def read_by_dfreader(data: bytes) -> tuple[Any, list[Any]]:
    with tempfile.NamedTemporaryFile(suffix=".BIN") as file:
        file.write(data)
        file.flush()
        with DFReader_binary(file.name) as log:
            records = []
            while (record := log.recv_msg()) is not None:
                records.append(record)
            return log, records


def is_same(ours: Any, theirs: Any) -> bool:
    if isinstance(theirs, array.array):
        return list(ours) == list(theirs)
    if isinstance(theirs, float):
        both_nan = math.isnan(theirs) and math.isnan(ours)
        return both_nan or (ours == theirs and math.copysign(1, ours) == math.copysign(1, theirs))
    return type(ours) is type(theirs) and bool(ours == theirs)


def assert_read_alike(data: bytes) -> LogColumns:
    """Compare the order of records, every field of each, and the units."""
    log, records = read_by_dfreader(data)
    columns = LogColumns(data)
    names = {layout.msg_type: name for name, layout in columns.types.items()}
    assert [names[number] for number in columns.sequence.tolist()] == [record.get_type() for record in records]
    by_type = defaultdict(list)
    for record in records:
        by_type[record.get_type()].append(record)
    assert dict(columns.counts) == {name: len(found) for name, found in by_type.items()}
    for name, found in by_type.items():
        for label, values in columns.columns(name).items():
            pairs = zip(values.tolist(), found, strict=True)
            different = [(ours, getattr(one, label)) for ours, one in pairs if not is_same(ours, getattr(one, label))]
            assert different == [], f"{name}.{label}"
        layout = log.formats[columns.types[name].msg_type]
        assert columns.units(name) == {label: layout.get_unit(label) for label in layout.columns}
    return columns


def beginning_and_end(data: bytes, head: int, tail: int) -> bytes:
    begins = LogColumns(data).begins
    return data[: int(begins[head])] + data[int(begins[-tail]) :]


def test_recorded_log_is_read_as_by_dfreader() -> None:
    log = next(path for path in RECORDED if path.name == "bench_no_yaw_source.BIN.xz")
    columns = assert_read_alike(beginning_and_end(lzma.decompress(log.read_bytes()), 4000, 300))
    assert columns.lost == ()
    assert len(columns) == 4300


@pytest.mark.slow
@pytest.mark.parametrize("log", RECORDED, ids=lambda path: path.name.split(".")[0])
def test_every_recorded_log_is_read_as_by_dfreader(log: Path) -> None:
    data = lzma.decompress(log.read_bytes())
    assert LogColumns(data).lost == ()
    assert_read_alike(beginning_and_end(data, HEAD_RECORDS, TAIL_RECORDS))


def fmt_record(structure: tuple[int, str, str, str], length: int | None = None) -> bytes:
    msg_type, name, format, labels = structure
    length = 3 + sum(SIZES[char] for char in format) if length is None else length
    return FMT.pack((msg_type, length, name, format, labels))


FORMATS = st.text(st.sampled_from("".join(SIZES)), min_size=1, max_size=9).filter(
    lambda text: sum(SIZES[char] for char in text) <= 252
)
LETTERS = "ABCDEFGHIJ"


@st.composite
def made_logs(draw: st.DrawFn) -> tuple[bytes, int]:
    """Draw a log of any types and bytes; return it, and where its FMT records end."""
    formats = draw(st.lists(FORMATS, min_size=1, max_size=4))
    types = [(number, f"T{number}", one, ",".join(LETTERS[: len(one)])) for number, one in enumerate(formats, start=3)]
    described = fmt_record((128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")) + b"".join(map(fmt_record, types))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    records = []
    for _ in range(draw(st.integers(0, 30))):
        number, _, one, _ = types[rng.integers(0, len(types))]
        body = rng.integers(0, 256, sum(SIZES[char] for char in one), np.uint8)
        body[rng.random(len(body)) < 0.3] = 0
        records.append(bytes((0xA3, 0x95, number)) + body.tobytes())
    return described + b"".join(records), len(described)


@pytest.mark.slow
@settings(max_examples=60)
@given(made=made_logs())
def test_any_log_is_read_as_by_dfreader(made: tuple[bytes, int]) -> None:
    assert assert_read_alike(made[0]).lost == ()


DAMAGE = st.sampled_from(["change", "remove", "insert", "zero", "cut", "header"])


def damaged(data: bytes, begin: int, kinds: list[str], seed: int) -> bytes:
    rng = np.random.default_rng(seed)
    for kind in kinds:
        at = int(rng.integers(begin, max(len(data), begin + 1)))
        length = int(rng.integers(1, 60))
        put = {
            "change": bytes(rng.integers(0, 256, 1, np.uint8)),
            "insert": bytes(rng.integers(0, 256, length, np.uint8)),
            "zero": bytes(length),
            "header": bytes((0xA3, 0x95, int(rng.integers(0, 8)))),
        }.get(kind, b"")
        over = {"change": 1, "remove": length, "zero": length, "cut": len(data)}.get(kind, 0)
        data = data[:at] + put + data[at + over :]
    return data


@pytest.mark.slow
@settings(max_examples=100)
@given(made=made_logs(), kinds=st.lists(DAMAGE, min_size=1, max_size=4), seed=st.integers(0, 2**32 - 1))
def test_damaged_log_is_read_on_where_dfreader_does(made: tuple[bytes, int], kinds: list[str], seed: int) -> None:
    data = damaged(*made, kinds, seed)
    columns = assert_read_alike(data)
    lost = sum(one.size for one in columns.lost)
    assert lost + sum(columns.types[name].dtype.itemsize * count for name, count in columns.counts.items()) == len(data)


@given(data=st.binary(max_size=200))
def test_bytes_that_are_no_log_are_all_lost(data: bytes) -> None:
    columns = LogColumns(data)
    assert len(columns) == 0 or columns.counts.keys() == {"FMT"}
    assert sum(one.size for one in columns.lost) + 89 * len(columns) == len(data)


@pytest.fixture
def log() -> bytes:
    writer = DataFlashWriter(COMMON_STRUCTURES)
    return b"".join(writer.start_up([("A", 1.0, 2.0)], time_us=5)) + EV.pack((7, 10)) + MSG.pack((8, "good morning"))


def test_bytes_without_a_header_are_lost_with_their_place(log: bytes) -> None:
    columns = LogColumns(log + b"nonsense" + EV.pack((9, 11)))
    assert columns.lost == (Lost(len(log), 8, NO_HEADER),)
    assert columns.columns("EV")["Id"].tolist() == [10, 11]


def test_record_that_the_log_ends_in_is_lost(log: bytes) -> None:
    columns = LogColumns(log + EV.pack((9, 11))[:-1])
    assert columns.lost == (Lost(len(log), 11, CUT_SHORT),)
    assert columns.counts["EV"] == 1


def test_record_of_an_unknown_type_is_lost_with_its_number(log: bytes) -> None:
    columns = LogColumns(log + bytes((0xA3, 0x95, 1, 2, 3)) + EV.pack((9, 11)))
    assert columns.lost == (Lost(len(log), 5, "no FMT describes type 1"),)


@pytest.mark.parametrize(
    ("described", "reason"),
    [
        (fmt_record((9, "OWN", "Q", "A"), length=12), "the FMT of 'OWN' tells 12 bytes, and a format of 11"),
        (FMT.pack((9, 11, "OWN", "Qx", "A,B")), "unknown character 'x' in format 'Qx'"),
    ],
)
def test_records_that_their_fmt_does_not_fit_are_lost_with_the_reason(
    log: bytes, described: bytes, reason: str
) -> None:
    columns = LogColumns(log + described + bytes((0xA3, 0x95, 9)) + bytes(8))
    assert columns.lost == (Lost(len(log) + 89, 11, reason),)
    assert "OWN" not in columns.types


def test_records_on_both_sides_of_damage_are_read(log: bytes) -> None:
    own = LogStructure(200, "OWN", "QB", "TimeUS,A", "s-", "F-")
    before = fmt_record((200, "OWN", "QB", "TimeUS,A"), length=0) + own.pack((1, 2))
    described = fmt_record((200, "OWN", "QB", "TimeUS,A")) + fmt_record((9, "NONE", "Q", "A"), length=0)
    columns = LogColumns(log + before + b"nonsense" + described + own.pack((3, 4)))
    assert (columns.columns("OWN")["A"].tolist(), columns.columns("EV")["Id"].tolist()) == ([2, 4], [10])


def test_header_among_the_values_of_a_record_is_no_record(log: bytes) -> None:
    inner = EV.pack((9, 11))
    columns = LogColumns(log + MSG.pack((8, inner)) + EV.pack((10, 12)))
    assert columns.columns("EV")["TimeUS"].tolist() == [7, 10]
    assert columns.lost == ()


def test_type_that_is_described_after_its_first_record_is_read_all_the_same() -> None:
    own = LogStructure(200, "OWN", "QB", "TimeUS,A", "s-", "F-")
    before = fmt_record((128, "FMT", FMT.format, FMT.labels)) + own.pack((1, 2))
    columns = LogColumns(before + fmt_record((200, "OWN", "QB", "TimeUS,A")) + own.pack((3, 4)))
    assert columns.columns("OWN")["A"].tolist() == [2, 4]


def test_type_without_records_is_known_but_empty(log: bytes) -> None:
    columns = LogColumns(log)
    assert "ARM" in columns.types
    assert "ARM" not in columns.counts
    assert columns.columns("ARM")["TimeUS"].tolist() == []


def test_unknown_type_or_field_is_a_key_error(log: bytes) -> None:
    columns = LogColumns(log)
    with pytest.raises(KeyError):
        columns.columns("NONE")
    with pytest.raises(KeyError):
        columns.columns("EV", ["None"])
    assert columns.offsets("NONE").tolist() == []


def test_offsets_tell_the_order_among_types(log: bytes) -> None:
    columns = LogColumns(log)
    assert columns.offsets("EV")[0] < columns.offsets("MSG")[0]
    assert log[columns.offsets("MSG")[0] :] == MSG.pack((8, "good morning"))


def test_stored_records_are_the_bytes_of_the_log(log: bytes) -> None:
    assert LogColumns(log).records("EV").tobytes() == EV.pack((7, 10))


def test_label_that_is_there_twice_means_its_last_field_as_for_dfreader() -> None:
    twice = fmt_record((128, "FMT", FMT.format, FMT.labels)) + fmt_record((9, "OWN", "BBB", "A,A,B"))
    columns = LogColumns(twice + bytes((0xA3, 0x95, 9, 1, 2, 3)))
    assert {label: values.tolist() for label, values in columns.columns("OWN").items()} == {
        "(0)": [1],
        "A": [2],
        "B": [3],
    }


def test_pieces_of_files_stay_bytes() -> None:
    data = fmt_record((128, "FMT", FMT.format, FMT.labels)) + fmt_record((9, "FILE", "Z", "Data"))
    columns = LogColumns(data + bytes((0xA3, 0x95, 9)) + b"\xff\0\xfe" + bytes(61))
    assert columns.columns("FILE")["Data"].tolist() == [b"\xff\0\xfe"]


def test_signalling_nan_is_a_nan() -> None:
    data = fmt_record((128, "FMT", FMT.format, FMT.labels)) + fmt_record((9, "OWN", "f", "A"))
    columns = LogColumns(data + bytes((0xA3, 0x95, 9)) + bytes.fromhex("0100a07f"))
    assert np.isnan(columns.columns("OWN")["A"]).tolist() == [True]
