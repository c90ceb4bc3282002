# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Remake the locks of the interop tests' clients: requirements/interop.lock with uv, and npm's."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from tools.lock_requirements import ROOT, UV

# What MAVProxy asks for and imports for its three-dimensional map alone; the first is very large.
LEFT_OUT = ("vtk", "quantized-mesh-tile", "shapely", "opencv-python")
OPTIONS = (
    "--quiet",
    "--upgrade",
    "--universal",
    "--python-version=3.11",
    "--fork-strategy=fewest",
    "--generate-hashes",
    "--no-emit-index-url",
    "--custom-compile-command=tools/interop --lock",
    "--output-file=requirements/interop.lock",
    *(f"--no-emit-package={name}" for name in LEFT_OUT),
)
# Without the addresses of archives, and without what only the compiler's users need.
NPM = (
    *("npm", "install", "--package-lock-only", "--ignore-scripts", "--no-audit", "--no-fund"),
    *("--legacy-peer-deps", "--omit-lockfile-registry-resolved"),
)


def remake() -> int:
    """Write both locks with the newest versions; return 0, or the exit code of the command that failed."""
    try:
        with tempfile.TemporaryDirectory(prefix="viso-lock-") as folder:
            _compile(Path(folder))
        subprocess.run(NPM, check=True, cwd=ROOT / "tools" / "interop_node")
    except subprocess.CalledProcessError as error:
        return int(error.returncode)
    return 0


def _compile(folder: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    subprocess.run([str(folder / "bin" / "pip"), "install", "--quiet", UV], check=True)
    subprocess.run(
        [str(folder / "bin" / "uv"), "pip", "compile", "requirements/interop.in", *OPTIONS], check=True, cwd=ROOT
    )
