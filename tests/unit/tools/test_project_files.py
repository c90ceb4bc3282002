# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The file list holds the project's own files, with git and without."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tools.project_files import project_files

OURS = [Path(".ci/run"), Path("a/b.py"), Path("pyproject.toml")]
NOT_OURS = [Path(".venv/lib/x.py"), Path("a/__pycache__/b.pyc"), Path(".mypy_cache/x"), Path("v.egg-info/x")]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name in OURS + NOT_OURS:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x", encoding="utf-8")
    return tmp_path


def test_walk_leaves_out_environments_and_caches(tree: Path) -> None:
    assert project_files(tree) == OURS


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_git_lists_tracked_and_new_files_but_no_ignored_ones(tree: Path) -> None:
    (tree / ".gitignore").write_text(".*/\n!.ci/\n__pycache__/\n*.egg-info/\n", encoding="utf-8")
    subprocess.run(["git", "init", "--quiet", str(tree)], check=True)
    subprocess.run(["git", "-C", str(tree), "add", "pyproject.toml"], check=True)
    assert project_files(tree) == sorted([*OURS, Path(".gitignore")])


def test_a_broken_git_directory_falls_back_to_walking(tree: Path) -> None:
    (tree / ".git").mkdir()
    assert project_files(tree) == OURS
