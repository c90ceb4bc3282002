# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pip install brings: our packages and nothing else of ours, not too much of others', and a program that works."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import pytest

from ap_core.native import PURE_VARIABLE
from tests.places import DATA, RECORDED, ROOT

OURS: Final = {"viso", "ap_core", "ap_visualodom", "ekf_stub", "mav_handlers"}
MOST_BYTES: Final = 250_000_000
TRAJECTORY: Final = str(DATA / "trajectories" / "flight.tum")
FLIGHT: Final = str(RECORDED / "captures" / "t265.jsonl.gz")
TEST: Final = """
import companion, emulator, tools
def test_of_its_own(extnav_autopilot):
    extnav_autopilot.advance(ms=100)
"""


def run(*command: str | Path, cwd: Path, **variables: str) -> str:
    """Return the output of a command that knows nothing of this checkout and of its environment."""
    hidden = {"PYTHONPATH", PURE_VARIABLE}
    environment: Mapping[str, str] = {name: value for name, value in os.environ.items() if name not in hidden}
    environment = {**environment, **variables}
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def make_wheel(folder: Path, **variables: str) -> Path:
    pip = [sys.executable, "-P", "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index"]
    run(*pip, "--wheel-dir", folder, ROOT, cwd=folder, **variables)
    (wheel,) = folder.glob("ardupilot_viso-*.whl")
    return wheel


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel that this machine makes."""
    return make_wheel(tmp_path_factory.mktemp("wheel"), MYPYC_OPT_LEVEL="0")  # to optimise takes most of the time


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory, wheel: Path) -> Path:
    """Return the programs of an environment into which the wheel, with no extra, has been installed."""
    folder = tmp_path_factory.mktemp("install")
    run(sys.executable, "-m", "venv", folder / "venv", cwd=folder)
    run(folder / "venv/bin/pip", "install", "--quiet", wheel, cwd=folder)
    return folder / "venv" / "bin"


def site_packages(programs: Path) -> Path:
    (folder,) = programs.parent.glob("lib/python3*/site-packages")
    return folder


@pytest.mark.slow
def test_environment_is_small(installed: Path) -> None:
    files = (path for path in installed.parent.rglob("*") if path.is_file() and not path.is_symlink())
    assert sum(path.stat().st_size for path in files) <= MOST_BYTES


@pytest.mark.slow
def test_header_for_engines_comes_with_it(installed: Path, tmp_path: Path) -> None:
    folder = Path(run(installed / "viso", "engine", cwd=tmp_path).rstrip("\n"))
    assert folder.is_relative_to(site_packages(installed))
    assert (folder / "viso_engine.hpp").is_file()


@pytest.mark.slow
def test_only_our_packages_come_with_it(installed: Path) -> None:
    site = site_packages(installed)
    (record,) = site.glob("ardupilot_viso-*.dist-info/RECORD")
    names = {line.partition("/")[0] for line in record.read_text().splitlines()}
    assert {name for name in names if name != ".." and not name.endswith(".dist-info")} == OURS


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_wheel_of_a_machine_with_a_compiler_is_for_such_machines_and_runs_compiled(
    wheel: Path, installed: Path, tmp_path: Path
) -> None:
    assert "-none-any" not in wheel.name
    assert "(filter: compiled)" in run(installed / "viso", "--version", cwd=tmp_path)
    assert "(filter: interpreted)" in run(installed / "viso", "--version", cwd=tmp_path, **{PURE_VARIABLE: "1"})


@pytest.mark.slow
@pytest.mark.parametrize("variables", [{PURE_VARIABLE: "1"}, {"CC": "no-such-compiler"}])
def test_wheel_without_a_compiler_is_for_all_machines(tmp_path: Path, variables: dict[str, str]) -> None:
    assert make_wheel(tmp_path, **variables).name.endswith("-py3-none-any.whl")


@pytest.mark.slow
@pytest.mark.parametrize("command", [
    ("--version",),
    ("demo", "--camera", "simulated"),
    ("serve", "--duration", "1", "--master", "udpin:127.0.0.1:0"),
    ("doctor", TRAJECTORY),
    ("replay", FLIGHT, "--ekf"),
])  # fmt: skip
def test_command_works_without_extras(installed: Path, tmp_path: Path, command: tuple[str, ...]) -> None:
    assert run(installed / "viso", *command, cwd=tmp_path)


@pytest.mark.slow
def test_project_with_folders_named_like_rooms_here_runs_its_tests(installed: Path, tmp_path: Path) -> None:
    for name in ("emulator", "companion", "tools", "tests"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    (tmp_path / "tests" / "test_own.py").write_text(TEST, encoding="utf-8")
    run(installed / "pip", "install", "--quiet", "pytest", cwd=tmp_path)
    assert "1 passed" in run(installed / "python", "-m", "pytest", "-q", cwd=tmp_path)
