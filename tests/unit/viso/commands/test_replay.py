# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso replay`` of ordinary material, with other settings and another firmware; the examples of its page."""

import json
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.places import RECORDED, ROOT
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.vehicles import MAVPROXY, READY, beats, listed, recorded
from viso.firmware.releases import PROFILES
from viso.logs.files import single_log
from viso.replay.run import ReplaySetup, run_replay
from viso.streams.stream_kinds import read_stream
from viso.terminal.settings import needing_reboot
from viso.vehicle.config import bench

DATA = ROOT / "tests" / "data"
FLIGHT = DATA / "trajectories" / "flight.tum"
LOG = RECORDED / "logs" / "bench_no_yaw_source.BIN.xz"
PAGE = ROOT / "docs" / "replay.md"
POSES = 10
SHORT = ("poses.tum", "--lead", "3", "--param", "VISO_TYPE=1")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the first second of a trajectory, and the log of a vehicle that has got it."""
    folder = tmp_path_factory.mktemp("flown")
    lines = [line for line in FLIGHT.read_text().splitlines() if not line.startswith("#")]
    poses, log = folder / "poses.tum", folder / "flight.BIN"
    poses.write_text("".join(f"{line}\n" for line in lines[:POSES]))
    with single_log(log) as open_log:
        run_replay(read_stream(poses, 3_000_000), {"VISO_TYPE": 1}, ReplaySetup(bench()), open_log=open_log)
    return folder


@pytest.fixture(autouse=True)
def here(viso: Viso, flown: Path) -> None:
    """Put both into the folder of the command line."""
    shutil.copytree(flown, ".", dirs_exist_ok=True)


def replayed(viso: Viso, *args: object) -> Any:
    outcome = viso("replay", *args, "--json")
    assert outcome.code == 0
    return json.loads(outcome.out)


def outcomes(rows: list[dict[str, Any]]) -> dict[tuple[str, str], int]:
    return {(row["message"], row["outcome"]): row["count"] for row in rows}


def test_trajectory_is_replayed(viso: Viso) -> None:
    answer = replayed(viso, *SHORT)
    assert answer["stream"] == "poses"
    assert outcomes(answer["verdicts"]) == {("HEARTBEAT", "handled"): 1, ("ODOMETRY", "accepted"): POSES}


@pytest.mark.parametrize("option", ["--as", "--message"])
def test_trajectory_may_be_sent_as_another_message(viso: Viso, option: str) -> None:
    answer = replayed(viso, *SHORT, option, "mocap", "--axes", "NED/FRD")
    assert outcomes(answer["verdicts"])["ATT_POS_MOCAP", "accepted"] == POSES


@pytest.mark.slow
def test_log_is_replayed_with_its_parameters(viso: Viso) -> None:
    outcome = viso("replay", LOG, "--json")
    assert outcomes(json.loads(outcome.out)["verdicts"]) == {("VISION_POSITION_ESTIMATE", "accepted"): 58}
    notes = outcome.err.splitlines()
    assert all(line.startswith("note: ") for line in notes)
    assert re.fullmatch(
        r"note: parameters of the recording without effect here: (\w+, ){7}\w+ and \d+ others", notes[-1]
    )


def test_set_tells_what_differs(viso: Viso) -> None:
    outcome = viso("replay", *SHORT, "--set", "VISO_QUAL_MIN=101", "--set", "VISO_DELAY_MS=80")
    assert outcome.code == 0
    assert outcome.out.startswith("VISO_QUAL_MIN: 0 -> 101\nVISO_DELAY_MS: 10 -> 80\n")
    assert "Verdicts of messages that differ in number" in outcome.out
    assert f"Of {POSES} messages that fared otherwise, the first" in outcome.out
    assert f"log records of {POSES} messages differ, first of message 2" in outcome.out
    assert "ArduPilot Ready" not in outcome.out


def test_set_for_machines(viso: Viso) -> None:
    answer = replayed(viso, *SHORT, "--set", "VISO_QUAL_MIN=101")
    assert answer["set"] == {"VISO_QUAL_MIN": 101}
    assert outcomes(answer["before"]["verdicts"])["ODOMETRY", "accepted"] == POSES
    assert outcomes(answer["after"]["verdicts"])["ODOMETRY", "ignored"] == POSES
    assert answer["differs"]["changed_messages"] == POSES
    assert answer["differs"]["first_messages"][0]["number"] == 2
    assert [row["rule"] for row in answer["differs"]["verdicts"]] == ["consumed", "quality_below_min"]


def test_files_are_those_of_the_second_run(viso: Viso) -> None:
    for name, args in (("both", ["--set", "VISO_SCALE=2"]), ("alone", ["--param", "VISO_SCALE=2"])):
        files = "--records", f"{name}.jsonl", "--log", f"{name}.BIN"
        assert viso("replay", *SHORT, *args, *files).code == 0
    assert Path("both.jsonl").read_bytes() == Path("alone.jsonl").read_bytes()
    assert Path("both.BIN").read_bytes() == Path("alone.BIN").read_bytes()


def test_parameter_that_needs_a_reboot_is_there_from_boot_on(viso: Viso) -> None:
    outcome = viso("replay", *SHORT, "--set", "VISO_TYPE=0", "--json")
    assert outcome.err == "note: a vehicle must be rebooted for VISO_TYPE; here it boots with the new value\n"
    assert outcomes(json.loads(outcome.out)["after"]["verdicts"])["ODOMETRY", "dropped"] == POSES


def test_parameters_that_need_a_reboot_are_known() -> None:
    assert needing_reboot(["VISO_TYPE", "VISO_SCALE", "NO_SUCH"], links=1) == ["VISO_TYPE"]


@pytest.mark.parametrize(("args", "line"), [
    (["--set", "VISO_TPYE=1"], "--set 'VISO_TPYE=1': unknown parameter VISO_TPYE"),
    (["--set", "VISO_SCALE"], "--set 'VISO_SCALE': not NAME=VALUE with a finite number"),
    (["--firmware", "3.2"], f"--firmware 3.2: no such profile; there are {', '.join(PROFILES)}"),
    (["--axes", "up"], "--axes: 'up' is neither WORLD/BODY"),
    (["--rate", "0"], "--rate 0: not between 0.1 and 1000"),
])  # fmt: skip
def test_option_that_cannot_be_used_is_one_line(viso: Viso, args: list[str], line: str) -> None:
    outcome = viso("replay", "poses.tum", *args)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith(f"viso: {line}")
    assert outcome.err.count("\n") == 1


def test_options_of_trajectories_are_refused_for_logs(viso: Viso) -> None:
    line = f"{LOG}: --as, --format, --topic, --times, --axes and --rate are for trajectories"
    assert failed_with(viso("replay", LOG, "--rate", "30"), line)


def test_telemetry_log_is_replayed_with_the_parameters_and_as_the_release_in_it(viso: Viso, tmp_path: Path) -> None:
    said = [(197, odometry(1 + number * 40_000)) for number in range(3)]
    recorded(tmp_path, beats(banner="ArduCopter V4.5.7"), listed(READY, MAVPROXY), said)
    outcome = viso("replay", "made.tlog", "--lead", "3", "--json")
    assert outcomes(json.loads(outcome.out)["verdicts"])["ODOMETRY", "accepted"] == 3
    assert json.loads(outcome.out)["firmware_reason"] == (
        "the banner says ArduCopter V4.5.7, and 4.6 is the nearest that is known here"
    )
    assert "note: ArduCopter V4.5.7 is older than 4.6: before 4.6 there is no VISO_QUAL_MIN" in outcome.err


def test_profile_of_the_firmware_may_be_named(viso: Viso) -> None:
    assert viso("replay", *SHORT, "--firmware", "2025-07").code == 0


def test_serve_refuses_unknown_firmware_before_it_touches_anything(viso: Viso) -> None:
    assert failed_with(
        viso("serve", "--firmware", "3.2"), f"--firmware 3.2: no such profile; there are {', '.join(PROFILES)}"
    )
    assert not Path("logs").exists()


def examples() -> list[str]:
    blocks = re.findall(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line.startswith("viso ")]


@pytest.mark.parametrize(
    "line", [pytest.param(line, marks=pytest.mark.slow if number else ()) for number, line in enumerate(examples())]
)
def test_example_of_the_page_works(viso: Viso, line: str) -> None:
    program, *args = shlex.split(line)
    outcome = viso(*args)
    assert (program, outcome.code) == ("viso", 0)
    assert outcome.out


def test_page_has_examples() -> None:
    assert len(examples()) >= 4
