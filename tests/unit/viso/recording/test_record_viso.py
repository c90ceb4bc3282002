# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a vehicle of viso: their files, and that a replay comes to the same."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from mav_handlers.links import read_tlog
from tests.unit.viso.recording.fake_autopilot import read_lines
from viso.compare.recordings import compare_recording
from viso.firmware.releases import JULY_2025, PROFILES
from viso.recording.driving import record_viso
from viso.recording.outputs import FILES, write_recording
from viso.recording.recorder import Recorder
from viso.recording.scenario import SCENARIOS, Scenario, parse_scenario, read_scenario
from viso.streams.capture import read_capture

HEAD = """
name: {name}
about: x
parameters: {{VISO_TYPE: 1, LOG_DISARMED: 1, EK3_SRC1_POSXY: 6, EK3_SRC2_POSZ: 1, ARMING_OPTIONS: 1}}
"""
QUICK = {
    "poses": """
wait: [clock_s: 3]
steps:
- stream:
  - {message: VISION_POSITION_ESTIMATE, motion: circle, random_delay_ms: 20}
  - {message: ODOMETRY, rate_hz: 7, quality: -1}
- pause: 1
- change: {covariance: [.nan], frames: [1, 8]}
- jump: {position_m: [1, 0, 0], counted: true}
- pause: 1
""",
    "switching": """
wait: [clock_s: 3]
steps:
- stream: {message: VISION_SPEED_ESTIMATE}
- sources: 2
- arm: true
- set: {VISO_VEL_M_NSE: 0.5}
- pause: 0.3
""",
    "questions": """
reboot: false
steps:
- ask:
    name: what it is
    send: [COMMAND_LONG, {target_system: 1, target_component: 1, command: 512, param1: 148}]
- ask: {name: heartbeat, send: [HEARTBEAT, {type: 6}], wait_ms: 1200, show: [HEARTBEAT], hide: [STATUSTEXT]}
""",
}


def record(scenario: Scenario, folder: Path, firmware: str = JULY_2025.name) -> None:
    """Record a vehicle of viso into a folder."""
    recorder = Recorder(scenario)
    record_viso(recorder, PROFILES[firmware])
    assert recorder.recording.problems == []
    write_recording(folder, recorder.recording)


def deviations(folder: Path, name: str, firmware: str = JULY_2025.name) -> list[str]:
    """Return how a recording differs from what viso makes of it; its first line has to name the release."""
    comparison = compare_recording(folder / f"{name}.jsonl.gz")
    assert comparison.firmware == firmware
    return list(map(str, comparison.differences))


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    @cache
    def folder_of(name: str) -> Path:
        folder = tmp_path_factory.mktemp(name)
        record(parse_scenario(HEAD.format(name=name) + QUICK[name], name), folder)
        return folder

    return folder_of


Quick = Callable[[str], Path]


def summary(folder: Path, name: str) -> Any:
    return json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))


def test_poses_are_recorded_with_the_records_that_a_replay_makes(quick: Quick) -> None:
    assert deviations(quick("poses"), "poses") == []
    told = summary(quick("poses"), "poses")
    assert told["messages"] > 100
    assert told["records"] > 90
    assert (told["records_of_no_message"], told["complete"], told["problems"]) == (0, True, [])


def test_all_files_that_the_documentation_names_are_there_and_no_other(quick: Quick) -> None:
    names = {path.name for name in QUICK for path in quick(name).glob(f"{name}.*")}
    endings = {name.removeprefix(scenario) for name in names for scenario in QUICK if name.startswith(scenario)}
    assert endings == set(FILES)


def test_capture_tells_parameters_and_the_rate_of_the_link(quick: Quick) -> None:
    stream = read_capture(quick("poses") / "poses.jsonl.gz")
    assert stream.params["EK3_SRC1_POSXY"] == 6
    assert stream.baud == 115_200


def test_version_events_and_parameters_are_told(quick: Quick) -> None:
    told = summary(quick("switching"), "switching")
    assert told["firmware"] == "ArduCopter V4.7.0-dev (2b361bde)"
    assert told["differ"]["ARMING_OPTIONS"] == 1
    assert [event["event"] for event in told["events"]][-1] == "the autopilot's clock started again"
    assert "VISO_TYPE 0" in (quick("switching") / "switching.parm").read_text(encoding="utf-8").splitlines()


def test_commands_and_parameters_of_steps_are_in_the_capture_with_their_results(quick: Quick) -> None:
    header, *lines = read_lines(quick("switching") / "switching.jsonl.gz")
    assert header["command_ack"] == [[42007, 0], [400, 4]]
    assert [one["type"] for one in lines if not one["out"]] == ["COMMAND_LONG", "COMMAND_LONG", "PARAM_SET"]


def test_questions_are_kept_with_their_answers(quick: Quick) -> None:
    lines = (quick("questions") / "questions.conversation.jsonl").read_text(encoding="utf-8").splitlines()
    head, version, heartbeat = map(json.loads, lines)
    assert (head["name"], head["camera_hz"]) == ("questions", 0)
    assert [name for name, _ in version["answers"]] == ["COMMAND_ACK", "AUTOPILOT_VERSION"]
    assert {name for name, _ in heartbeat["answers"]} == {"HEARTBEAT"}


def test_telemetry_log_has_frames_both_ways(quick: Quick) -> None:
    entries = list(read_tlog(quick("questions") / "questions.tlog"))
    assert {(entry.data[5], entry.data[6]) for entry in entries if entry.data[0] == 0xFD} == {
        (1, 1),
        (1, 197),
        (255, 190),
    }
    assert [entry.time_us for entry in entries] == sorted(entry.time_us for entry in entries)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "firmware"),
    [
        *((name, JULY_2025.name) for name in SCENARIOS if name != "flight"),
        *((name, firmware) for name in ("mocap", "speedcov", "t265") for firmware in ("4.6", "2026-02", "2026-04")),
    ],
)
def test_every_scenario_comes_to_the_same_in_a_replay(name: str, firmware: str, tmp_path: Path) -> None:
    record(read_scenario(name), tmp_path, firmware)
    assert deviations(tmp_path, name, firmware) == []
