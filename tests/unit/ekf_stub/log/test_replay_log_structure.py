# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layouts of the frames' records are the firmware's, and pack as all others do."""

import json
from collections.abc import Sequence
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ekf_stub.log.replay_log_structure import LOG_STRUCTURE_OF_FRAMES, RISI, FrameStructure
from tests.places import DATA

FIRMWARE_FMT = DATA / "firmware_fmt.json"

WIDE = FrameStructure(1, "TEST", "QIiHBff", "A,B,C,D,E,F,G", "-------", "-------")
ORDINARY = LogStructure(*astuple(WIDE))


@pytest.fixture(scope="module")
def recorded() -> dict[str, dict[str, Any]]:
    types: dict[str, dict[str, Any]] = json.loads(FIRMWARE_FMT.read_text())["types"]
    return types


@pytest.mark.parametrize("structure", LOG_STRUCTURE_OF_FRAMES, ids=lambda structure: structure.name)
def test_layout_is_the_recorded_one(structure: LogStructure, recorded: dict[str, dict[str, Any]]) -> None:
    assert recorded[structure.name] == {
        "id": structure.msg_type,
        "length": structure.length,
        "format": structure.format,
        "labels": structure.labels,
        "units": structure.units,
        "mults": structure.multipliers,
    }


def test_order_is_that_of_the_recorded_formats(recorded: dict[str, dict[str, Any]]) -> None:
    names = [structure.name for structure in LOG_STRUCTURE_OF_FRAMES]
    assert names == [name for name in recorded if name.startswith("R") and name != "RFND"][: len(names)]


def test_format_means_the_same_to_both_ways_of_packing() -> None:
    assert {char for structure in LOG_STRUCTURE_OF_FRAMES for char in structure.format} <= set(WIDE.format)


@given(
    values=st.lists(
        st.integers() | st.booleans() | st.floats() | st.floats(width=32).map(np.float32), min_size=7, max_size=7
    )
)
def test_any_numbers_are_packed_as_in_other_records(values: Sequence[LogValue]) -> None:
    assert WIDE.pack(values) == ORDINARY.pack(values)


@pytest.mark.parametrize("values", [(), (*(0.0,) * 8, 0, "x"), (*(0.0,) * 7, "x", 0, 0)])
def test_values_that_make_no_record_are_refused(values: tuple[LogValue, ...]) -> None:
    with pytest.raises(ValueError, match=r"RISI: "):
        RISI.pack(values)
