# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiling leaves whole modules, or an empty folder and a reason; nothing when it is interrupted."""

import os
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path

import pytest

from ap_core.native import COMPILED, PURE_VARIABLE, digest
from tests.places import ROOT
from tools import compile_native

PACKAGE = Path("pack/core")
INIT = "from ap_core.native import use_compiled\nIS_COMPILED = use_compiled(__name__, __path__)\n"
FIRST = "def third(value: float) -> float:\n    return value / 3.0\n"
SECOND = "from pack.core.first import third\n\n\ndef ninth(value: float) -> float:\n    return third(third(value))\n"
ASK = "from pack.core import IS_COMPILED, second; print(IS_COMPILED, second.__file__[-3:], second.ninth(1.0).hex())"


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a project with a package of two modules; it is the current folder, as in the program."""
    folder = tmp_path / PACKAGE
    folder.mkdir(parents=True)
    (tmp_path / "pack" / "__init__.py").touch()
    for name, text in {"__init__": INIT, "first": FIRST, "second": SECOND}.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(PURE_VARIABLE, raising=False)
    return tmp_path


@pytest.fixture
def builds(root: Path) -> Path:
    """Return the folder of what is compiled, which holds what other sources and a killed run left."""
    for name in ("old", "draft-killed"):
        (root / PACKAGE / COMPILED / name).mkdir(parents=True)
        (root / PACKAGE / COMPILED / name / "first.so").touch()
    return root / PACKAGE / COMPILED


def compile_by(monkeypatch: pytest.MonkeyPatch, stand_in: Callable[[], None]) -> None:
    """Have a function stand in for the compilers, which then leave one module."""

    def compiled(package: Path, draft: Path) -> Path:
        stand_in()
        folder = draft / "lib"
        folder.mkdir()
        (folder / "first.so").touch()
        return folder

    monkeypatch.setattr(compile_native, "_require_tools", lambda: None)
    monkeypatch.setattr(compile_native, "_compile", compiled)


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_compiled_modules_replace_all_earlier_ones(root: Path, builds: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_by(monkeypatch, lambda: None)
    compile_native.main(root, PACKAGE, PACKAGE)
    assert names_in(builds) == [digest(PACKAGE)]
    assert names_in(builds / digest(PACKAGE)) == ["first.so"]


def test_failure_leaves_an_empty_folder(root: Path, builds: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_by(monkeypatch, lambda: sys.exit("first.py:1: error: no"))
    with pytest.raises(SystemExit, match="error: no"):
        compile_native.main(root, PACKAGE, PACKAGE)
    assert names_in(builds) == [digest(PACKAGE)]
    assert names_in(builds / digest(PACKAGE)) == []


def test_interruption_leaves_everything_as_it_was(root: Path, builds: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    compile_by(monkeypatch, interrupt)
    with pytest.raises(KeyboardInterrupt):
        compile_native.main(root, PACKAGE, PACKAGE)
    assert names_in(builds) == ["draft-killed", "old"]


def test_source_that_changes_meanwhile_is_not_taken_for_compiled(
    root: Path, builds: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = digest(PACKAGE)
    compile_by(monkeypatch, lambda: (PACKAGE / "first.py").unlink())
    with pytest.raises(SystemExit, match="changed meanwhile"):
        compile_native.main(root, PACKAGE, PACKAGE)
    assert not {before, digest(PACKAGE)} & set(names_in(builds))


def test_missing_compiler_is_the_reason(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -pthread")
    with pytest.raises(SystemExit, match="no C compiler no-such-compiler"):
        compile_native.main(root, PACKAGE, PACKAGE)


def test_missing_header_of_python_is_the_reason(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", sys.executable)
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(root))
    with pytest.raises(SystemExit, match=r"no .*Python\.h"):
        compile_native.main(root, PACKAGE, PACKAGE)


def test_nothing_is_compiled_where_the_sources_are_asked_for(
    root: Path, builds: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(PURE_VARIABLE, "1")
    with pytest.raises(SystemExit, match=PURE_VARIABLE):
        compile_native.main(root, PACKAGE, PACKAGE)
    assert names_in(builds) == ["draft-killed", "old"]


@pytest.mark.slow
def test_modules_are_compiled_together_and_compute_the_same(root: Path) -> None:
    program = [sys.executable, "-P", str(ROOT / "tools" / "compile_native.py")]
    environment = {**os.environ, "MYPYC_OPT_LEVEL": "0"}  # to optimise takes most of the time
    subprocess.run([*program, str(root), str(PACKAGE), str(PACKAGE)], check=True, cwd=ROOT, env=environment)
    assert asked(root) == f"True .so {(1 / 9).hex()}\n"
    assert asked(root, **{PURE_VARIABLE: "1"}) == f"False .py {(1 / 9).hex()}\n"
    (root / PACKAGE / "first.py").write_text(FIRST.replace("3.0", "4.0"), encoding="utf-8")
    assert asked(root) == f"False .py {(1 / 16).hex()}\n"


def asked(root: Path, **variables: str) -> str:
    environment = {**os.environ, "PYTHONPATH": f"{root}{os.pathsep}{ROOT}", **variables}
    return subprocess.run(
        [sys.executable, "-c", ASK], env=environment, check=True, capture_output=True, text=True
    ).stdout
