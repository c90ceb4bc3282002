# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Set-up runs once, again when its inputs change, and says in a line what went wrong."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tools import bootstrap
from tools.bootstrap import SetupError, Stamp

PYPROJECT = '[project]\nname = "x"\nversion = "1"\n[tool.ruff]\nline-length = 80\n'


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "requirements").mkdir()
    (tmp_path / "pyproject.toml").write_text(PYPROJECT, encoding="utf-8")
    for lock in bootstrap.LOCKS.values():
        (tmp_path / lock).write_text(f"# {lock}\n", encoding="utf-8")
    return tmp_path


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace every external step by one that only notes what it was for; making the venv makes a python."""
    done: list[str] = []

    def note(command: Sequence[str], what: str) -> None:
        done.append(what)
        if what.startswith("making"):
            _make_python(Path(command[-1]))

    monkeypatch.setattr(bootstrap, "run", note)
    return done


def _make_python(venv: Path) -> None:
    (venv / "bin").mkdir(parents=True)
    (venv / "bin" / "python").touch()


def test_first_run_makes_and_fills_the_environment(root: Path, steps: list[str]) -> None:
    assert bootstrap.ensure_environment(root, "run") == root / ".venv"
    assert steps == ["making .venv", "installing requirements/run.lock", "installing the project"]


def test_second_run_does_nothing(root: Path, steps: list[str]) -> None:
    bootstrap.ensure_environment(root, "dev")
    steps.clear()
    bootstrap.ensure_environment(root, "dev")
    bootstrap.ensure_environment(root, "run")
    assert steps == []


def test_checks_are_added_to_a_runtime_environment(root: Path, steps: list[str]) -> None:
    bootstrap.ensure_environment(root, "run")
    steps.clear()
    bootstrap.ensure_environment(root, "dev")
    assert steps == ["installing requirements/dev.lock", "installing the project"]


def test_changed_lock_rebuilds_with_the_tools_that_were_there(root: Path, steps: list[str]) -> None:
    bootstrap.ensure_environment(root, "dev")
    (root / "requirements/dev.lock").write_text("numpy==9\n", encoding="utf-8")
    steps.clear()
    bootstrap.ensure_environment(root, "run")
    assert steps[:2] == ["making .venv", "installing requirements/dev.lock"]


def test_interrupted_set_up_is_done_again(root: Path, steps: list[str]) -> None:
    bootstrap.write_stamp(root / ".venv", Stamp("", "", True))
    _make_python(root / ".venv")
    bootstrap.ensure_environment(root, "run")
    assert steps[0] == "making .venv"


def test_half_written_stamp_counts_as_interrupted(root: Path, steps: list[str]) -> None:
    _make_python(root / ".venv")
    (root / ".venv" / bootstrap.STAMP_NAME).write_text('{"profile"', encoding="utf-8")
    bootstrap.ensure_environment(root, "run")
    assert steps[0] == "making .venv"


def test_failed_step_leaves_an_environment_that_is_not_trusted(
    root: Path, steps: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bootstrap.ensure_environment(root, "run")

    def fail(command: Sequence[str], what: str) -> None:
        raise SetupError(what)

    (root / "requirements/run.lock").write_text("numpy==9\n", encoding="utf-8")
    with monkeypatch.context() as broken:
        broken.setattr(bootstrap, "run", fail)
        with pytest.raises(SetupError):
            bootstrap.ensure_environment(root, "run")
    steps.clear()
    bootstrap.ensure_environment(root, "run")
    assert steps[0] == "making .venv"


def test_environment_that_was_there_before_is_filled_but_never_deleted(root: Path, steps: list[str]) -> None:
    _make_python(root / ".venv")
    keep = root / ".venv" / "keep"
    keep.touch()
    bootstrap.ensure_environment(root, "run")
    (root / "requirements/run.lock").write_text("numpy==9\n", encoding="utf-8")
    bootstrap.ensure_environment(root, "run")
    assert steps == 2 * ["installing requirements/run.lock", "installing the project"]
    assert keep.exists()


def test_vanished_interpreter_rebuilds(root: Path, steps: list[str]) -> None:
    bootstrap.ensure_environment(root, "run")
    (root / ".venv/bin/python").unlink()
    steps.clear()
    bootstrap.ensure_environment(root, "run")
    assert steps[0] == "making .venv"


def test_digest_follows_packaging_and_ignores_lint_settings(root: Path) -> None:
    before = bootstrap.digest(root, "run")
    (root / "pyproject.toml").write_text(PYPROJECT.replace("80", "90"), encoding="utf-8")
    assert bootstrap.digest(root, "run") == before
    (root / "pyproject.toml").write_text(PYPROJECT.replace('"1"', '"2"'), encoding="utf-8")
    assert bootstrap.digest(root, "run") != before


def test_moved_project_is_set_up_again(root: Path, steps: list[str]) -> None:
    bootstrap.ensure_environment(root, "run")
    moved = root / "moved"
    shutil.copytree(root / ".venv", moved / ".venv")
    shutil.copytree(root / "requirements", moved / "requirements")
    shutil.copy(root / "pyproject.toml", moved)
    steps.clear()
    bootstrap.ensure_environment(moved, "run")
    assert steps[0] == "making .venv"


def test_failing_step_is_told_with_its_last_lines() -> None:
    script = "print('early'); print('\\n'.join('abcdef')); raise SystemExit(3)"
    with pytest.raises(SetupError) as caught:
        bootstrap.run([sys.executable, "-c", script], "trying")
    assert str(caught.value).splitlines() == ["trying failed (exit code 3):", *(f"    {c}" for c in "abcdef")]


def test_launch_returns_2_and_one_line_when_set_up_fails(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (root / "requirements/run.lock").unlink()
    assert bootstrap.launch("run", ["viso"], root) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("viso: ")
    assert "run.lock" in last


def test_launch_returns_130_when_interrupted(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(command: Sequence[str], what: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(bootstrap, "run", interrupt)
    assert bootstrap.launch("run", ["viso"], root) == 130


def test_launch_replaces_the_process_by_the_program(
    root: Path, steps: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, list[str]]] = []
    monkeypatch.setattr(os, "execv", lambda path, args: calls.append((path, args)))
    bootstrap.launch("run", ["viso", "demo"], root)
    program = str(root / ".venv/bin/viso")
    assert calls == [(program, [program, "demo"])]


def test_old_python_goes_on_in_a_newer_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[str] = []
    (tmp_path / "python3.12").symlink_to(sys.executable)
    shim = tmp_path / "python3.13"
    shim.write_text("#!/bin/sh\nexit 127\n", encoding="utf-8")
    shim.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(os, "execv", lambda path, args: calls.append(path))
    with pytest.raises(SetupError):  # the stand-in for execv comes back, the real one would not
        bootstrap.require_python((3, 10, 4))
    assert calls == [str(tmp_path / "python3.12")]


def test_old_python_without_a_newer_one_is_an_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SetupError, match=r"Python 3\.11 or newer is needed, this is 3\.10\.4"):
        bootstrap.require_python((3, 10, 4))


def test_second_set_up_waits_for_the_first(root: Path) -> None:
    script = "import sys; sys.path.insert(0, sys.argv[1]); import bootstrap; from pathlib import Path\n"
    script += "with bootstrap.only_one(Path(sys.argv[2])): print('in')"
    command = [sys.executable, "-c", script, str(Path(bootstrap.__file__).parent), str(root)]
    with bootstrap.only_one(root):
        other = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert other.stderr is not None
        assert "waiting" in other.stderr.readline()
        assert other.poll() is None
    out, _ = other.communicate(timeout=30)
    assert out == "in\n"


def test_stamp_survives_a_round_trip(tmp_path: Path) -> None:
    stamp = Stamp("dev", "abc", False)
    bootstrap.write_stamp(tmp_path / "venv", stamp)
    assert bootstrap.read_stamp(tmp_path / "venv") == stamp
    assert json.loads((tmp_path / "venv" / bootstrap.STAMP_NAME).read_text(encoding="utf-8"))["ours"] is False
