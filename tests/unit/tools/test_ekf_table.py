# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of how near the filter comes to recorded logs."""

from pathlib import Path

import numpy as np
import pytest

from tools import ekf_table
from viso.compare.estimates import compare_estimates
from viso.compare.tolerances import BENCH, FLIGHT
from viso.errors import InputError
from viso.replay.ekf.run import LABELS, EkfReplay

PAGE = "before\n<!-- measured: ekf -->\nold\n<!-- end -->\nafter\n<!-- table: cli -->\nkept\n<!-- end -->\n"
COLUMNS = len(ekf_table.HEAD)


def replay(ours: str = "initialised", **values: float) -> EkfReplay:
    """Return a replay of two records, in which ours differ by given values."""
    recorded = {label: np.zeros(2) for label in LABELS}
    differing = {label: np.full(2, values.get(label, 0.0)) for label in LABELS}
    return EkfReplay(np.array([1.0, 2.0]), differing, recorded, [(1.0, ours)], [(1.125, "initialised")])


def row(*, bench: bool = False, **values: float) -> tuple[str, ...]:
    return ekf_table.row("log", compare_estimates(replay(**values), BENCH if bench else FLIGHT))  # type: ignore[arg-type]  # no text among them


def test_row_of_a_log_that_is_the_same() -> None:
    nothing = ("0.0 (0.0)", "0.0", "0.0", "0.000", "0.000", "0.0, 0.0")
    assert row() == ("`log`", *nothing, "100.0 %, 100.0 %", "yes, 0.125 s", "met")


def test_cell_holds_the_largest_figure_of_its_quantities() -> None:
    found = row(PN=0.001, PE=-0.0035, PD=0.002, VN=0.01, VD=0.02, Roll=0.25, Pitch=0.125, Yaw=2, IPD=0.004, IVE=-0.005)
    assert found[1:7] == ("3.5 (3.5)", "2.0", "20.0", "0.250", "2.000", "4.0, 5.0")
    assert found[-1] == "missed"


def test_texts_that_differ_are_counted() -> None:
    found = ekf_table.row("log", compare_estimates(replay(ours="forced reset"), FLIGHT))
    assert found[-2:] == ("no, 2 differ", "missed")


def test_share_of_equal_records() -> None:
    assert row(TS=1.0)[7] == "0.0 %, 100.0 %"


def test_row_has_a_cell_for_each_column() -> None:
    assert {len(row()), len(row(bench=True))} == {COLUMNS}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float]]:
    """Return what is measured, which takes no time here: names of logs, and where they end."""
    calls: list[tuple[str, float]] = []

    def measure(path: Path, *, until_s: float) -> EkfReplay:
        if path.name.startswith("none"):
            raise InputError(f"{path}: No such file or directory")
        calls.append((path.name, until_s))
        return replay()

    monkeypatch.setattr(ekf_table, "replay_ekf", measure)
    return calls


def test_logs_of_the_tests_are_measured_by_default(
    measured: list[tuple[str, float]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert ekf_table.main([]) == 0
    assert [name for name, _ in measured] == sorted(path.name for path in ekf_table.LOGS.glob("*.xz"))
    assert dict(measured)["flight_voxl_reset.BIN.xz"] == 71.0
    assert capsys.readouterr().out.count("| `") == len(measured) > 0


def test_table_goes_into_a_page(measured: list[tuple[str, float]], tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    assert ekf_table.main(["a.BIN", "b.BIN", "--page", str(page)]) == 0
    assert [name for name, _ in measured] == ["a.BIN", "b.BIN"]
    assert [line.split(" ")[1] for line in page.read_text().splitlines() if line.startswith("| `")] == ["`a`", "`b`"]


@pytest.mark.parametrize("page", ["nothing", None])
def test_page_is_looked_at_before_the_run(measured: list[tuple[str, float]], tmp_path: Path, page: str | None) -> None:
    path = tmp_path / "page.md"
    if page is not None:
        path.write_text(page)
    assert ekf_table.main(["a.BIN", "--page", str(path)]) == 2
    assert measured == []


def test_log_that_cannot_be_used_is_one_line(
    measured: list[tuple[str, float]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert ekf_table.main(["none.BIN"]) == 2
    assert capsys.readouterr() == ("", "ekf_table: none.BIN: No such file or directory\n")
