# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Remake requirements/*.lock from pyproject.toml, with uv in a throw-away environment.

Pins that still satisfy pyproject.toml stay; `--upgrade` moves all of them to the newest. `--clients` remakes
the locks of the interop tests' clients instead, requirements/interop.lock and npm's, with the newest versions.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
UV = "uv==0.13.8"
RUN_EXTRAS = ("bags", "landmarks", "plot", "sweep", "vio", "web")
"""What the commands of the README take; the other extras are large, and for few."""
OPTIONS = (
    "--quiet",
    "--universal",
    "--python-version=3.11",
    "--fork-strategy=fewest",  # one version for all Pythons: the same numbers everywhere
    "--generate-hashes",
    "--no-emit-index-url",
)
RUN_OPTIONS = (
    "pyproject.toml",
    "--custom-compile-command=tools/lock",
    *(f"--extra={name}" for name in RUN_EXTRAS),
    "--group=build",
)
# What MAVProxy asks for and imports for its three-dimensional map alone; the first is very large.
LEFT_OUT = ("vtk", "quantized-mesh-tile", "shapely", "opencv-python")
CLIENT_OPTIONS = (
    "requirements/interop.in",
    "--upgrade",
    "--custom-compile-command=tools/lock --clients",
    "--output-file=requirements/interop.lock",
    *(f"--no-emit-package={name}" for name in LEFT_OUT),
)
# Without the addresses of archives, and without what only the compiler's users need.
NPM = (
    *("npm", "install", "--package-lock-only", "--ignore-scripts", "--no-audit", "--no-fund"),
    *("--legacy-peer-deps", "--omit-lockfile-registry-resolved"),
)


def main(args: Sequence[str]) -> int:
    """Write the locks; return 0, or the exit code of the command that failed."""
    parser = argparse.ArgumentParser(prog="tools/lock", description="Remake requirements/*.lock.")
    parser.add_argument("--upgrade", action="store_true", help="move every pin to the newest version")
    parser.add_argument("--clients", action="store_true", help="remake only those of the interop tests' clients")
    options = parser.parse_args(args)
    try:
        with tempfile.TemporaryDirectory(prefix="viso-lock-") as folder:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True)
            subprocess.run([f"{folder}/bin/pip", "install", "--quiet", UV], check=True)
            compile_ = [f"{folder}/bin/uv", "pip", "compile", *OPTIONS]
            if options.clients:
                subprocess.run([*compile_, *CLIENT_OPTIONS], check=True, cwd=ROOT)
                subprocess.run(NPM, check=True, cwd=ROOT / "tools" / "interop_node")
            else:
                _lock_project([*compile_, *RUN_OPTIONS, *(["--upgrade"] if options.upgrade else [])])
    except subprocess.CalledProcessError as error:
        return int(error.returncode)
    return 0


def _lock_project(command: list[str]) -> None:
    """Lock the wider set first; the narrower one then takes its pins from there."""
    dev, run = "requirements/dev.lock", "requirements/run.lock"
    subprocess.run([*command, "--group=dev", "--output-file", dev], check=True, cwd=ROOT)
    subprocess.run([*command, "--constraint", dev, "--output-file", run], check=True, cwd=ROOT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
