# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where figures come from: the machine, what runs on it, and the commit."""

import os
import platform
import re
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from viso.vehicle.kernels import chosen_kernel

ROOT: Final = Path(__file__).resolve().parents[2]
PACKAGES: Final = ("numpy", "pymavlink", "numpy-quaternion", "numba")
_CPU_INFO: Final = Path("/proc/cpuinfo")
_MODEL: Final = re.compile(r"^model name\s*:\s*(.+)$", re.MULTILINE)
_HEAD: Final = "ref: "


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def machine() -> Mapping[str, object]:
    """Return what the machine is."""
    model = _MODEL.search(_text(_CPU_INFO))
    processor = model[1].strip() if model else platform.processor() or platform.machine()
    return {"processor": processor, "cores": os.cpu_count(), "system": platform.platform()}


def versions() -> Mapping[str, str]:
    """Return the versions of Python and of the packages that matter; those that are not installed are left out."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def commit(root: Path = ROOT) -> str | None:
    """Return the commit of a checkout, None where there is none; what has changed since is not looked at."""
    git = root / ".git"
    pointer = _text(git) if git.is_file() else ""  # of a work tree
    if pointer.startswith("gitdir: "):
        git = root / pointer.removeprefix("gitdir: ").strip()
    head = _text(git / "HEAD").strip()
    if not head.startswith(_HEAD):
        return head or None
    name = head.removeprefix(_HEAD)
    common = git / (_text(git / "commondir").strip() or ".")
    return _text(git / name).strip() or _text(common / name).strip() or _packed(common / "packed-refs", name)


def _packed(path: Path, name: str) -> str | None:
    lines = (line.split(" ") for line in _text(path).splitlines())
    return next((parts[0] for parts in lines if len(parts) == 2 and parts[1] == name), None)


def about() -> dict[str, object]:
    """Return where the figures of this process come from."""
    return {
        "machine": dict(machine()),
        "versions": dict(versions()),
        "commit": commit(),
        "kernel": chosen_kernel(),
    }
