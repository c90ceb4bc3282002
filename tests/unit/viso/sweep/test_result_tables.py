# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What people and machines are told of a sweep."""

from io import StringIO

import pytest
from rich.console import Console

from tests.unit.viso.sweep.made import made_plan, made_rows
from viso.sweep.dimensions import Axis
from viso.sweep.plan import Sampling
from viso.sweep.result_tables import best_as_dict, best_lines, changed_columns, found, result_table, swept_axis

DELAY = Axis("VISO_DELAY_MS", (0.0, 10.0, 20.0, 30.0, 40.0))
GATE = Axis("EK3_POS_I_GATE", (300.0, 500.0))


def lines(plan_axes: tuple[Axis, ...] = (DELAY,), lowest: float = 22.0, imu: str = "log:a.BIN") -> list[str]:
    plan = made_plan(*plan_axes, imu=imu)
    rows = made_rows(plan, lambda delay, *_: 1 + (delay - lowest) ** 2 / 1000)
    return best_lines(plan, found(plan, rows, "nis"), "nis")


def test_minimum_is_told_with_the_age_of_samples_on_arrival() -> None:
    assert lines() == [
        "nis is least at VISO_DELAY_MS 20 (1.004); a parabola has it at 22.0. Corrected stamps are 7.5 ms before the "
        "arrival: samples arrive 29.5 ms old"
    ]


@pytest.mark.parametrize(("lowest", "age"), [
    (-50.0, "7.5 ms or less old; with --baud 0 stamps are later"),
    (90.0, "47.5 ms or more old"),
])  # fmt: skip
def test_minimum_at_the_edge_is_only_a_bound(lowest: float, age: str) -> None:
    (line,) = lines(lowest=lowest)
    assert "at the edge of what was tried" in line
    assert line.endswith(f"samples arrive {age}")


@pytest.mark.parametrize("imu", ["follow", "bench"])
def test_no_age_is_told_where_the_motion_does_not_show_it(imu: str) -> None:
    assert "old" not in lines(imu=imu)[0]


def test_other_parameters_have_no_age() -> None:
    plan = made_plan(GATE)
    (line,) = best_lines(plan, found(plan, made_rows(plan, lambda gate: gate), "nis"), "nis")
    assert line == "nis is least at EK3_POS_I_GATE 300 (300), at the edge of what was tried"


def test_plateau_is_told() -> None:
    plan = made_plan(DELAY)
    rows = made_rows(plan, lambda delay: max(abs(delay - 20), 10))
    assert "at VISO_DELAY_MS 10, and the same up to 30 (10)" in best_lines(plan, found(plan, rows, "nis"), "nis")[0]


def test_several_axes_have_no_one_minimum() -> None:
    assert swept_axis(made_plan(DELAY, GATE)) is None
    assert lines((DELAY, GATE)) == []
    assert swept_axis(made_plan(DELAY, Axis("EK3_POS_I_GATE", (300.0,)))) == "VISO_DELAY_MS"
    assert swept_axis(made_plan(Axis("VISO_SCALE", span=(0.9, 1.1)), sampling=Sampling("random", 3))) == "VISO_SCALE"


def test_each_seed_has_its_line() -> None:
    plan = made_plan(DELAY, seeds=(1, 2))
    told = best_lines(plan, found(plan, made_rows(plan, lambda delay: delay), "nis"), "nis")
    assert [line.split(":")[0] for line in told] == ["seed 1", "seed 2"]


def test_machines_are_told_the_same() -> None:
    plan = made_plan(DELAY)
    (best,) = found(plan, made_rows(plan, lambda delay: (delay - 22) ** 2), "nis")
    told = best_as_dict(plan, best)
    assert (told["axis"], told["at"], told["vertex"], told["at_edge"]) == ("VISO_DELAY_MS", 20.0, 22.0, False)
    assert told["age_on_arrival_ms"] == pytest.approx(29.5)


def shown(count: int) -> list[str]:
    plan = made_plan(Axis("VISO_DELAY_MS", tuple(map(float, range(count)))))
    console = Console(width=120, file=StringIO())
    console.print(result_table(plan, made_rows(plan, lambda delay: (delay - 7) ** 2), "nis"))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue().splitlines()


def test_small_sweep_is_shown_whole_a_large_one_by_its_best() -> None:
    for count, title, rows in ((40, "40 points, by nis", 40), (41, "The best 10 of 41 points, by nis", 10)):
        lines_shown = shown(count)
        assert " ".join(" ".join(lines_shown).split()).startswith(title)
        assert sum(line.startswith("│") for line in lines_shown) == rows


def test_columns_tell_points_apart_and_nothing_else() -> None:
    plan = made_plan(DELAY, seeds=(1, 2))
    assert changed_columns(plan) == ["seed", "VISO_DELAY_MS"]
    (header,) = (line for line in shown(3) if line.startswith("┃"))
    assert header.split()[1::2] == ["VISO_DELAY_MS", "nis"]
