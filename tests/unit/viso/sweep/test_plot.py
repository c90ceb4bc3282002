# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of sweeps of every shape; what is in them is looked at through matplotlib's own objects."""

from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from tests.unit.viso.sweep.made import made_plan, made_rows
from viso.sweep import plot
from viso.sweep.dimensions import Axis
from viso.sweep.plan import Faults, Sampling, SweepPlan
from viso.sweep.plot import save_plot

DELAY = Axis("VISO_DELAY_MS", (0.0, 10.0, 20.0, 30.0))
GATE = Axis("EK3_POS_I_GATE", (300.0, 500.0, 700.0))


def drawn(plan: SweepPlan, rows: list[dict[str, Any]], path: Path, monkeypatch: pytest.MonkeyPatch) -> Figure:
    """Return the figure of a picture that was written."""
    figures: list[Figure] = []

    class Kept(Figure):
        def __init__(self, *args: Any, **named: Any) -> None:
            super().__init__(*args, **named)
            figures.append(self)

    monkeypatch.setattr(plot, "Figure", Kept)
    save_plot(plan, rows, "nis", path / "plot.png")
    assert (path / "plot.png").read_bytes().startswith(b"\x89PNG")
    return figures[0]


def values_of(line: Any, axis: str) -> list[float]:
    """Return where a line's points are along an axis of the picture."""
    return [float(value) for value in getattr(line, f"get_{axis}data")()]


def test_one_axis_is_a_line_with_its_minimum_marked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = made_plan(DELAY)
    rows = made_rows(plan, lambda delay: 1 + (delay - 12) ** 2)
    (panel,) = drawn(plan, rows, tmp_path, monkeypatch).axes
    line, mark = panel.lines
    assert values_of(line, "x") == list(DELAY.values)
    assert values_of(line, "y") == [row["nis"] for row in rows]
    assert values_of(mark, "x") == pytest.approx([12.0, 12.0])
    assert panel.get_yscale() == "log"


@pytest.mark.slow
@pytest.mark.parametrize(("sign", "told"), [(1, "0 or less"), (-1, "30 or more")])
def test_minimum_at_an_edge_is_marked_as_such(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sign: int, told: str
) -> None:
    plan = made_plan(DELAY)
    (panel,) = drawn(plan, made_rows(plan, lambda delay: 100 + sign * delay), tmp_path, monkeypatch).axes
    assert [text.get_text() for text in panel.texts] == [told]


@pytest.mark.slow
def test_what_varies_beside_the_objective_gets_a_panel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = made_plan(DELAY, seeds=(1, 2))
    rows = made_rows(plan, lambda delay: delay + 100)
    for row in rows:
        row["ate_m"] = row["seed"] + row["VISO_DELAY_MS"]
    figure = drawn(plan, rows, tmp_path, monkeypatch)
    assert [panel.get_ylabel() for panel in figure.axes] == ["nis", "ate_m, m"]
    assert [line.get_label() for line in figure.axes[1].lines] == ["seed 1", "seed 2"]


@pytest.mark.slow
def test_two_axes_are_a_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = made_plan(DELAY, GATE)
    figure = drawn(plan, made_rows(plan, lambda delay, gate: delay + gate), tmp_path, monkeypatch)
    panel = figure.axes[0]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("VISO_DELAY_MS", "EK3_POS_I_GATE")
    (best,) = panel.lines
    assert (values_of(best, "x"), values_of(best, "y")) == ([0.0], [300.0])
    assert panel.get_title() == "best at the edge of VISO_DELAY_MS and EK3_POS_I_GATE"


@pytest.mark.slow
def test_samples_are_points_against_each_axis(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    axes = [Axis(name, span=(0.0, 1.0)) for name in ("VISO_SCALE", "VISO_POS_X", "VISO_POS_Y", "VISO_POS_Z")]
    plan = made_plan(*axes, sampling=Sampling("latin", 6))
    figure = drawn(plan, made_rows(plan, lambda *values: sum(values)), tmp_path, monkeypatch)
    assert [panel.get_xlabel() for panel in figure.axes[:4]] == [axis.name for axis in axes]
    assert all(len(values_of(panel.lines[0], "x")) == 6 for panel in figure.axes[:4])


@pytest.mark.slow
def test_best_sample_names_the_axes_on_which_nothing_was_tried_beyond_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = made_plan(DELAY, GATE, Axis("VISO_SCALE", (0.5, 1.0, 2.0)))
    rows = made_rows(plan, lambda delay, gate, scale: delay - gate + (scale - 1) ** 2)
    figure = drawn(plan, rows, tmp_path, monkeypatch)
    assert [text.get_text() for panel in figure.axes[:3] for text in panel.texts] == ["0 or less", "700 or more", "1"]


def test_without_axes_each_group_has_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = made_plan(faults=(Faults(), Faults("/there/loss.yaml", "faults: []")), seeds=(1, 2, 3))
    (panel,) = drawn(plan, made_rows(plan, lambda: 1.0), tmp_path, monkeypatch).axes
    assert [label.get_text() for label in panel.get_yticklabels()] == ["faults none", "faults loss.yaml"]


@pytest.mark.slow
def test_points_without_a_figure_leave_a_gap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = made_plan(DELAY)
    rows = made_rows(plan, lambda delay: None if delay == 10 else delay)
    (panel,) = drawn(plan, rows, tmp_path, monkeypatch).axes
    assert values_of(panel.lines[0], "x") == [0.0, 20.0, 30.0]
    drawn(plan, made_rows(plan, lambda _delay: None), tmp_path, monkeypatch)
