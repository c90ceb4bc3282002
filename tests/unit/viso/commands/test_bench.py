# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso bench``: what it prints, and what it refuses."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.unit.viso.command_line import Viso
from viso.bench import memory
from viso.bench.table import BENCHES
from viso.cli import make_app
from viso.errors import InputError


def test_json_has_the_chosen_benches_with_their_figures() -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "port", "codec", "--seconds", "0", "--json"])
    data = json.loads(outcome.stdout)
    figures = data["benches"]
    assert list(figures) == ["port", "codec"]
    assert [figure["name"] for figure in figures["port"]] == ["MAV", "IntelT265"]
    assert set(figures["port"][0]) == {
        "name",
        "unit",
        "per_second",
        "cost_us",
        "typical_cost_us",
        "slow_cost_us",
        "turns",
        "rounds",
        "ratio",
    }
    assert data["kernel"] == "plain"
    assert data["memory"] == []
    assert {"python", "numpy", "pymavlink"} <= data["versions"].keys()
    assert data["machine"]["cores"] >= 1


def test_ratios_stand_in_the_table_with_what_they_compare_to(viso: Viso) -> None:
    outcome = viso("bench", "message", "--seconds", "0")
    assert outcome.code == 0
    assert "ratio of message: to pymavlink's parse of the same bytes" in outcome.out


def test_figures_compare_with_those_of_another_commit(viso: Viso, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    data = json.loads(viso("bench", "port", "--seconds", "0", "--json").out)
    for figure in data["benches"]["port"]:
        figure["turns"] *= 1000.0
    old.write_text(json.dumps({**data, "commit": "0123456789abcdef"}), encoding="utf-8")
    outcome = viso("bench", "port", "--seconds", "0", "--compare", str(old))
    assert outcome.code == 0
    assert "0123456789 then" in outcome.out
    [row] = [line for line in outcome.out.splitlines() if "IntelT265" in line and "poses" not in line]
    assert 100 < float(row.split("\N{BOX DRAWINGS LIGHT VERTICAL}")[-2].replace(",", "")) < 10_000


@pytest.mark.parametrize(
    "text", ["", "[]", '{"benches": 1}', '{"benches": {"port": [{"name": "MAV"}]}}', '{"benches": {"port": [1]}}']
)
def test_what_are_no_figures_is_refused(text: str, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    old.write_text(text, encoding="utf-8")
    outcome = CliRunner().invoke(make_app(), ["bench", "port", "--seconds", "0", "--compare", str(old)])
    assert isinstance(outcome.exception, InputError)
    assert str(old) in str(outcome.exception)


def test_figures_that_are_not_there_are_refused(tmp_path: Path) -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "port", "--compare", str(tmp_path / "none.json")])
    assert isinstance(outcome.exception, InputError)


def test_a_negative_time_for_memory_is_refused() -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "--memory", "-1"])
    assert isinstance(outcome.exception, InputError)
    assert "--memory" in str(outcome.exception)


def test_memory_is_told_after_each_minute_in_place_of_the_benches(monkeypatch: pytest.MonkeyPatch, viso: Viso) -> None:
    monkeypatch.setattr(memory, "MINUTE_S", 4)
    data = json.loads(viso("bench", "--memory", "2", "--json").out)
    assert data["benches"] == {}
    first, second = data["memory"]
    assert [point["minute"] for point in (first, second)] == [1, 2]
    assert 0 < first["log_mib"] < second["log_mib"]
    assert first["blocks"] > 0
    assert first["traced_mib"] is None
    outcome = viso("bench", "--memory", "1", "--trace")
    assert outcome.code == 0
    [row] = [line for line in outcome.out.splitlines() if line.count("\N{BOX DRAWINGS LIGHT VERTICAL}") == 6]
    assert all(cell.strip() for cell in row.split("\N{BOX DRAWINGS LIGHT VERTICAL}")[1:-1])


def test_resident_memory_is_unknown_where_the_system_does_not_tell(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    resident = memory.rss_mib()
    assert resident is None or resident > 1
    monkeypatch.setattr(memory, "_STATM", tmp_path / "statm")
    assert memory.rss_mib() is None


@pytest.mark.parametrize("seconds", ["-1", "nan", "inf"])
def test_seconds_that_are_no_time_are_refused(seconds: str) -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "--seconds", seconds])
    assert isinstance(outcome.exception, InputError)
    assert "--seconds" in str(outcome.exception)


def test_unknown_bench_is_refused_and_the_known_ones_named() -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "nosuch"])
    assert isinstance(outcome.exception, InputError)
    assert all(name in str(outcome.exception) for name in ("nosuch", *BENCHES))
