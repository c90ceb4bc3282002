# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Each bench does its work, and the table says how the figures compare."""

import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pyperf
import pytest

from ap_core.verdict import VerdictKind
from ekf_stub.inputs.ingest_rules import FUSED
from tests.places import ROOT
from tools.bench import BENCHES, WARM_UP_MESSAGES, FullVehicle, rows

QUICK = {"filter", "parse"}
IN_THIS_PROCESS = [name for name in BENCHES if not name.endswith("-interpreted")]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in IN_THIS_PROCESS]
)
def test_round_of_a_bench_takes_time(name: str) -> None:
    with ExitStack() as stack:
        assert 0 < BENCHES[name].prepare(stack)() < 30


@pytest.mark.slow
def test_named_benches_are_written_to_a_file_and_shown_as_a_table(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tools.bench", "parse", "filter-interpreted", "--debug-single-value", "-o"]
    file = tmp_path / "speed.json"
    done = subprocess.run([*command, file], cwd=ROOT, check=True, capture_output=True, text=True, timeout=120)
    assert pyperf.BenchmarkSuite.load(str(file)).get_benchmark_names() == ["filter-interpreted", "parse"]
    assert [line.split(" ")[1] for line in done.stdout.strip().splitlines()[-2:]] == ["filter-interpreted", "parse"]


@pytest.mark.slow
def test_bench_that_does_not_exist_is_an_error() -> None:
    command = [sys.executable, "-m", "tools.bench", "nosuch"]
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert "no such bench: nosuch" in done.stderr


def test_table_compares_the_best_rounds_with_each_other_and_with_the_targets() -> None:
    values = {"parse": [1e-5, 2e-5], "message": [3e-5, 4e-5], "doctor": [1.7], "dfreader": [1.0]}
    runs = {name: pyperf.Run(seconds, metadata={"name": name}) for name, seconds in values.items()}
    table = {row[0]: row[2:] for row in rows({name: pyperf.Benchmark([run]) for name, run in runs.items()})}
    assert table["message"] == ("30", "39.5", "3 x parse", "2.4 x parse", "missed")
    assert table["doctor"][2:] == ("", "1,800,000 us", "met")
    assert table["dfreader"][2:] == ("", "", "")


@pytest.mark.slow
def test_vehicle_fuses_what_it_is_sent(tmp_path: Path) -> None:
    flown = FullVehicle(tmp_path)
    flown.run(WARM_UP_MESSAGES)
    counts = flown.vehicle.ahrs.ext_nav_counts
    before = {kind: counts[kind, FUSED.code] for kind in ("pose", "velocity", "yaw")}
    flown.run(30)
    fused = {kind: counts[kind, FUSED.code] - before[kind] for kind in before}
    # What is on its way to the horizon comes with the next messages.
    assert fused["pose"] == pytest.approx(30, abs=2)
    assert fused["velocity"] == pytest.approx(30, abs=2)
    assert fused["yaw"] > 0
    flown.vehicle.close()


def test_messages_are_accepted_and_logged_while_the_main_loop_stands_still(tmp_path: Path) -> None:
    flown = FullVehicle(tmp_path)
    flown.run(160)  # until it logs
    records = flown.vehicle.logger.records
    flown.run(3, main_loop=False)
    accepted = [event.verdict.kind for event in iter(flown.vehicle.endpoint.next_event, None)]
    assert accepted == [VerdictKind.ACCEPTED] * 163
    assert flown.vehicle.logger.records >= records + 3
    flown.vehicle.close()
