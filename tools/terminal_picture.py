# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make an SVG of what a command prints, such as the pictures of docs/start.md.

`FORCE_COLOR=1 COLUMNS=88 viso doctor FLIGHT | python -m tools.terminal_picture PICTURE.svg "viso doctor FLIGHT"`
"""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path

from rich.console import Console
from rich.text import Text

COLUMNS = 88


def picture(output: str, command: str) -> str:
    """Return output, with its colours as ANSI codes, in a window whose title is the command."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(output.rstrip()))
    svg = console.export_svg(title=command, unique_id="terminal")
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)  # its fonts would come from a network


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(picture(sys.stdin.read(), sys.argv[2]), encoding="utf-8")
