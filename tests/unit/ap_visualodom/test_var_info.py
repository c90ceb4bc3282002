# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The VISO_ parameters as ground stations see them."""

import pytest

from ap_core.param import ParamFlag, ParamTable, ParamType
from ap_visualodom.ap_visualodom import make_params
from ap_visualodom.var_info import VAR_INFO

ROWS = {row.name: row for row in VAR_INFO}


def test_parameters_are_in_the_firmwares_order() -> None:
    assert tuple(ROWS) == (
        *("_TYPE", "_POS", "_ORIENT", "_SCALE", "_DELAY_MS"),
        *("_VEL_M_NSE", "_POS_M_NSE", "_YAW_M_NSE", "_QUAL_MIN"),
    )


@pytest.mark.parametrize(
    ("name", "kind", "default"),
    [
        ("_TYPE", ParamType.INT8, 0),
        ("_POS", ParamType.VECTOR3F, (0, 0, 0)),
        ("_ORIENT", ParamType.INT8, 0),
        ("_SCALE", ParamType.FLOAT, 1),
        ("_DELAY_MS", ParamType.INT16, 10),
        ("_VEL_M_NSE", ParamType.FLOAT, 0.1),
        ("_POS_M_NSE", ParamType.FLOAT, 0.2),
        ("_YAW_M_NSE", ParamType.FLOAT, 0.2),
        ("_QUAL_MIN", ParamType.INT8, 0),
    ],
)
def test_type_and_default(name: str, kind: ParamType, default: object) -> None:
    assert (ROWS[name].type, ROWS[name].default) == (kind, default)


@pytest.mark.parametrize(
    ("name", "unit", "limits"),
    [
        ("_TYPE", "", None),
        ("_POS", "m", (-5, 5)),
        ("_ORIENT", "", None),
        ("_SCALE", "", None),
        ("_DELAY_MS", "ms", (0, 250)),
        ("_VEL_M_NSE", "m/s", (0.05, 5)),
        ("_POS_M_NSE", "m", (0.1, 10)),
        ("_YAW_M_NSE", "rad", (0.05, 1)),
        ("_QUAL_MIN", "%", (-1, 100)),
    ],
)
def test_unit_and_documented_range(name: str, unit: str, limits: tuple[float, float] | None) -> None:
    assert (ROWS[name].unit, ROWS[name].range) == (unit, limits)


def test_documented_types() -> None:
    assert ROWS["_TYPE"].values == {0: "None", 1: "MAVLink", 2: "IntelT265", 3: "VOXL(ModalAI)"}


def test_documented_orientations() -> None:
    assert ROWS["_ORIENT"].values == {0: "Forward", 2: "Right", 4: "Back", 6: "Left", 24: "Up", 25: "Down"}


def test_type_alone_enables_the_group_and_takes_effect_at_boot() -> None:
    assert [name for name, row in ROWS.items() if ParamFlag.ENABLE in row.flags] == ["_TYPE"]
    assert [name for name, row in ROWS.items() if row.reboot_required] == ["_TYPE"]


def test_only_the_type_is_listed_while_it_is_none() -> None:
    assert [param.name for param in ParamTable([make_params()])] == ["VISO_TYPE"]


def test_whole_group_is_listed_once_a_type_is_set() -> None:
    params = make_params()
    params.set("_TYPE", 1)
    assert [param.name for param in ParamTable([params])] == [
        *("VISO_TYPE", "VISO_POS_X", "VISO_POS_Y", "VISO_POS_Z", "VISO_ORIENT", "VISO_SCALE", "VISO_DELAY_MS"),
        *("VISO_VEL_M_NSE", "VISO_POS_M_NSE", "VISO_YAW_M_NSE", "VISO_QUAL_MIN"),
    ]


def test_value_outside_the_documented_range_is_stored() -> None:
    params = make_params()
    params.set("_DELAY_MS", 30_000)
    assert params.get_int("_DELAY_MS") == 30_000


def test_vehicles_do_not_share_values() -> None:
    first, second = make_params(), make_params()
    first.set("_TYPE", 2)
    assert second.get_int("_TYPE") == 0
