# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Without the extras everything else works, and what does not says what to install."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import DATA, RECORDED

pytestmark = pytest.mark.slow  # a process each

EXTRAS = (
    "cv2",
    "gtsam",
    "rosbags",
    "matplotlib",
    "threadpoolctl",
    "filterpy",
    "pymap3d",
    "pyModeS",
    "starlette",
    "uvicorn",
    "pyarrow",
    "distributed",
    "scipy",
    "cyclonedds",
)
PROGRAM = """
import sys
sys.modules.update(dict.fromkeys({without!r}))
from viso.cli import main
main()
"""
FLIGHT = DATA / "trajectories" / "flight.tum"


def viso(*args: str, cwd: Path, without: tuple[str, ...] = EXTRAS) -> tuple[int, str]:
    """Return the exit code and the standard error of a command that finds none of the extras."""
    command = [sys.executable, "-c", PROGRAM.format(without=without), *args]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)
    return done.returncode, done.stderr


def test_recording_is_compared_and_told_on_a_page(tmp_path: Path) -> None:
    recording = str(RECORDED / "vectors" / "jitter_correction.jsonl.gz")
    assert viso("compare", recording, "--firmware", "2025-07", "-o", "page.html", cwd=tmp_path) == (0, "")


def test_trajectory_is_played(tmp_path: Path) -> None:
    assert viso("play", str(FLIGHT), "--until", "1", "-o", "out.tlog", cwd=tmp_path) == (0, "")


@pytest.mark.parametrize(
    "command",
    [
        ("vio", "synthetic"),
        ("demo", "--camera", "vio"),
    ],
)
def test_what_needs_an_extra_says_which(tmp_path: Path, command: tuple[str, ...]) -> None:
    code, err = viso(*command, cwd=tmp_path)
    assert code == 2
    assert err.startswith("viso: ")
    assert "pip install 'ardupilot-viso[vio]'" in err
    assert err.count("\n") == 1


def test_serving_ros_2_needs_an_extra_and_says_which(tmp_path: Path) -> None:
    code, err = viso("serve", "--dds", "0", "--master", "tcpin:127.0.0.1:0", cwd=tmp_path)
    assert (code, err.count("\n")) == (2, 1)
    assert err.startswith("viso: --dds: ")
    assert "pip install 'ardupilot-viso[ros2]'" in err


def test_landmarks_do_without_on_a_sphere_and_say_so(tmp_path: Path) -> None:
    assert viso("landmarks", "--demo", "--until", "1", "--frame", "spherical", cwd=tmp_path) == (0, "")
    code, err = viso("landmarks", "--demo", "--until", "1", cwd=tmp_path)
    assert code == 2
    assert "pip install 'ardupilot-viso[landmarks]'" in err
    assert err.count("\n") == 1


def test_estimate_of_the_receiver_needs_an_extra_and_says_which(tmp_path: Path) -> None:
    code, err = viso("landmarks", "--demo", "--until", "1", "--frame", "spherical", "--estimate", cwd=tmp_path)
    note, reason = err.splitlines()
    assert (code, note[:16]) == (2, "note: --estimate")
    assert reason.startswith("viso: ")
    assert "pip install 'ardupilot-viso[landmarks]'" in reason


def test_raw_frames_need_an_extra_and_say_which(tmp_path: Path) -> None:
    (tmp_path / "frames.txt").write_text("*8D4840D6202CC371C32CE0576098;\n")
    code, err = viso("landmarks", "frames.txt", "--frame", "spherical", cwd=tmp_path)
    assert (code, err.count("\n")) == (2, 1)
    assert "pip install 'ardupilot-viso[landmarks]'" in err
