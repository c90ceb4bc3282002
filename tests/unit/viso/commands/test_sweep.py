# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso sweep``: outputs, exit codes, one-line errors, and what an interruption leaves."""

import contextlib
import csv
import json
import os
import re
import select
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.places import RECORDED, ROOT
from tests.unit.viso.command_line import Viso, failed_with
from viso.commands import sweep as sweep_command
from viso.replay.figures import OBJECTIVES
from viso.sweep import job, planning
from viso.sweep.job import Result
from viso.sweep.plan import Point, SweepPlan
from viso.vehicle.sensors.flight import Basis

CAPTURE = RECORDED / "captures" / "mav.jsonl.gz"
PAGE = (ROOT / "docs" / "sweep.md").read_text(encoding="utf-8")
SHORT = (CAPTURE, "--until", "6", "-j", "1", "--imu", "follow")
LOWEST = 22.0
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def parabola(plan: SweepPlan, point: Point) -> Result:
    """Stand in for a replay: the objective is a parabola along the first axis."""
    value = point.values[0]
    figures: dict[str, Any] = dict.fromkeys(OBJECTIVES)
    return Result(point.number, {**figures, "nis": 1 + (value - LOWEST) ** 2, "stamp_lag_ms": 5.0})


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_command, "run_point", parabola)


@pytest.mark.slow
def test_replays_are_told_and_kept(viso: Viso, tmp_path: Path) -> None:
    outcome = viso("sweep", *SHORT, "--set", "VISO_POS_M_NSE=0.2,0.5", "-o", "out")
    assert (outcome.code, outcome.err) == (0, "")
    assert "2 points, by nis" in outcome.out
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["plot.png", "points.jsonl", "results.csv", "results.parquet", "sweep.json"]


@pytest.mark.usefixtures("quick")
def test_json_has_minimum_and_rows(viso: Viso) -> None:
    outcome = viso("sweep", *SHORT, "--set", "VISO_DELAY_MS=0:40:10", "--json")
    told = json.loads(outcome.out)
    assert (told["points"], told["axis"], told["objective"], told["failed"]) == (5, "VISO_DELAY_MS", "nis", [])
    (best,) = told["best"]
    assert (best["at"], best["vertex"], best["age_on_arrival_ms"]) == (20.0, LOWEST, LOWEST + 5)
    assert [row["VISO_DELAY_MS"] for row in told["rows"]] == [0, 10, 20, 30, 40]


@pytest.mark.usefixtures("quick")
def test_stream_that_moves_the_vehicle_gets_a_note(viso: Viso) -> None:
    noted = viso("sweep", *SHORT, "--set", "VISO_SCALE=0.5,1")
    assert noted.err.startswith("note: mav: VISO_SCALE cannot be judged: with --imu follow the vehicle moves as the")
    assert "VISO_SCALE cannot be judged" in noted.out
    assert viso("sweep", *SHORT, "--set", "VISO_QUAL_MIN=0,1").err == ""


