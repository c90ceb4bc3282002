# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The fuzzer's launcher refuses what it does not know before it installs anything."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tools import fuzz


@pytest.mark.parametrize("args", [[], ["nothing"], ["-max_total_time=1", "endpoint"]])
def test_unknown_target_is_a_usage_error(args: Sequence[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert fuzz.main(args) == 2
    assert "endpoint|files" in capsys.readouterr().err


def test_target_gets_both_corpora_and_the_options(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    lines: list[list[str]] = []

    def run(line: list[str], **_: Any) -> "subprocess.CompletedProcess[str]":
        lines.append(line)
        return subprocess.CompletedProcess(line, 77)

    monkeypatch.setattr(fuzz, "WORK", tmp_path)
    monkeypatch.setattr(fuzz, "environment", lambda: Path(sys.executable))
    monkeypatch.setattr(subprocess, "run", run)
    assert fuzz.main(["files", "-runs=5"]) == 77
    own = fuzz.ROOT / "tests" / "fuzz" / "corpus" / "files"
    assert lines[0][1:3] == [str(fuzz.ROOT / "tests" / "fuzz" / "fuzz.py"), "files"]
    assert lines[0][-3:] == ["-runs=5", str(tmp_path / "corpus" / "files"), str(own)]


def test_environment_that_cannot_be_made_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> Path:
        raise subprocess.CalledProcessError(1, "pip")

    monkeypatch.setattr(fuzz, "WORK", tmp_path)
    monkeypatch.setattr(fuzz, "environment", fail)
    assert fuzz.main(["files"]) == 2
    assert "no environment" in capsys.readouterr().err
