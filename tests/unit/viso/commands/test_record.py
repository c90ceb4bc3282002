# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso record``: the scenarios that there are, what it refuses, and recordings over links."""

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mav_handlers.links.base import Link
from mav_handlers.links.pair import PairLink, make_pair
from tests.interop.programs import autopilot
from tests.unit.viso.command_line import Outcome, Viso, failed_with
from tests.unit.viso.recording.fake_autopilot import FakeAutopilot, read_lines
from tests.unit.viso.recording.test_record_viso import deviations
from viso.commands import record as record_command
from viso.recording import driving
from viso.recording.scenario import SCENARIOS

SHORT = """
name: short
about: x
parameters: {VISO_TYPE: 1}
wait: [clock_s: 4]
steps:
- stream: {message: VISION_POSITION_ESTIMATE, rate_hz: 10}
- pause: 1
"""


LATENCY_S = 2e-3


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_scenarios_are_listed(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_command, "read_scenario", lambda name: SimpleNamespace(about=f"about {name}"))
    assert viso("record").out.splitlines() == [f"{name}: about {name}" for name in SCENARIOS]


def test_what_cannot_be_used_is_told_in_one_line(viso: Viso, scenario: Path) -> None:
    there_are = ", ".join(SCENARIOS)
    outcome = viso("record", "fligth", "--master", "viso", "-o", "out")
    assert failed_with(outcome, f"SCENARIO fligth: neither a file nor one of {there_are}")
    assert failed_with(viso("record", "mav", "-o", "out"), "--master: missing; the link to the autopilot")
    assert failed_with(viso("record", "mav", "--master", "viso"), "-o: missing; the folder for the recording's files")
    outcome = viso("record", scenario, "--master", "viso:5.0", "-o", "out")
    assert outcome.err.startswith("viso: --master viso: 5.0: no such profile; there are 4.6, ")
    scenario.write_text(SHORT.replace("pause: 1", "pause: x"), encoding="utf-8")
    outcome = viso("record", scenario, "--master", "viso", "-o", "out")
    assert failed_with(outcome, f"{scenario}: step 2: pause: 'x' is not a number between 0 and 3600")


class Wire:
    """A link to a made-up autopilot, whose time goes on only while the recorder waits."""

    def __init__(self, patch: pytest.MonkeyPatch, speedup: float) -> None:
        self.autopilot = FakeAutopilot()
        self.now_s = 50.0
        self._speedup = speedup
        self._ours, self._theirs = make_pair()
        patch.setattr(driving, "wait_readable", self._wait)
        patch.setattr(driving, "open_link", self._open)
        driver = driving.RealDriver
        patch.setattr(driving, "RealDriver", lambda *args, **named: driver(*args, **named, now_s=lambda: self.now_s))

    def _open(self, _name: str) -> PairLink:
        return self._ours

    def _wait(self, _links: list[Link], timeout_s: float) -> None:
        self.now_s += min(max(timeout_s, 1e-4), LATENCY_S)
        now_us = round((self.now_s - 50.0) * 1e6 * self._speedup)
        self._theirs.send(self.autopilot.run(now_us, self._theirs.receive()))


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], Wire]:
    return lambda speedup: Wire(monkeypatch, speedup)


def written(outcome: Outcome) -> Any:
    return json.loads(outcome.out)


def test_simulator_that_runs_faster_gets_its_messages_by_its_own_clock(
    viso: Viso, scenario: Path, wire: Callable[[float], Wire]
) -> None:
    end = wire(8.0)
    end.autopilot.log = b""
    outcome = viso("record", scenario, "--master", "pair", "-o", "out", "--json")
    assert outcome.code == 1  # for want of a log
    _, *lines = read_lines(Path("out/short.jsonl.gz"))
    times_us = [line["arrival_us"] for line in lines]
    assert times_us[0] == pytest.approx(4_000_000, abs=50_000)
    assert times_us[-1] - times_us[0] == pytest.approx(100_000 * (len(lines) - 1), abs=20_000)


def test_recording_that_is_not_complete_is_kept_and_says_why(
    viso: Viso, scenario: Path, wire: Callable[[float], Wire]
) -> None:
    wire(1.0).autopilot.fixed = {"VISO_TYPE"}
    outcome = viso("record", scenario, "--master", "pair", "-o", "out", "--json")
    problem = "parameter VISO_TYPE: 1 is refused, it stays 0"
    assert (outcome.code, outcome.err.splitlines()[-1]) == (1, f"incomplete: {problem}")
    assert (written(outcome)["complete"], written(outcome)["problems"]) == (False, [problem])
    assert json.loads(Path("out/short.json").read_text(encoding="utf-8"))["problems"] == [problem]


def test_nothing_is_written_where_no_autopilot_answers(
    viso: Viso, scenario: Path, wire: Callable[[float], Wire]
) -> None:
    wire(1.0).autopilot.is_dead = True
    outcome = viso("record", scenario, "--master", "pair", "-o", "out")
    told = "viso: --master pair: no answer within 10 s: no autopilot is heard"
    assert (outcome.code, outcome.err.splitlines()[-1]) == (2, told)
    assert list(Path("out").iterdir()) == []


def test_armed_vehicle_is_refused(viso: Viso, scenario: Path, wire: Callable[[float], Wire]) -> None:
    wire(1.0).autopilot.is_armed = True
    outcome = viso("record", scenario, "--master", "pair", "-o", "out")
    assert outcome.code == 2
    assert outcome.err.endswith("the vehicle is armed (--allow-armed records it all the same)\n")


@pytest.mark.slow
def test_recording_over_a_socket_comes_to_the_same_in_a_replay(viso: Viso, scenario: Path, tmp_path: Path) -> None:
    with autopilot(tmp_path, "--firmware=4.6") as vehicle:
        outcome = viso("record", scenario, "--master", f"tcp:127.0.0.1:{vehicle.ports[0]}", "-o", "out", "--json")
    assert (outcome.code, written(outcome)["firmware"]) == (0, "ArduCopter V4.6.3-beta (3fc7011a)")
    assert deviations(Path("out"), "short", "4.6") == []
    assert len(read_lines(Path("out/short.jsonl.gz"))) > 20