@pytest.mark.usefixtures("quick")
def test_same_command_goes_on_and_another_is_refused(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    args = ("sweep", *SHORT, "--set", "VISO_QUAL_MIN=1:3:1", "-o", "out")
    seen: list[int] = []

    def failing_second(plan: SweepPlan, point: Point) -> Result:
        seen.append(point.number)
        return Result(point.number, None, "bad luck") if point.number == 1 else parabola(plan, point)

    monkeypatch.setattr(sweep_command, "_draw", lambda *_args: None)
    monkeypatch.setattr(sweep_command, "run_point", failing_second)
    outcome = viso(*args)
    assert (outcome.code, outcome.err) == (1, "note: point 1: bad luck\n")
    monkeypatch.setattr(sweep_command, "run_point", parabola)
    outcome = viso(*args)
    assert (outcome.code, outcome.err) == (0, "note: out: 2 of 3 points are done already\n")
    assert seen == [0, 1, 2]
    outcome = viso("sweep", *SHORT, "--set", "VISO_QUAL_MIN=1:4:1", "-o", "out")
    assert outcome.code == 2
    assert outcome.err.startswith(
        "viso: out/sweep.json: another sweep: set.VISO_QUAL_MIN.values was [1.0, 2.0, 3.0], now"
    )


def test_interruption_keeps_what_is_done(viso: Viso, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(plan: SweepPlan, point: Point) -> Result:
        if point.number == 2:
            raise KeyboardInterrupt
        return parabola(plan, point)

    monkeypatch.setattr(sweep_command, "run_point", interrupted)
    outcome = viso("sweep", *SHORT, "--set", "VISO_SCALE=1:9:1", "-o", "out")
    assert outcome.code == 130
    assert "note: interrupted; out has 2 of 9 points; the same command goes on" in outcome.err
    with (tmp_path / "out" / "results.csv").open() as file:
        assert [row["point"] for row in csv.DictReader(file)] == ["0", "1"]


def started(folder: Path, *args: object) -> tuple[list[str], "subprocess.Popen[str]", Path]:
    """Return a command that sweeps in two processes, itself at work with the first point done, and its journal."""
    given = [*args, "--until", "6", "-j", "2", "-o", folder / "out"]
    command = [sys.executable, "-P", "-c", "from viso.cli import main; main()", "sweep", *map(str, given)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)
    journal = folder / "out" / "points.jsonl"
    while not (journal.exists() and journal.stat().st_size):
        with contextlib.suppress(subprocess.TimeoutExpired):
            raise AssertionError(f"ended with {process.wait(timeout=0.1)}")
    return command, process, journal


def descendants(pid: int) -> list[int]:
    """Return the processes that a process has started, and those that they have."""
    children = [
        int(one) for path in Path(f"/proc/{pid}/task").iterdir() for one in (path / "children").read_text().split()
    ]
    return [*children, *(one for child in children for one in descendants(child))]


@pytest.mark.slow
def test_signal_ends_the_processes_as_well_and_the_rest_is_done_later(tmp_path: Path) -> None:
    command, first, journal = started(tmp_path, CAPTURE, "--set", "VISO_SCALE=1:2:0.02")
    first.send_signal(signal.SIGINT)
    _, err = first.communicate(timeout=60)
    assert "the same command goes on" in err
    kept = len(journal.read_text().splitlines())
    assert 0 < kept < 51
    second = subprocess.run(command, capture_output=True, text=True, check=False, env=ENVIRONMENT, timeout=120)
    assert second.returncode == 0
    assert f"{kept} of 51 points are done already" in second.stderr
    points = [json.loads(line)["point"] for line in journal.read_text().splitlines()]
    assert sorted(points) == list(range(51))


@pytest.mark.slow
def test_command_that_is_killed_leaves_no_process_behind(tmp_path: Path) -> None:
    _, command, _ = started(tmp_path, CAPTURE, "--set", "VISO_SCALE=1:2:0.001")
    left = [os.pidfd_open(pid) for pid in descendants(command.pid)]
    assert len(left) >= 3
    command.kill()
    command.communicate(timeout=60)
    for descriptor in left:
        ended, _, _ = select.select([descriptor], [], [], 60)
        os.close(descriptor)
        assert ended


def test_when_every_point_fails_it_is_an_unusable_input(viso: Viso, tmp_path: Path) -> None:
    (tmp_path / "bad.jsonl").write_text("{}\n")
    complaint = f"{tmp_path}/bad.jsonl:1: the first line of a capture is an object with 'name' and 'params'"
    assert failed_with(viso("sweep", "bad.jsonl", "-j", "1", "--set", "VISO_QUAL_MIN=1,2"), complaint)


@pytest.mark.parametrize(("args", "complaint"), [
    (("--objective", "luck"), f"--objective luck: there are {', '.join(OBJECTIVES)}"),
    (("--set", "VISO_DELAY_MS=1:0:1"), "--set 'VISO_DELAY_MS=1:0:1': 0 is not above 1"),
    ((), "nothing is changed: --set NAME=START:STOP:STEP, --faults, --seeds or several streams"),
])  # fmt: skip
def test_option_that_cannot_be_used_is_one_line(viso: Viso, args: tuple[str, ...], complaint: str) -> None:
    assert failed_with(viso("sweep", *SHORT, *args), complaint)


def test_toml_file_stands_alone(viso: Viso, tmp_path: Path) -> None:
    (tmp_path / "sweep.toml").write_text("")
    assert failed_with(viso("sweep", "sweep.toml", CAPTURE), "2 files: a TOML file says it all, the streams as well")


def test_missing_table_writer_is_one_line(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    outcome = viso("sweep", *SHORT, "--set", "VISO_SCALE=1,2", "-o", "out")
    assert failed_with(
        outcome, "-o: tables are written as Parquet with pyarrow; install it with: pip install 'ardupilot-viso[sweep]'"
    )
    assert not Path("out").exists()


@pytest.mark.usefixtures("quick")
def test_without_matplotlib_the_rest_is_written(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "viso.sweep.plot", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    outcome = viso("sweep", *SHORT, "--set", "VISO_QUAL_MIN=1,2", "-o", "out")
    assert (outcome.code, outcome.err) == (
        0, "note: no plot: matplotlib is missing; install it with: pip install 'ardupilot-viso[plot]'\n",
    )  # fmt: skip
    assert Path("out/results.parquet").exists()
    assert not Path("out/plot.png").exists()


# The page


def commands_of_the_page() -> list[str]:
    blocks = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    joined = [block.replace("\\\n", " ") for block in blocks]
    return [line for block in joined for line in block.splitlines() if line.startswith("viso sweep")]


@pytest.fixture
def in_a_copy(tmp_path: Path) -> None:
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    for name, text in re.findall(r"`(\w+\.(?:toml|yaml))`:\n\n```\w+\n(.*?)```", PAGE, re.DOTALL):
        (tmp_path / name).write_text(text)


@pytest.mark.usefixtures("in_a_copy")
@pytest.mark.parametrize("line", commands_of_the_page())
def test_command_of_the_page_is_understood(viso: Viso, monkeypatch: pytest.MonkeyPatch, line: str) -> None:
    """The replays themselves would take minutes; the page's figures have a test of their own."""
    monkeypatch.setattr(planning, "read_flight", lambda _log: SimpleNamespace(basis=Basis.REPLAY))
    monkeypatch.setattr(sweep_command, "_draw", lambda *_args: None)
    monkeypatch.setattr(sweep_command, "run_point", parabola)
    monkeypatch.setattr(
        sweep_command, "run_in_processes", lambda plan, points, _jobs: (parabola(plan, p) for p in points)
    )
    monkeypatch.setattr(sweep_command, "run_on_cluster", lambda plan, points, _to: (parabola(plan, p) for p in points))
    program, *args = shlex.split(line)
    outcome = viso(*args)
    assert (program, outcome.code) == ("viso", 0)


def test_page_has_commands() -> None:
    assert len(commands_of_the_page()) >= 4


@pytest.mark.slow
def test_program_of_the_page_prints_what_the_page_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(block, {})
    assert f"prints `{capsys.readouterr().out.strip()}`" in PAGE
    job._read_stream.cache_clear()
