# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fuzz a target of tests/fuzz, guided by coverage, in an environment of its own that the first run makes.

``python -m tools.fuzz endpoint|files [libFuzzer options]``, for instance ``-max_total_time=600``. What is new goes to
``build/fuzz/corpus``, what fails to ``build/fuzz``; a case that was a finding belongs into tests/fuzz/corpus.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "build" / "fuzz"
TARGETS = ("endpoint", "files")
OPTIONS = ("-max_len=600", "-timeout=30", "-rss_limit_mb=2000")


def environment() -> Path:
    """Return the environment's Python, which has what the project runs with, and atheris."""
    python = WORK / "venv" / "bin" / "python"
    done = WORK / "venv" / "done"
    if not done.exists():
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(WORK / "venv")], check=True)
        locks = [option for name in ("run.lock", "fuzz.txt") for option in ("-r", str(ROOT / "requirements" / name))]
        pip = [
            str(python),
            "-m",
            "pip",
            "install",
            "--quiet",
            "--no-deps",
            "--require-hashes",
            "--only-binary",
            ":all:",
        ]
        subprocess.run([*pip, *locks], check=True)
        done.touch()
    return python


def main(args: Sequence[str]) -> int:
    """Fuzz until libFuzzer has had enough; return its exit code, 2 when there was no start."""
    if not args or args[0] not in TARGETS:
        sys.stderr.write(f"usage: python -m tools.fuzz {'|'.join(TARGETS)} [libFuzzer options]\n")
        return 2
    name, *options = args
    corpus = WORK / "corpus" / name
    corpus.mkdir(parents=True, exist_ok=True)
    try:
        python = environment()
    except (OSError, subprocess.CalledProcessError) as error:
        sys.stderr.write(f"tools.fuzz: no environment to fuzz in: {error}\n")
        return 2
    script = ROOT / "tests" / "fuzz" / "fuzz.py"
    folders = [str(corpus), str(ROOT / "tests" / "fuzz" / "corpus" / name)]
    line = [str(python), str(script), name, f"-artifact_prefix={WORK}/", *OPTIONS, *options, *folders]
    return subprocess.run(line, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
