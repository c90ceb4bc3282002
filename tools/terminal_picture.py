# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the commands of docs/start.md, and make an SVG of what each prints.

`tools/make_docs.py --terminals` writes them. The autopilot runs in real time, so its times differ from run to run:
only words of findings and verdicts are checked (`tests/unit/tools/test_pictures.py`).
"""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.text import Text

from tools.project_files import ROOT

COLUMNS: Final = 88
_SERVE: Final = "viso serve --preset mavlink-camera-rover --web 8080"
_DOCTOR: Final = "viso doctor mystream.tlog"
_CAPTURE: Final = ROOT / "tests" / "data" / "captures" / "voxl.jsonl.gz"
_CAMERA: Final = ROOT / "docs" / "examples" / "send_odometry.py"
_BEFORE_S: Final = 7
_STREAM_S: Final = 10


def picture(output: str, command: str) -> str:
    """Return output, with its colours as ANSI codes, in a window whose title is the command."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(output.rstrip()))
    svg = console.export_svg(title=command, unique_id="terminal")
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)  # its fonts would come from a network


def _started(command: str, folder: Path) -> subprocess.Popen[str]:
    words = [sys.executable, "-P", "-c", "from viso.cli import main; main()", *shlex.split(command)[1:]]
    env = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": str(COLUMNS), "FORCE_COLOR": "1"}
    return subprocess.Popen(words, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def taken() -> Iterator[tuple[str, str]]:
    """Run the commands, for 20 s; yield the name of each file and its content."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        autopilot = _started(f"{_SERVE} --no-live --duration {_BEFORE_S + _STREAM_S + 3}", folder)
        time.sleep(_BEFORE_S)
        subprocess.run([sys.executable, "-P", _CAMERA, "tcp:127.0.0.1:5760", str(_STREAM_S)], check=True)
        yield "terminal_serve.svg", picture(autopilot.communicate()[0], _SERVE)
        fault = f"viso faults {_CAPTURE} -o mystream.tlog --fault 'kind: stamp_unit, unit: ms'"
        _started(fault, folder).communicate()
        yield "terminal_doctor.svg", picture(_started(_DOCTOR, folder).communicate()[0], _DOCTOR)
