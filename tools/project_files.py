# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""List the files that belong to the project, with or without git."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NOT_OURS = {"__pycache__", "build", "dist", "logs", "site"}
DOT_NAMES = {".ci", ".github", ".gitignore", ".gitattributes"}


def project_files(root: Path = ROOT) -> list[Path]:
    """Return all files under `root` that are tracked or would be, relative to it and sorted.

    git decides when it is there and `root` is a working tree; otherwise the tree is walked, without
    caches, environments and other dot names.
    """
    listed = _from_git(root) if (root / ".git").exists() else None
    names = _from_walk(root) if listed is None else listed
    return sorted(name for name in names if (root / name).is_file())


def _from_git(root: Path) -> list[Path] | None:
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    try:
        done = subprocess.run(command, cwd=root, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return [Path(os.fsdecode(name)) for name in done.stdout.split(b"\0") if name]


def _from_walk(root: Path) -> list[Path]:
    found: list[Path] = []
    for folder, subfolders, names in os.walk(root):
        subfolders[:] = [name for name in subfolders if _is_ours(name)]
        found += [Path(folder, name).relative_to(root) for name in names if _is_ours(name)]
    return found


def _is_ours(name: str) -> bool:
    if name.startswith("."):
        return name in DOT_NAMES
    return name not in NOT_OURS and not name.endswith((".egg-info", ".pyc"))
