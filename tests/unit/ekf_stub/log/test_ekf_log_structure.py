# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The layouts of the estimator's records are those that the firmware's logs describe."""

import json
import lzma
from pathlib import Path
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary

from ap_core.log_structure import LogStructure
from ekf_stub.log.ekf_log_structure import LOG_STRUCTURE_FROM_EKF3, XKFM, XKY0, XKY1
from ekf_stub.log.replay_log_structure import LOG_STRUCTURE_FROM_DAL
from tests.places import DATA, RECORDED

STRUCTURES = (*LOG_STRUCTURE_FROM_DAL, *LOG_STRUCTURE_FROM_EKF3)
FIRMWARE: dict[str, dict[str, Any]] = json.loads((DATA / "firmware_fmt.json").read_text())["types"]
# The recorded logs have been reduced, and these are not among what was kept.
NOT_RECORDED = {XKFM.name, XKY0.name, XKY1.name}


def described(structure: LogStructure) -> dict[str, object]:
    return {
        "id": structure.msg_type,
        "length": structure.length,
        "format": structure.format,
        "labels": structure.labels,
        "units": structure.units,
        "mults": structure.multipliers,
    }


def test_layouts_are_the_firmwares() -> None:
    ours = {structure.name: described(structure) for structure in STRUCTURES}
    assert {name: layout for name, layout in ours.items() if layout != FIRMWARE.get(name)}.keys() == NOT_RECORDED
    assert FIRMWARE.keys().isdisjoint(NOT_RECORDED)


def test_layout_that_no_log_shows_fits_between_its_neighbours() -> None:
    # From the firmware's specification, as no recording has it.
    assert (XKFM.msg_type, XKFM.format) == (50, "QBBffff")
    assert XKFM.labels == "TimeUS,C,OGNM,GLR,ALR,GDR,ADR"
    assert [(record.msg_type, record.format) for record in (XKY0, XKY1)] == [
        (57, "QB" + 12 * "f"),
        (58, "QB" + 10 * "f"),
    ]


def test_order_is_that_of_the_firmwares_table() -> None:
    ours = [structure.name for structure in STRUCTURES if structure.name in FIRMWARE]
    assert ours == [name for name in FIRMWARE if name in ours]
    ids = [structure.msg_type for structure in LOG_STRUCTURE_FROM_EKF3]
    assert ids == sorted(ids)


@pytest.mark.slow
def test_recorded_log_describes_the_same(tmp_path: Path) -> None:
    path = tmp_path / "voxl.BIN"
    path.write_bytes(lzma.decompress((RECORDED / "logs" / "voxl.BIN.xz").read_bytes()))
    units: dict[int, tuple[str, str]] = {}
    with DFReader_binary(str(path)) as log:
        while (record := log.recv_match(type="FMTU")) is not None:
            units[record.FmtType] = (record.UnitIds, record.MultIds)
        found = {fmt.name: (fmt.type, fmt.len, fmt.format, ",".join(fmt.columns)) for fmt in log.formats.values()}
    for structure in LOG_STRUCTURE_FROM_EKF3:
        if structure.name not in NOT_RECORDED:
            number = structure.msg_type
            assert found[structure.name] == (number, structure.length, structure.format, structure.labels)
            assert units[number] == (structure.units, structure.multipliers)
