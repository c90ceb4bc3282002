# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of merit of two replays."""

from io import StringIO
from typing import Any

from rich.console import Console

from viso.compare.figures import BY_TIME, OBJECTIVES
from viso.compare.merit import merit_lines, merit_rows, merit_table, merits


def row(nis: float, **figures: float) -> dict[str, Any]:
    sums = [[number, 10, 10 * nis * (1.1 if number % 2 else 0.9), 0.0] for number in range(20)]
    by_time = {"span_s": 1, "sums": {"pose": sums}}
    return {**dict.fromkeys(OBJECTIVES), "nis": nis, BY_TIME: by_time, **figures}


def test_figures_that_one_has_stand_beside_those_of_the_other() -> None:
    found = merits(row(1.0, rms_pose=0.1, ate_m=0.2), row(2.0, rms_pose=0.3))
    assert found == [("rms_pose", 0.1, 0.3), ("nis", 1.0, 2.0), ("ate_m", 0.2, None)]


def test_change_is_told_with_its_deviation() -> None:
    (line,) = merit_lines(row(1.0), row(2.0))
    assert line.startswith("innovations (nis) change by +100.0%, with a deviation of ")
    assert line.endswith("beyond 2 of these")
    (line,) = merit_lines(row(1.0), row(1.0))
    assert line.endswith("+0.0%, with a deviation of 0.0%: may be chance")
    assert list(merit_lines(row(1.0), {**row(1.0), BY_TIME: None})) == []


def test_machines_are_told_what_may_be_chance() -> None:
    (nis,) = merit_rows(row(1.0), row(2.0))
    assert (nis["name"], nis["before"], nis["after"], nis["chance"]) == ("nis", 1.0, 2.0, False)


def test_table_names_the_truth() -> None:
    console = Console(width=200, file=StringIO())
    console.print(merit_table(row(1.0, ate_m=0.25), row(2.0), "SIM"))
    assert isinstance(console.file, StringIO)
    shown = console.file.getvalue()
    assert "how far its positions are from SIM" in shown
    assert "0.25 m" in shown
