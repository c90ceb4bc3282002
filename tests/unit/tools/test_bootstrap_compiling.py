# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A checkout is compiled by its first command, again after an edit, and not tried again in vain."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from tools import bootstrap
from tools.bootstrap import SetupError


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a project with an environment and a source to compile."""
    for name in ("pack/core/first.py", "ap_core/native.py", bootstrap.COMPILE_PROGRAM, ".venv/bin/python"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.setattr(bootstrap, "COMPILED_PACKAGE", "pack/core")
    monkeypatch.delenv("VISO_PURE", raising=False)
    return tmp_path


class Compiler:
    """Stands in for the program that compiles.

    Attributes:
        runs: how often it ran.
        reason: why it fails; empty when it does not.
    """

    def __init__(self) -> None:
        self.runs = 0
        self.reason = ""

    def run(self, command: Sequence[str], what: str) -> None:
        self.runs += 1
        *_, root, _, target = command
        (Path(root) / target / "_compiled").mkdir(exist_ok=True)
        if self.reason:
            raise SetupError(f"{what} failed (exit code 1):\n    a line\n    {self.reason}")


@pytest.fixture
def compiler(monkeypatch: pytest.MonkeyPatch) -> Compiler:
    compiler = Compiler()
    monkeypatch.setattr(bootstrap, "run", compiler.run)
    return compiler


def ensure_compiled(root: Path) -> None:
    bootstrap.ensure_compiled(root, root / ".venv")


def test_first_command_compiles_and_says_how_long_it_took(
    root: Path, compiler: Compiler, capsys: pytest.CaptureFixture[str]
) -> None:
    ensure_compiled(root)
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "viso: compiling the filter, once, takes about a minute ... done in 0 s"
    ensure_compiled(root)
    assert compiler.runs == 1
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("name", ["pack/core/first.py", "pack/core/new.py", bootstrap.COMPILE_PROGRAM])
def test_edited_source_is_compiled_anew(root: Path, compiler: Compiler, name: str) -> None:
    ensure_compiled(root)
    (root / name).write_text("# edited\n", encoding="utf-8")
    ensure_compiled(root)
    assert compiler.runs == 2


def test_another_mypy_compiles_anew(root: Path, compiler: Compiler) -> None:
    ensure_compiled(root)
    (root / ".venv/lib/python3.11/site-packages/mypy-9.9.dist-info").mkdir(parents=True)
    ensure_compiled(root)
    assert compiler.runs == 2


def test_failure_is_told_in_one_line_and_not_repeated(
    root: Path, compiler: Compiler, capsys: pytest.CaptureFixture[str]
) -> None:
    compiler.reason = "there is no C compiler cc"
    ensure_compiled(root)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(" ... not done, going on interpreted: there is no C compiler cc")
    ensure_compiled(root)
    assert compiler.runs == 1
    assert capsys.readouterr().err == ""


def test_failure_is_tried_again_with_another_compiler(
    root: Path, compiler: Compiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler.reason = "there is no C compiler cc"
    ensure_compiled(root)
    program = root / "programs" / "gcc"
    program.parent.mkdir()
    program.touch(mode=0o755)
    monkeypatch.setenv("PATH", str(program.parent))
    compiler.reason = ""
    ensure_compiled(root)
    assert compiler.runs == 2


def test_another_compiler_alone_is_no_reason_to_compile_again(
    root: Path, compiler: Compiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    ensure_compiled(root)
    monkeypatch.setenv("CC", "another")
    ensure_compiled(root)
    assert compiler.runs == 1


def test_interrupted_compiling_is_done_again(root: Path, compiler: Compiler, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(command: Sequence[str], what: str) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as interrupted:
        interrupted.setattr(bootstrap, "run", interrupt)
        with pytest.raises(KeyboardInterrupt):
            ensure_compiled(root)
    ensure_compiled(root)
    assert compiler.runs == 1


def test_nothing_is_compiled_where_the_sources_are_asked_for(
    root: Path, compiler: Compiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VISO_PURE", "1")
    ensure_compiled(root)
    assert compiler.runs == 0


def test_project_without_a_package_to_compile_is_left_alone(root: Path, compiler: Compiler) -> None:
    shutil.rmtree(root / "pack")
    ensure_compiled(root)
    assert compiler.runs == 0


def test_only_one_process_compiles(root: Path, compiler: Compiler, monkeypatch: pytest.MonkeyPatch) -> None:
    """GIVEN that another process compiles first, WHEN this one gets its turn, THEN nothing is left to do."""
    ensure_compiled(root)
    answers = iter([False, True])
    monkeypatch.setattr(bootstrap, "_is_tried", lambda *_: next(answers))
    ensure_compiled(root)
    assert compiler.runs == 1
