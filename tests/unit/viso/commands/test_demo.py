# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso demo``: with either camera, what it prints and writes, what it needs, and how it is stopped."""

import json
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.companion.engine.compiled import inertial_engine
from viso.demo import odometry as demo_vio
from viso.demo.loop import Script, VehicleLoop
from viso.demo.odometry import VioDemo

SIMULATED = "--camera", "simulated"
VIO = "--camera", "vio"


def cut(monkeypatch: pytest.MonkeyPatch, end_s: float) -> None:
    """Cut the flights short, and what is to be done in them."""
    play = VehicleLoop.play

    def play_until(loop: VehicleLoop, script: Script, end_s: float, *told: Any) -> None:
        play(loop, [(time_s, act) for time_s, act in script if time_s < end_s], end_s, *told)

    monkeypatch.setattr(VehicleLoop, "play", play_until)
    monkeypatch.setattr("viso.demo.tracking_camera.END_S", end_s)
    monkeypatch.setattr("viso.demo.odometry.END_S", end_s)


@pytest.fixture(autouse=True)
def shortest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let flights end before they begin, where their course does not matter."""
    cut(monkeypatch, 1.0)


@pytest.fixture
def short(shortest: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let flights end soon after the filter has begun to aid."""
    cut(monkeypatch, 8.0)


