# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled modules are imported where they fit, and never for other sources."""

from pathlib import Path

import pytest

from ap_core import native
from ap_core.native import COMPILED, PURE_VARIABLE, digest, use_compiled


@pytest.fixture(autouse=True)
def _is_not_pure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PURE_VARIABLE, raising=False)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return a package of two modules, with what stands for their compiled ones."""
    for name in ("__init__.py", "first.py", "second.py"):
        (tmp_path / name).write_text(f"# {name}\n", encoding="utf-8")
    build = tmp_path / COMPILED / digest(tmp_path)
    build.mkdir(parents=True)
    (build / "first.so").touch()
    return tmp_path


def path_of(package: Path) -> list[str]:
    """Return the path of a package after its choice."""
    path = [str(package)]
    assert use_compiled("package", path) == (len(path) == 2)
    return path


def test_compiled_modules_are_found_before_their_sources(package: Path) -> None:
    assert path_of(package) == [str(package / COMPILED / digest(package)), str(package)]


def test_pure_variable_forces_the_sources(
    package: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv(PURE_VARIABLE, "1")
    assert path_of(package) == [str(package)]
    assert caplog.messages == []


@pytest.mark.parametrize("value", ["", "0"])
def test_pure_variable_can_say_no(package: Path, monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv(PURE_VARIABLE, value)
    assert len(path_of(package)) == 2


@pytest.mark.parametrize("change", ["edit", "add", "remove", "rename"])
def test_other_sources_run_interpreted_and_one_line_says_so(
    package: Path, change: str, caplog: pytest.LogCaptureFixture
) -> None:
    first = package / "first.py"
    if change == "edit":
        first.write_text("# other\n", encoding="utf-8")
    elif change == "add":
        (package / "third.py").touch()
    elif change == "remove":
        first.unlink()
    else:
        first.rename(package / "another.py")
    assert path_of(package) == [str(package)]
    (line,) = caplog.messages
    assert line.startswith("package runs interpreted")
    assert "tools/viso" in line


def test_another_python_has_nothing_compiled(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "EXTENSION_SUFFIXES", [".cpython-399-x86_64-linux-gnu.so"])
    assert path_of(package) == [str(package)]


def test_package_itself_may_be_edited(package: Path) -> None:
    (package / "__init__.py").write_text("# other\n", encoding="utf-8")
    assert len(path_of(package)) == 2


def test_sources_that_could_not_be_compiled_run_without_a_word(package: Path, caplog: pytest.LogCaptureFixture) -> None:
    (package / COMPILED / digest(package) / "first.so").unlink()
    assert path_of(package) == [str(package)]
    assert caplog.messages == []


def test_package_that_was_never_compiled_runs_without_a_word(package: Path, caplog: pytest.LogCaptureFixture) -> None:
    (package / COMPILED).rename(package / "elsewhere")
    assert path_of(package) == [str(package)]
    assert caplog.messages == []
