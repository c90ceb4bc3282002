# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns become the bytes that the record writer makes of each row."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_packing import Part, pack_columns, write_log
from ap_core.log_structure import COMMON_STRUCTURES, EV, FMT, MODE, MSG, PARM, LogStructure

NUMBERS = "bBMhHiIqQcCeELgfd"
INTEGERS = {
    **{
        char: (bits, True)
        for char, bits in (("b", 8), ("h", 16), ("c", 16), ("i", 32), ("e", 32), ("L", 32), ("q", 64))
    },
    **{
        char: (bits, False)
        for char, bits in (("B", 8), ("M", 8), ("H", 16), ("C", 16), ("I", 32), ("E", 32), ("Q", 64))
    },
}
EDGES = [0.0, -0.0, 1.5, -1.5, 65504.0, 65520.0, 1e30, -1e30, 2.0**31, -(2.0**31), 2.0**63, -(2.0**63), 0.07, 214748.36]


def structure_of(format: str) -> LogStructure:
    labels = ",".join("ABCDEFGHIJKLMNOP"[: len(format)])
    return LogStructure(200, "OWN", format, labels, "-" * len(format), "-" * len(format))


def packed_each(structure: LogStructure, rows: Sequence[Sequence[Any]]) -> bytes:
    return b"".join(structure.pack(row) for row in rows)


@given(data=st.data(), count=st.integers(0, 12))
def test_integers_are_stored_raw(data: st.DataObject, count: int) -> None:
    format = data.draw(st.text(st.sampled_from(NUMBERS), min_size=1, max_size=8))
    rows = data.draw(
        st.lists(st.tuples(*[st.integers(-(2**63), 2**63 - 1)] * len(format)), min_size=count, max_size=count)
    )
    columns = np.array(rows, np.int64).reshape(count, len(format)).T
    structure = structure_of(format)
    assert pack_columns(structure, list(columns)).tobytes() == packed_each(structure, rows)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@settings(max_examples=60)
@given(data=st.data(), char=st.sampled_from(NUMBERS))
def test_floats_are_physical_values(kind: type[np.floating], data: st.DataObject, char: str) -> None:
    values = data.draw(st.lists(st.floats(width=32) | st.sampled_from(EDGES) | st.floats(), max_size=12))
    with np.errstate(over="ignore"):
        column = np.array(values).astype(kind)
    structure = structure_of(char)
    rows = [(value,) for value in (column if kind is np.float32 else column.tolist())]
    assert pack_columns(structure, [column]).tobytes() == packed_each(structure, rows)


@given(texts=st.lists(st.text(max_size=20) | st.sampled_from(["a\0b", "ä" * 40]), max_size=8))
def test_texts_end_at_their_first_nul_and_are_cut(texts: list[str]) -> None:
    structure = structure_of("nNZ")
    column = np.array(texts, object).astype(str)
    # numpy drops NULs at the end, as a text field does.
    expected = packed_each(structure, [(text,) * 3 for text in texts])
    assert pack_columns(structure, [column] * 3).tobytes() == expected


def test_bytes_are_kept_whole() -> None:
    structure = structure_of("n")
    column = np.array([b"a\0bcde"], "S8")
    assert pack_columns(structure, [column]).tobytes() == structure.pack((b"a\0bcde",))


def test_rows_of_numbers_fill_an_array_field() -> None:
    rows = np.arange(64, dtype=np.int16).reshape(2, 32)
    structure = structure_of("Ba")
    expected = packed_each(structure, [(number, row.tobytes()) for number, row in enumerate(rows)])
    assert pack_columns(structure, [np.arange(2), rows]).tobytes() == expected


def test_signalling_nan_keeps_its_bits() -> None:
    column = np.array([0x7FA00001], np.uint32).view(np.float32)
    assert pack_columns(structure_of("f"), [column]).tobytes()[3:] == bytes.fromhex("0100a07f")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ([np.zeros(2)], "2 columns of one length"),
        ([np.zeros(2), np.zeros(3)], "2 columns of one length"),
        ([np.zeros(2), np.zeros(2)], "OWN.B: numbers in a text field"),
        ([np.array(["a", "b"]), np.array(["a", "b"])], "OWN.A: text in a numeric field"),
    ],
)
def test_columns_that_do_not_fit_are_refused(columns: list[Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pack_columns(structure_of("BN"), columns)


OWN = LogStructure(200, "OWN", "Bf", "A,B", "--", "--")
TYPES = (EV, MSG, PARM, OWN, MODE)


def rows_of(structure: LogStructure, time_us: int, rng: np.random.Generator) -> tuple[Any, ...]:
    number, value = int(rng.integers(0, 200)), float(np.float32(rng.normal()))
    return {
        "EV": (time_us, number),
        "MSG": (time_us, f"text {number}"),
        "PARM": (time_us, f"NAME_{number}", value, value),
        "OWN": (number, value),
        "MODE": (time_us, number, number, number),
    }[structure.name]


@given(kinds=st.lists(st.sampled_from(TYPES), max_size=30), seed=st.integers(0, 2**32 - 1), begun=st.booleans())
def test_log_of_several_types_is_that_of_the_record_writer(kinds: list[LogStructure], seed: int, begun: bool) -> None:
    rng = np.random.default_rng(seed)
    rows = [(kind, rows_of(kind, 1000 + 7 * place, rng)) for place, kind in enumerate(kinds)]
    parts = []
    for kind in TYPES:
        places = [place for place, row in enumerate(rows) if row[0] is kind]
        columns = [np.array(column) for column in zip(*(rows[place][1] for place in places), strict=True)]
        if places:
            parts.append(Part(kind, np.array(places), pack_columns(kind, columns)))
    ours, theirs = (DataFlashWriter((*COMMON_STRUCTURES, OWN)) for _ in range(2))
    if begun:
        assert ours.record(EV, (5, 1)) == theirs.record(EV, (5, 1))
    assert write_log(ours, parts) == b"".join(theirs.record(kind, values) for kind, values in rows)
    # The writer goes on as if it had written each record itself.
    assert ours.record(OWN, (1, 2.0)) == theirs.record(OWN, (1, 2.0))
    assert ours.record(FMT, (1, 2, "X", "B", "A")) == theirs.record(FMT, (1, 2, "X", "B", "A"))


def test_type_that_is_not_registered_is_refused() -> None:
    part = Part(OWN, np.arange(1), pack_columns(OWN, [np.zeros(1), np.zeros(1)]))
    with pytest.raises(ValueError, match="not registered"):
        write_log(DataFlashWriter(COMMON_STRUCTURES), [part])