def forget(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Let a library be missing."""
    for module in [module for module in sys.modules if module.split(".")[0] == name]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, name, None)


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_vio_camera_leaves_log_and_plot_and_one_table(viso: Viso) -> None:
    outcome = viso("demo", "--log-dir", "here")
    assert outcome.code == 0
    lines = outcome.out.splitlines()
    assert lines[0] == "What was said:"
    assert "   7.66 s  companion  (6) INIT -> TRACKING: good frames after the warm start" in lines
    assert [line for line in lines if line.startswith("The loop,")] == ["The loop, 0 m flown"]
    assert lines[-2:] == ["log:  here/00000001.BIN", "plot: here/00000001.png"]
    assert {path.name for path in Path("here").iterdir()} == {"00000001.BIN", "00000001.png", "LASTLOG.TXT"}


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_vio_camera_for_machines(viso: Viso) -> None:
    answer = json.loads(viso("demo", *VIO, "--no-plot", "--json").out)
    assert (answer["log"], answer["plot"]) == ("logs/00000001.BIN", None)
    assert {text["who"] for text in answer["texts"]} == {"autopilot", "companion"}
    assert answer["loop"]["sent"] == answer["loop"]["accepted"] == 7
    assert [span["mode"] for span in answer["aiding"]] == ["none", "absolute"]
    assert "fused" in {row["outcome"] for row in answer["filter"] if row["kind"] == "pose"}
    assert "consumed" in {row["rule"] for row in answer["verdicts"]}


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_simulated_camera_leaves_log_and_plot(viso: Viso) -> None:
    outcome = viso("demo", *SIMULATED, "--log-dir", "here")
    assert outcome.code == 0
    assert "PreArm: VisOdom: not healthy" in outcome.out
    assert "Outcome of each sample in the filter" in outcome.out
    assert outcome.out.splitlines()[-2:] == ["log:  here/00000001.BIN", "plot: here/00000001.png"]
    assert {path.name for path in Path("here").iterdir()} == {"00000001.BIN", "00000001.png", "LASTLOG.TXT"}


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_simulated_camera_for_machines(viso: Viso) -> None:
    answer = json.loads(viso("demo", *SIMULATED, "--no-plot", "--json").out)
    assert (answer["log"], answer["plot"]) == ("logs/00000001.BIN", None)
    assert {"VisOdom", "PreArm"} & {text["text"].split(":")[0] for text in answer["texts"]}
    assert {row["outcome"] for row in answer["filter"] if row["kind"] == "height"} == {"fused"}
    assert [span["mode"] for span in answer["aiding"]] == ["none", "absolute"]


@pytest.mark.slow
@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("camera", [SIMULATED, VIO])
def test_same_seed_writes_the_same_bytes(viso: Viso, camera: tuple[str, str]) -> None:
    for seed in ("7", "7", "8"):
        viso("demo", *camera, "--no-plot", "--seed", seed)
    first, second, other = (Path(f"logs/0000000{number}.BIN").read_bytes() for number in (1, 2, 3))
    assert first == second != other


def test_without_opencv_the_camera_is_simulated(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    forget(monkeypatch, "cv2")
    outcome = viso("demo", "--no-plot")
    assert outcome.code == 0
    assert (
        outcome.err == "the camera is simulated: OpenCV is missing; for a real one: pip install 'ardupilot-viso[vio]'\n"
    )
    assert "Outcome of each message" in outcome.out


def test_vio_camera_without_opencv_says_what_to_install(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    forget(monkeypatch, "cv2")
    line = (
        "--camera vio: OpenCV is missing; install it with: pip install 'ardupilot-viso[vio]'; --camera simulated works"
    )
    assert failed_with(viso("demo", *VIO), line)
    assert not Path("logs").exists()


@pytest.mark.parametrize("camera", [SIMULATED, pytest.param(VIO, marks=pytest.mark.slow)])
def test_without_matplotlib_says_what_to_install(
    viso: Viso, monkeypatch: pytest.MonkeyPatch, camera: tuple[str, str]
) -> None:
    forget(monkeypatch, "matplotlib")
    for module in ("viso.demo.plot", "viso.demo.loop_plot"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    outcome = viso("demo", *camera, "--json")
    assert outcome.code == 0
    assert outcome.err == "no plot: matplotlib is missing; install it with: pip install 'ardupilot-viso[plot]'\n"
    assert json.loads(outcome.out)["plot"] is None


@pytest.mark.slow
def test_other_missing_module_is_not_taken_for_matplotlib(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "viso.demo.plot", raising=False)
    monkeypatch.setitem(sys.modules, "ekf_stub.reports", None)
    with pytest.raises(ModuleNotFoundError, match=r"ekf_stub\.reports"):
        viso("demo", *SIMULATED)


@pytest.mark.slow
def test_strategy_that_is_not_there_is_one_line(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viso.companion.strategies.klt_ransac", None)
    outcome = viso("demo", *VIO)
    assert outcome.code == 2
    assert outcome.err.startswith("viso: strategy klt_ransac is not available: ")
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("option", ["--strategy", "--engine"])
def test_simulated_camera_has_no_odometry(viso: Viso, option: str) -> None:
    line = "--strategy, --engine: --camera simulated has no odometry"
    assert failed_with(viso("demo", *SIMULATED, option, "engine"), line)


@pytest.mark.slow
def test_engine_flies(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    cut(monkeypatch, 20.0)
    outcome = viso("demo", "--strategy", "engine", "--engine", inertial_engine(), "--no-plot", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    told = json.loads(outcome.out)
    assert told["loop"]["states"]["TRACKING"] > 5
    assert any(text["text"].endswith("is using external nav data") for text in told["texts"])


def test_camera_that_nobody_knows_is_refused(viso: Viso) -> None:
    assert viso("demo", "--camera", "pinhole").code == 2


def test_place_that_cannot_be_written_to_is_one_line(viso: Viso) -> None:
    Path("logs").touch()
    assert failed_with(viso("demo", *SIMULATED), "logs: File exists")


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_plot_that_cannot_be_written_is_one_line(viso: Viso) -> None:
    Path("logs/00000001.png").mkdir(parents=True)
    assert failed_with(viso("demo", *SIMULATED), "logs/00000001.png: Is a directory")


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_log_that_cannot_be_written_is_one_line(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_descriptor: int, _data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("viso.logs.files.os.write", refuse)
    monkeypatch.setattr("viso.logs.files.LogStore._write_lastlog", lambda *_args: None)
    assert failed_with(viso("demo", *SIMULATED), "logs/00000001.BIN: No space left on device")


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_ctrl_c_keeps_what_is_there(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    run = VioDemo.run

    def interrupted(self: VioDemo, on_progress: Callable[[float], None], stop: Callable[[], bool]) -> None:
        def tell(time_s: float) -> None:
            on_progress(time_s)
            if time_s == 3:
                signal.raise_signal(signal.SIGINT)

        run(self, tell, stop)

    monkeypatch.setattr(demo_vio.VioDemo, "run", interrupted)
    outcome = viso("demo", *VIO)
    assert outcome.code == 0
    assert outcome.err == "stopped at 3 s\n"
    assert Path("logs/00000001.BIN").stat().st_size > 10_000
    assert Path("logs/00000001.png").exists()


def test_simulated_flight_stops_as_well(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viso.commands.demo.stop_on_signal", Stopped)
    outcome = viso("demo", *SIMULATED, "--no-plot")
    assert (outcome.code, outcome.err) == (0, "stopped at 0 s\n")


class Stopped:
    """A signal that has come before the start."""

    def __enter__(self) -> list[int]:
        return [signal.SIGINT]

    def __exit__(self, *_: object) -> None:
        pass
