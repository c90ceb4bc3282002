# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso bench``: what it prints, and what it refuses."""

import json

import pytest
from typer.testing import CliRunner

from emulator.bench.table import BENCHES
from emulator.cli import make_app
from emulator.errors import InputError
from tests.unit.emulator.command_line import Viso


def test_json_has_the_chosen_benches_with_their_figures() -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "port", "codec", "--seconds", "0", "--json"])
    figures = json.loads(outcome.stdout)
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
    }


def test_table_has_a_line_a_figure(viso: Viso) -> None:
    outcome = viso("bench", "port", "--seconds", "0")
    assert outcome.code == 0
    assert [line for line in outcome.out.splitlines() if "IntelT265" in line and "poses" in line]


@pytest.mark.parametrize("seconds", ["-1", "nan", "inf"])
def test_seconds_that_are_no_time_are_refused(seconds: str) -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "--seconds", seconds])
    assert isinstance(outcome.exception, InputError)
    assert "--seconds" in str(outcome.exception)


def test_unknown_bench_is_refused_and_the_known_ones_named() -> None:
    outcome = CliRunner().invoke(make_app(), ["bench", "nosuch"])
    assert isinstance(outcome.exception, InputError)
    assert all(name in str(outcome.exception) for name in ("nosuch", *BENCHES))
