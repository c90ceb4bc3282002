# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layouts of VISO, VISP and VISV."""

import pytest

from ap_core.log_structure import LogStructure
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM, VISO, VISP, VISV


@pytest.mark.parametrize(
    ("structure", "expected"),
    [
        (
            VISO,
            (
                0xA7,
                "VISO",
                "Qffffffff",
                "TimeUS,dt,AngDX,AngDY,AngDZ,PosDX,PosDY,PosDZ,conf",
                "ssrrrmmm-",
                "FF000000-",
            ),
        ),
        (
            VISP,
            (
                0xA8,
                "VISP",
                "QQIffffffffBBb",
                "TimeUS,RTimeUS,CTimeMS,PX,PY,PZ,R,P,Y,PErr,AErr,Rst,Ign,Q",
                "sssmmmddhmd--%",
                "FFC00000000--0",
            ),
        ),
        (
            VISV,
            (0xA9, "VISV", "QQIffffBBb", "TimeUS,RTimeUS,CTimeMS,VX,VY,VZ,VErr,Rst,Ign,Q", "sssnnnn--%", "FFC0000--0"),
        ),
    ],
)
def test_layout_is_the_firmwares(structure: LogStructure, expected: tuple[int, str, str, str, str, str]) -> None:
    assert (
        structure.msg_type,
        structure.name,
        structure.format,
        structure.labels,
        structure.units,
        structure.multipliers,
    ) == expected


@pytest.mark.parametrize(("structure", "length"), [(VISO, 43), (VISP, 58), (VISV, 42)])
def test_length_of_a_record(structure: LogStructure, length: int) -> None:
    assert structure.length == length


def test_library_has_three_records() -> None:
    assert LOG_STRUCTURE_FROM_VISUALODOM == (VISO, VISP, VISV)
