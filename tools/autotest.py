# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the firmware's own autotests with `viso sitl` in the simulator's place; `tools/interop --autotest` calls it.

They need a checkout of the firmware, its submodules mavlink and pymavlink included, which stays as it is: the tests run
in a folder of links to it, with a copy of its `Tools`, since these find the simulator beside themselves.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from tools.bootstrap import ROOT

TESTS: Final = (
    "VisionPosition",
    "BodyFrameOdom",
    "GPSViconSwitching",
    "EK3_EXT_NAV_vel_without_vert",
    "OpticalFlow",
    "OpticalFlowLocation",
    "OpticalFlowLimits",
    "MAV_CMD_SET_EKF_SOURCE_SET",
    "MAV_CMD_DO_SET_GLOBAL_ORIGIN",
    "GuidedEKFLaneChange",
    "EKFSource",
    "EKF3SRCPerCore",
    "FarOrigin",
    "LoiterToGuidedHomeVSOrigin",
)
"""Those of external navigation, source sets, origins and optical flow; a checkout may lack some."""
BINARY: Final = Path("build", "sitl", "bin", "arducopter")
LIMIT_S: Final = 600
_PASSED: Final = re.compile(r"PASSED STEP: test\.Copter")
_FAILED: Final = re.compile(r"FAILED STEP: .*?\d{4} \((.*)\)|FAILED: \"[^\"]*\": (.*)")


class Outcome(NamedTuple):
    """How a test went: whether it passed, seconds, and the reason why not."""

    passed: bool
    seconds: float
    reason: str = ""


def stand_in(tree: Path, folder: Path, firmware: str) -> None:
    """Make a folder that looks like a checkout with a built simulator, which is `viso sitl`."""
    for entry in tree.iterdir():
        if entry.name not in ("Tools", "build", ".git"):
            (folder / entry.name).symlink_to(entry)
    shutil.copytree(tree / "Tools", folder / "Tools", symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    binary = folder / BINARY
    binary.parent.mkdir(parents=True)
    viso = ROOT / ".venv" / "bin" / "viso"
    binary.write_text(f'#!/bin/sh\nexec "{viso}" sitl --firmware {firmware} "$@"\n', encoding="utf-8")
    binary.chmod(0o755)


def run(python: Path, folder: Path, name: str) -> Outcome:
    """Run a test in a folder that looks like a checkout; what it printed is in `autotest-NAME.txt` there."""
    command = [str(python), "Tools/autotest/autotest.py", "--no-clean", "--no-configure", f"test.Copter.{name}"]
    environment = {**os.environ, "PATH": f"{python.parent}:{os.environ['PATH']}", "BUILDLOGS": str(folder / "logs")}
    (folder / "logs").mkdir(exist_ok=True)
    started = time.monotonic()
    with (folder / f"autotest-{name}.txt").open("wb+") as printed:
        try:
            subprocess.run(
                command,
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=subprocess.STDOUT,
                timeout=LIMIT_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return Outcome(False, LIMIT_S, f"not over after {LIMIT_S} s")
        seconds = time.monotonic() - started
        printed.seek(0)
        text = printed.read().decode(errors="replace")
    if _PASSED.search(text):
        return Outcome(True, seconds)
    found = _FAILED.search(text)
    last = next(iter(text.strip().splitlines()[-1:]), "nothing was printed")
    return Outcome(False, seconds, (found[1] or found[2]) if found else last)


def check(python: Path, tree: Path, folder: Path, firmware: str, names: Sequence[str]) -> bool:
    """Run tests, print a line each, and return whether all passed.

    Args:
        python: the interpreter that has what the tests import.
        tree: a checkout of the firmware.
        folder: an empty one, which holds what the tests write.
        firmware: the release that the checkout is, as `--firmware` takes it.
        names: of the tests; none for all of ``TESTS`` that the checkout has.
    """
    suite = (tree / "Tools" / "autotest" / "arducopter.py").read_text(encoding="utf-8")
    stand_in(tree, folder, firmware)
    all_passed = True
    for name in names or [name for name in TESTS if f"def {name}(" in suite]:
        outcome = run(python, folder, name)
        all_passed &= outcome.passed
        word = "passed" if outcome.passed else "FAILED"
        print(f"{name:<30} {word} {outcome.seconds:6.1f} s  {outcome.reason}".rstrip(), flush=True)
    if not all_passed:
        print(f"what they printed is in {folder}/autotest-NAME.txt", file=sys.stderr)
    return all_passed
