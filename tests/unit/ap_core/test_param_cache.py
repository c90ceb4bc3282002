# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from parameters is kept until one of them changes."""

from collections.abc import Callable

import pytest

from ap_core.param import FromParams, Numbers, ParamTable
from ap_core.param_group import ParamGroup
from ap_core.param_info import ParamInfo, ParamType


def table() -> ParamTable:
    rows = (
        ParamInfo("ONE", ParamType.INT8, 1, "One"),
        ParamInfo("HALF", ParamType.FLOAT, 0.5, "A half"),
    )
    return ParamTable([ParamGroup("G_", rows)])


def test_number_is_looked_up_once_until_a_parameter_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    params = table()
    asked: list[str] = []
    look_up = params.get_number

    def get_number(name: str) -> float:
        asked.append(name)
        return look_up(name)

    monkeypatch.setattr(params, "get_number", get_number)
    numbers = Numbers(params)
    assert [numbers["G_HALF"], numbers["G_HALF"], numbers["G_ONE"]] == [0.5, 0.5, 1.0]
    assert asked == ["G_HALF", "G_ONE"]
    params.set("G_ONE", 2)
    assert [numbers["G_ONE"], numbers["G_HALF"], numbers["G_ONE"]] == [2.0, 0.5, 2.0]
    assert asked == ["G_HALF", "G_ONE", "G_ONE", "G_HALF"]


CHANGES: list[Callable[[ParamTable], object]] = [
    lambda params: params.set("G_HALF", 0.25),
    lambda params: params.set_from_mavlink("G_HALF", 0.25),
    lambda params: params.apply_defaults({"G_HALF": 0.25}, "a file"),
    lambda params: params.load_stored({"G_HALF": 0.25}),
    lambda params: params.groups[0].set("HALF", 0.25),
]


@pytest.mark.parametrize("change", CHANGES)
def test_every_way_to_change_a_parameter_is_noticed(change: Callable[[ParamTable], object]) -> None:
    params = table()
    numbers = Numbers(params)
    assert numbers["G_HALF"] == 0.5
    change(params)
    assert numbers["G_HALF"] == 0.25


def test_numbers_of_a_group_are_asked_for_without_its_prefix() -> None:
    params = table()
    numbers = Numbers(params, "G_")
    assert numbers["HALF"] == 0.5
    params.set("G_HALF", 0.25)
    assert numbers["HALF"] == 0.25


def test_number_may_be_asked_for_by_another_name() -> None:
    assert Numbers(table(), "G_", {"QUARTERS": "HALF"})["QUARTERS"] == 0.5


def test_unknown_number_is_an_error() -> None:
    with pytest.raises(ValueError, match="NO_SUCH"):
        Numbers(table())["NO_SUCH"]


def test_value_is_worked_out_at_first_use_and_again_after_a_change() -> None:
    params = table()
    worked_out: list[float] = []

    def work_out() -> float:
        worked_out.append(params.get_number("G_ONE"))
        return 10 * worked_out[-1]

    value = FromParams(params, work_out)
    assert worked_out == []
    assert [value(), value()] == [10, 10]
    assert worked_out == [1]
    params.set("G_ONE", 3)
    assert [value(), value()] == [30, 30]
    assert worked_out == [1, 3]


def test_value_may_be_nothing() -> None:
    params = table()
    worked_out: list[int] = []
    value = FromParams(params, lambda: worked_out.append(1))
    value()
    value()
    assert worked_out == [1]
