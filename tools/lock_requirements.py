# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Remake requirements/*.lock from pyproject.toml, with uv in a throw-away environment.

Pins that still satisfy pyproject.toml stay as they are; `--upgrade` moves all of them to the newest.
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
    "--custom-compile-command=tools/lock",
    *(f"--extra={name}" for name in RUN_EXTRAS),
    "--group=build",
)


def main(args: Sequence[str]) -> int:
    """Write both locks; return 0, or the exit code of the command that failed."""
    parser = argparse.ArgumentParser(prog="tools/lock", description="Remake requirements/*.lock.")
    parser.add_argument("--upgrade", action="store_true", help="move every pin to the newest version")
    extra = ["--upgrade"] if parser.parse_args(args).upgrade else []
    (ROOT / "requirements").mkdir(exist_ok=True)
    try:
        with tempfile.TemporaryDirectory(prefix="viso-lock-") as folder:
            _compile(Path(folder), extra)
    except subprocess.CalledProcessError as error:
        return int(error.returncode)
    return 0


def _compile(folder: Path, extra: list[str]) -> None:
    """Lock the wider set first; the narrower one then takes its pins from there."""
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    subprocess.run([str(folder / "bin" / "pip"), "install", "--quiet", UV], check=True)
    compile_ = [str(folder / "bin" / "uv"), "pip", "compile", "pyproject.toml", *OPTIONS, *extra]
    dev, run = "requirements/dev.lock", "requirements/run.lock"
    subprocess.run([*compile_, "--group=dev", "--output-file", dev], check=True, cwd=ROOT)
    subprocess.run([*compile_, "--constraint", dev, "--output-file", run], check=True, cwd=ROOT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
