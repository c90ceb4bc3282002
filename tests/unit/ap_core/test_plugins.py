# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that other distributions add to a table: they are there, or one line says why not."""

import logging
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from ap_core import plugins
from ap_core.plugins import with_plugins

GROUP = "viso.test_rows"
OWN: Mapping[str, str] = {"own": "a row of ours"}

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Return what makes a distribution with one module, to be found on the path."""
    monkeypatch.setattr(plugins, "_read", {})

    def install(name: str, code: str, *points: str) -> None:
        folder = tmp_path / name
        info = folder / f"{name}-1.5.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n", encoding="utf-8")
        (info / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *points]) + "\n", encoding="utf-8")
        (folder / f"{name}.py").write_text(code, encoding="utf-8")
        monkeypatch.syspath_prepend(folder)
        monkeypatch.delitem(sys.modules, name, raising=False)

    return install


def told(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


def test_rows_come_after_our_own(install: Install, caplog: pytest.LogCaptureFixture) -> None:
    install("plug_a", "ROW = 'theirs'", "their row = plug_a:ROW")
    assert list(with_plugins(GROUP, OWN, str).items()) == [("own", "a row of ours"), ("their row", "theirs")]
    assert told(caplog) == []


@pytest.mark.parametrize(("code", "reason"), [
    ("import no_such_library", "ModuleNotFoundError: No module named 'no_such_library'"),
    ("raise ValueError('one\\ntwo')", "ValueError: one two"),
    ("", "AttributeError: module 'plug_b' has no attribute 'ROW'"),
    ("ROW = 7", "plug_b:ROW is no str"),
])  # fmt: skip
def test_row_that_cannot_be_had_is_one_line_and_the_others_are_there(
    install: Install, caplog: pytest.LogCaptureFixture, code: str, reason: str
) -> None:
    install("plug_b", code, "broken = plug_b:ROW")
    install("plug_c", "ROW = 'fine'", "fine = plug_c:ROW")
    assert with_plugins(GROUP, OWN, str) == {**OWN, "fine": "fine"}
    assert told(caplog) == [f"plug-in broken ({GROUP}) of plug_b 1.5 left out: {reason}"]


def test_name_that_is_taken_stays_with_its_owner(install: Install, caplog: pytest.LogCaptureFixture) -> None:
    install("plug_d", "ROW = 'theirs'", "own = plug_d:ROW")
    assert with_plugins(GROUP, OWN, str) == OWN
    reason = "the name is taken by one that is built in"
    assert told(caplog) == [f"plug-in own ({GROUP}) of plug_d 1.5 left out: {reason}"]


def test_of_two_with_one_name_the_first_stays(install: Install, caplog: pytest.LogCaptureFixture) -> None:
    for name in ("plug_e", "plug_f"):
        install(name, f"ROW = {name!r}", f"row = {name}:ROW")
    rows = with_plugins(GROUP, OWN, str)
    other = ({"plug_e", "plug_f"} - {rows["row"]}).pop()
    assert told(caplog) == [f"plug-in row ({GROUP}) of {other} 1.5 left out: the name is taken"]


def test_entry_points_are_read_once(install: Install, caplog: pytest.LogCaptureFixture) -> None:
    install("plug_g", "", "broken = plug_g:ROW")
    for _ in range(2):
        assert with_plugins(GROUP, OWN, str) == OWN
    assert len(told(caplog)) == 1
