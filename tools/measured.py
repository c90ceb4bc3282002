# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of measured figures, and where they were measured."""

import re
import subprocess
from collections.abc import Iterable, Sequence
from os import cpu_count
from pathlib import Path

from tools.project_files import ROOT


def render(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, tuple("---" for _ in head), *body]
    return "".join("| " + " | ".join(cells) + " |\n" for cells in lines)


def commit() -> str:
    """Return the commit that is checked out, or "none"."""
    command = ("git", "rev-parse", "HEAD")
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip() or "none"


def where() -> str:
    """Return a line that names the commit and the machine."""
    model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    return f"Measured at {commit()[:10]} on {model[1] if model else 'an unknown processor'}, {cpu_count()} cores.\n"
