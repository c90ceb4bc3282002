# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where figures say that they come from."""

from pathlib import Path

import pytest

from viso.bench.about import about, commit

SHA = "0123456789abcdef0123456789abcdef01234567"


def checkout(root: Path, **files: str) -> Path:
    for name, text in files.items():
        path = root / ".git" / name.replace("__", "/").replace("_", "-")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root


@pytest.mark.parametrize(
    "files",
    [
        {"HEAD": SHA + "\n"},
        {"HEAD": "ref: refs/heads/main\n", "refs__heads__main": SHA + "\n"},
        {
            "HEAD": "ref: refs/heads/main\n",
            "packed_refs": f"# pack-refs\n{SHA[::-1]} refs/heads/m\n{SHA} refs/heads/main\n",
        },
    ],
)
def test_commit_is_that_of_the_checkout(files: dict[str, str], tmp_path: Path) -> None:
    assert commit(checkout(tmp_path, **files)) == SHA


def test_commit_of_a_work_tree_is_its_own(tmp_path: Path) -> None:
    checkout(
        tmp_path,
        refs__heads__side=SHA,
        worktrees__side__HEAD="ref: refs/heads/side",
        worktrees__side__commondir="../..",
    )
    tree = tmp_path / "side"
    tree.mkdir()
    (tree / ".git").write_text(f"gitdir: {tmp_path}/.git/worktrees/side\n", encoding="utf-8")
    assert commit(tree) == SHA


def test_there_is_no_commit_without_a_checkout(tmp_path: Path) -> None:
    assert commit(tmp_path) is None
    assert commit(checkout(tmp_path, HEAD="ref: refs/heads/unborn")) is None


def test_machine_and_versions_are_told() -> None:
    told = about()
    assert set(told) == {"machine", "versions", "commit", "kernel"}
