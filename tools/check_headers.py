# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Check that every source file starts with the two SPDX lines."""

from __future__ import annotations

import sys
from pathlib import Path

from tools.project_files import ROOT, project_files

HEADER = (
    b"# SPDX-FileCopyrightText: 2026 The viso authors",
    b"# SPDX-License-Identifier: GPL-3.0-or-later",
)
SUFFIXES = {".py", ".pyi", ".sh", ".toml", ".yml", ".yaml"}


def is_source(name: Path, content: bytes) -> bool:
    """Tell whether the file must carry the lines: by suffix, or because it is a script."""
    return name.suffix in SUFFIXES or content.startswith(b"#!")


def has_header(content: bytes) -> bool:
    """Tell whether the two lines come first, a `#!` line apart."""
    lines = content.splitlines()
    if lines and lines[0].startswith(b"#!"):
        lines = lines[1:]
    return tuple(lines[:2]) == HEADER


def findings(root: Path = ROOT) -> list[str]:
    """Return a line for each source file under `root` without the header."""
    found = []
    for name in project_files(root):
        content = (root / name).read_bytes()
        if is_source(name, content) and not has_header(content):
            found.append(f"{name}:1: the two SPDX lines do not come first")
    return found


def main() -> int:
    """Print the findings; return 1 when there are any."""
    found = findings()
    print("\n".join(found) or "all source files carry the SPDX lines")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
