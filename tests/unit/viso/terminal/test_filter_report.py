# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables and rows of what the filter did."""

from io import StringIO

from rich.console import Console
from rich.table import Table

from ap_core.verdict import VerdictKind
from ekf_stub.reports import AidingMode
from viso.terminal.filter_report import (
    aiding_rows,
    aiding_table,
    filter_rows,
    filter_table,
    innovation_rows,
    innovation_table,
    tables_of,
)
from viso.vehicle.outcomes import AidingSpan, Innovations

COUNTS = {("pose", "model_gate_position"): 2, ("pose", "taken"): 9, ("pose", "too_soon"): 4, ("yaw", "model_fused"): 7}
SPANS = [AidingSpan(0, 5_117_500, AidingMode.NONE), AidingSpan(5_117_500, 35_000_000, AidingMode.ABSOLUTE)]


def rendered(*tables: Table) -> list[str]:
    """Return the lines of tables, without the bars between columns."""
    console = Console(file=StringIO(), width=140)
    console.print(*tables)
    assert isinstance(console.file, StringIO)
    return [" ".join(line.replace("│", " ").split()) for line in console.file.getvalue().splitlines()]


def innovations() -> Innovations:
    made = Innovations()
    made.add(3.0, 0.5, is_rejected=False)
    made.add(4.0, 1.25, is_rejected=True)
    return made


def test_table_of_outcomes_says_whose_opinion_it_is() -> None:
    lines = rendered(filter_table(COUNTS))
    assert "pose 2 rejected horizontal position gate a model's" in lines
    assert "pose 4 refused less than 20 ms, odometry 50 ms, after the last exact" in lines
    assert "yaw 7 fused used by the estimator a model's" in lines
    assert not [line for line in lines if " 9 " in line]


def test_rows_of_outcomes() -> None:
    assert filter_rows(COUNTS)[0] == {
        "kind": "pose",
        "outcome": "rejected",
        "rule": "model_gate_position",
        "reason": "rejected: horizontal position gate",
        "count": 2,
        "model": True,
    }
    assert [row["model"] for row in filter_rows(COUNTS)] == [True, False, True]


def test_samples_have_a_table_once_something_became_of_them() -> None:
    messages = {("ODOMETRY", VerdictKind.ACCEPTED, "consumed"): 9}
    assert len(tables_of(messages, {})) == len(tables_of(messages, {("pose", "taken"): 9})) == 1
    assert len(tables_of(messages, COUNTS)) == 2


def test_innovations_in_their_units() -> None:
    lines = rendered(innovation_table({"velocity": innovations(), "pose": innovations()}))
    assert lines[-3:-1] == [
        "pose 2 50.0% 3.536 m 4.000 m 1.25",
        "velocity 2 50.0% 3.536 m/s 4.000 m/s 1.25",
    ]
    assert "a model's" in lines[0]


def test_rows_of_innovations() -> None:
    assert innovation_rows({"yaw": innovations()}) == [
        {
            "kind": "yaw",
            "unit": "deg",
            "tested": 2,
            "rejected": 1,
            "rms": 3.535534,
            "worst": 4.0,
            "worst_ratio": 1.25,
            "model": True,
        }
    ]


def test_nothing_tested_has_no_mean() -> None:
    assert Innovations().rms == 0


def test_timeline_of_aiding() -> None:
    lines = rendered(aiding_table(SPANS))
    assert "0.000 s 5.117 s nothing (constant position)" in lines
    assert "5.117 s 35.000 s absolute position" in lines
    assert aiding_rows(SPANS)[1] == {"start_us": 5_117_500, "end_us": 35_000_000, "mode": "absolute", "model": True}
