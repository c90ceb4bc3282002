# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What people and machines are told of a sweep."""

from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from tests.unit.viso.sweep.made import made_plan, made_rows
from viso.replay.figures import BY_TIME
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


@pytest.mark.parametrize(("imu", "why"), [
    ("follow", "the vehicle moves as the stream says"), ("bench", "the vehicle stands still"),
])  # fmt: skip
def test_what_the_motion_does_not_show_is_not_told(imu: str, why: str) -> None:
    (line,) = lines(imu=imu)
    assert line.startswith(f"VISO_DELAY_MS cannot be judged: with --imu {imu} {why}")
    assert "least" not in line


def test_noise_is_not_judged_by_figures_in_units_of_it() -> None:
    plan = made_plan(Axis("VISO_POS_M_NSE", (0.1, 0.2)))
    (best,) = found(plan, made_rows(plan, lambda noise: noise), "nis")
    assert best_lines(plan, [best], "nis") == [
        "VISO_POS_M_NSE cannot be judged: nis counts innovations in units of it; rms_... does not"
    ]
    assert best_as_dict(plan, best, "nis")["unjudged"] is not None
    assert best_as_dict(plan, best, "rejected")["unjudged"] is None


def test_other_parameters_have_no_age() -> None:
    plan = made_plan(GATE)
    (line,) = best_lines(plan, found(plan, made_rows(plan, lambda gate: gate), "nis"), "nis")
    assert line == (
        "nis is least at EK3_POS_I_GATE 300 (300), at the edge of what was tried: what is best may lie beyond"
    )


def test_plateau_is_told() -> None:
    plan = made_plan(DELAY)
    rows = made_rows(plan, lambda delay: max(abs(delay - 20), 10))
    assert "at VISO_DELAY_MS 10, and the same up to 30 (10)" in best_lines(plan, found(plan, rows, "nis"), "nis")[0]


@pytest.mark.parametrize(("noise", "told"), [
    (0.02, "10 to 30 are not told apart (2 deviations, or a step of the filter, 12.5 ms). Corrected stamps are"),
    (9.0, "no value is worse by more than chance (2 deviations): this material does not show VISO_DELAY_MS"),
])  # fmt: skip
def test_chance_is_told(noise: float, told: str) -> None:
    plan = made_plan(DELAY)
    rows = made_rows(plan, lambda delay: 1 + (delay - 25.0) ** 2 / 1000)
    for row in rows:
        of_spans = row["nis"] + noise * np.random.default_rng(row["point"]).standard_normal(40)
        row[BY_TIME] = {"span_s": 1, "sums": {"pose": [[n, 10, 10 * nis, 0.0] for n, nis in enumerate(of_spans)]}}
    (line,) = best_lines(plan, found(plan, rows, "nis"), "nis")
    assert told in line


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
    told = best_as_dict(plan, best, "nis")
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
