# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso vio``: on videos, recordings and a link; what it leaves behind, and what it refuses."""

import json
import re
import shlex
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT, STATUSTEXT
from tests.places import ROOT
from tests.unit.viso.command_line import Outcome, Viso, failed_with
from tests.unit.viso.companion.sources.film_maker import write_calibration, write_film, write_inertial_csv
from viso.commands import vio as vio_command
from viso.companion.run import session as vio_session
from viso.companion.run.log import VioLog
from viso.companion.sources.base import SourceOptions
from viso.companion.sources.kinds import SOURCES, open_source
from viso.companion.vio import health
from viso.companion.vio.calibration import load_calibration
from viso.companion.vio.config import load_config
from viso.companion.vio.imu import IMU_EMPTY, IMU_GAP
from viso.companion.vio.types import VioState
from viso.geometry.trajectory import Trajectory
from viso.streams.readers import Source, load_trajectory

CLIP = ROOT.parent / "shared" / "data" / "euroc_mh01_clip"
PAGE = ROOT / "docs" / "companion.md"
REASONS = (
    *(health.NO_MODEL, health.INNOVATION_REFUSED, health.TOO_FEW_INLIERS, health.FEW_INLIERS, health.LOW_COVERAGE),
    *(health.HIGH_MRE, health.COVARIANCE_GROWTH, health.INNOVATION_RATIO, health.SCALE_UNOBSERVED),
)
FILM = ("film.avi", "--imu", "imu.csv", "--calibration", "small.toml")


@pytest.fixture
def film(viso: Viso, tmp_path: Path) -> Viso:
    """Return a function that runs the command on a video of 1.2 s of standing still."""
    write_film(tmp_path / "film.avi")
    write_calibration(tmp_path / "small.toml")
    write_inertial_csv(tmp_path / "imu.csv", 1.3)
    return lambda *args: viso("vio", *FILM, *args)


def test_figures_are_told_in_the_end(film: Viso) -> None:
    outcome = film()
    assert (outcome.code, outcome.err) == (0, "")
    for part in (
        "film.avi: klt_ransac, camera small; begins once it stands still",
        "film.avi: 12 frames in 1.1 s",
        "the truth is not known",
    ):
        assert part in outcome.out


def test_figures_for_machines_trajectory_and_events(film: Viso) -> None:
    outcome = film("--json", "--save-trajectory", "flight.tum", "--events", "events.jsonl")
    told = json.loads(outcome.out)
    assert (told["source"], told["strategy"], told["frames"]) == ("film.avi", "klt_ransac", 12)
    assert (told["ended"] != "INIT", told["plot"], told["trajectory"]) == (True, None, "flight.tum")
    assert told["path_m"] < 0.05
    # The trajectory is one that is read again.
    trajectory = load_trajectory(Source(Path("flight.tum")), "tum")
    assert trajectory.times_ns[-1] == 1_100_000_000
    assert abs(trajectory.positions).max() < 0.05
    assert '"event":"vio_ready"' in Path("events.jsonl").read_text()


@pytest.mark.slow
def test_plot_is_written(film: Viso) -> None:
    outcome = film("--plot", "flight.png")
    assert outcome.out.splitlines()[-1] == "plot: flight.png"
    assert Path("flight.png").read_bytes()[:4] == b"\x89PNG"


def test_frames_may_be_fewer_and_the_end_early(film: Viso) -> None:
    told = json.loads(film("--fps", "5", "--until", "0.7", "--json").out)
    assert told["frames"] == 4


def test_configuration_and_strategy_are_the_user_s(film: Viso) -> None:
    Path("vio.toml").write_text('[vio]\nstrategy = "okvis2"\n')
    line = "strategy okvis2 is not available: vio.engine.command, or --engine, has to name its program"
    assert failed_with(film("--config", "vio.toml"), line)
    assert json.loads(film("--config", "vio.toml", "--strategy", "klt_ransac", "--json").out)["frames"] == 12


def test_axes_of_the_imu_turn_the_attitude(film: Viso, tmp_path: Path) -> None:
    write_inertial_csv(tmp_path / "imu.csv", 1.3, gravity=(0.0, 0.0, -9.81))  # x ahead, y right, z down
    assert film("--imu-axes", "FRD", "--save-trajectory", "flight.tum").code == 0
    quat = load_trajectory(Source(Path("flight.tum"))).quats_wxyz[-1]
    assert quat[0] == pytest.approx(1.0, abs=1e-3)


def test_truth_is_compared_with(film: Viso) -> None:
    Path("truth.tum").write_text("".join(f"{t / 10} {t / 1000} 0 0 0 0 0 1\n" for t in range(20)))
    told = json.loads(film("--truth", "truth.tum", "--json").out)
    assert 0 < told["ate_m"] < 0.02


def test_missing_matplotlib_is_told_and_the_rest_done(film: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "viso.companion.run.plot", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    outcome = film("--plot", "flight.png", "--save-trajectory", "flight.tum", "--json")
    assert outcome.code == 0
    assert outcome.err.splitlines()[-1] == (
        "no plot: matplotlib is missing; install it with: pip install 'ardupilot-viso[plot]'"
    )
    assert (json.loads(outcome.out)["plot"], Path("flight.tum").exists()) == (None, True)


def test_missing_opencv_is_one_line(viso: Viso, film: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    assert failed_with(film(), "pictures need OpenCV: pip install 'ardupilot-viso[vio]'")
    for name in [name for name in sys.modules if name.startswith(("viso.companion.strategies", "viso.companion.klt"))]:
        monkeypatch.delitem(sys.modules, name)
    outcome = viso("vio", "0", "--calibration", "small.toml", "--master", "none")
    assert outcome.code == 2
    assert outcome.err.startswith("viso: strategy klt_ransac is not available: ")
    assert outcome.err.endswith("; pip install 'ardupilot-viso[vio]'\n")


def test_losing_the_way_is_exit_code_1(film: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    summary = VioLog.summary

    def lost(log: VioLog, truth: Trajectory | None) -> dict[str, Any]:
        return summary(log, truth) | {"ended": VioState.LOST.value}

    monkeypatch.setattr(VioLog, "summary", lost)
    assert film("--save-trajectory", "flight.tum").code == 1
    assert Path("flight.tum").exists()


@pytest.mark.slow
def test_interrupted_flight_is_written(film: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted(list[int]):
        """Becomes full after a while, as when a signal comes."""

        asked = 0

        def __bool__(self) -> bool:
            Interrupted.asked += 1
            return Interrupted.asked > 200

    class Context:
        def __enter__(self) -> Interrupted:
            return Interrupted()

        def __exit__(self, *_: object) -> None:
            pass

    monkeypatch.setattr(vio_command, "stop_on_signal", Context)
    outcome = film("--save-trajectory", "flight.tum", "--plot", "flight.png", "--json")
    assert outcome.code == 0
    assert 5 < json.loads(outcome.out)["frames"] < 12
    assert Path("flight.tum").stat().st_size > 0
    assert Path("flight.png").exists()


def test_figures_of_each_frame_are_shown_on_a_terminal(film: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = StringIO()
    monkeypatch.setattr(vio_command, "out", Console(file=terminal, force_terminal=True, width=120))
    assert film().code == 0
    assert "inliers" in terminal.getvalue()


# On a link


@pytest.fixture
def linked(film: Viso, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that runs the command over a wire on which a vehicle has said something."""
    vehicle, ours = make_pair(("vehicle", "pair"))
    monkeypatch.setattr(vio_session, "open_link", lambda _name: ours)

    def run(*args: object) -> Outcome:
        vehicle.send(b"".join(map(Codec(1, 1).encode, (HEARTBEAT(2, 3, 0, 0, 4, 3), STATUSTEXT(6, "Ready")))))
        return film("--master", "pair", "--until", "0.1", *args)

    return run


def test_texts_and_counts_of_a_vehicle_are_shown(linked: Any) -> None:
    outcome = linked()
    assert (outcome.code, outcome.err) == (0, "")
    assert "(6) Ready" in outcome.out
    assert "HEARTBEAT" in outcome.out


def test_texts_and_counts_of_a_vehicle_for_machines(linked: Any) -> None:
    told = json.loads(linked("--json").out)
    assert told["texts"] == [{"severity": 6, "text": "Ready"}]
    assert told["sent"]["HEARTBEAT"] == 1


def test_real_time_without_a_vehicle_is_possible(film: Viso) -> None:
    assert film("--realtime", "--until", "0.1").code == 0


# What is refused


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (["--fps", "0"], "--fps 0: not between 0.1 and 1000"),
        (["--until", "-1"], "--until -1: not between 0 and 4e+09"),
        (["--wait", "nan"], "--wait nan: not between 0 and 4e+09"),
        (["--delay", "-1"], "--delay -1: not between 0 and 86400"),
        (["--imu-start", "nan"], "--imu-start nan: not between -4e+09 and 4e+09"),
        (["--source", "x"], f"no source 'x'; there are {', '.join(SOURCES)}"),
        (["--imu-axes", "XYZ"], "axes of the IMU: 'XYZ' are not three perpendicular axes, such as ENU or FRD"),
        (["--mounting", "1"], "--mounting: '1': 3, 4 or 9 numbers make a rotation, not 1"),
        (["--config", "none.toml"], "none.toml: No such file or directory"),
        (["--truth", "none.tum"], "none.tum: No such file or directory"),
        (["--imu", "none.csv"], "none.csv: No such file or directory"),
        (["--calibration", "none.toml"], "none.toml: No such file or directory"),
        (["--strategy", "x"], "strategy 'x' is none of klt_ransac, fixed_lag, okvis2, vins_mono, engine"),
        (["--strategy", "fixed_lag", "--engine", "x"], "--engine: fixed_lag is none of engine, okvis2, vins_mono"),
        (["--engine", "false"], "strategy engine is not available: false: ended with exit code 1"),
        (["--plot", "none/a.png"], "none/a.png: No such file or directory"),
        (["--save-trajectory", "."], ".: Is a directory"),
        (["--master", "x", "--no-realtime"], "--no-realtime: neither a camera nor a vehicle can be hurried"),
    ],
)
def test_option_that_cannot_be_used_is_one_line(film: Viso, args: list[str], line: str) -> None:
    assert failed_with(film(*args), line)


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (["none.mp4"], "none.mp4: No such file or directory"),
        (["."], ".: no cam0/sensor.yaml or cam0_sensor.yaml"),
        (["synthetic:x"], "synthetic:x: 'x' is no seed"),
        (["0"], "camera 0: --calibration FILE is missing"),
        (
            ["0", "--calibration", "small.toml"],
            "--master STRING is missing: the IMU that goes with a camera is the auto",
        ),
    ],
)
def test_source_that_cannot_be_used_is_one_line(viso: Viso, tmp_path: Path, args: list[str], line: str) -> None:
    write_calibration(tmp_path / "small.toml")
    outcome = viso("vio", *args)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith(f"viso: {line}")
    assert outcome.err.count("\n") == 1


@pytest.mark.slow
@pytest.mark.skipif(not CLIP.exists(), reason=f"{CLIP.name} is not there")
def test_recorded_clip_is_followed(viso: Viso) -> None:
    told = json.loads(viso("vio", CLIP, "--until", "3", "--json").out)
    assert told["frames"] == 30
    assert told["ate_m"] < 0.05
    assert told["ended"] in ("TRACKING", "DEGRADED")


# The page about it


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, marks=pytest.mark.slow if re.search(r"--plot|fixed_lag", command) else ())
        for command in re.findall(r"^viso vio [^`\n]+", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    ],
)
def test_command_of_the_page_works(film: Viso, viso: Viso, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    # In the place of data and devices that only their owners have.
    ours = SourceOptions("film.avi", Path("small.toml"), Path("imu.csv"))
    monkeypatch.setattr(vio_command, "open_source", lambda _options, _kind: open_source(ours))
    _, wire = make_pair()
    monkeypatch.setattr(vio_session, "open_link", lambda _name: wire)
    for name in re.findall(r"--config (\S+)", command):
        Path(name).write_text("[vio]\n")
    program, *args = shlex.split(command)
    outcome = viso(*args, "--until", "0.1", "--wait", "0", "--delay", "0")
    assert (program, outcome.code, outcome.err) == ("viso", 0, "")


@pytest.mark.parametrize("block", re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL))
def test_file_of_the_page_is_one(tmp_path: Path, block: str) -> None:
    path = tmp_path / "file.toml"
    path.write_text(block)
    assert load_config(path) if block.startswith("[vio]") else load_calibration(path)


@pytest.mark.parametrize("reason", [*REASONS, IMU_EMPTY, IMU_GAP, health.WAITING])
def test_page_explains_every_reason(reason: str) -> None:
    rows = PAGE.read_text(encoding="utf-8").partition("| reason |")[2].partition("\n\n")[0]
    assert f"`{reason}`" in rows
