# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Check that no file names a package registry's host or a directory of somebody's machine."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from tools.project_files import ROOT, project_files

# The names are put together here, so that this file does not contain them.
REGISTRIES = tuple(
    ".".join(parts)
    for parts in (
        ("pypi", "org"),
        ("pypi", "python", "org"),
        ("pythonhosted", "org"),
        ("anaconda", "org"),
        ("registry", "npmjs", "org"),
        ("registry", "yarnpkg", "com"),
        ("crates", "io"),
        ("proxy", "golang", "org"),
        ("deb", "debian", "org"),
        ("archive", "ubuntu", "com"),
    )
)
HOMES = ("home", "root", "Users", "work", "workspace")
HOST = re.compile(r"\b(?:" + "|".join(map(re.escape, REGISTRIES)) + r")\b")
PATH = re.compile(r"(?<![\w.~$})*/-])/(?:" + "|".join(HOMES) + r")/[\w.]+")


def findings_in(text: str) -> list[tuple[int, str]]:
    """Return line number and reason for each host or path in `text`."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        for pattern, what in ((HOST, "registry host"), (PATH, "machine path")):
            found += [(number, f"{what} {match}") for match in pattern.findall(line)]
    return found


def findings(root: Path = ROOT) -> list[str]:
    """Return a line for each host or path in a text file under `root`."""
    found = []
    for name in project_files(root):
        content = (root / name).read_bytes()
        if b"\0" not in content:
            text = content.decode(errors="replace")
            found += [f"{name}:{number}: {reason}" for number, reason in findings_in(text)]
    return found


def main() -> int:
    """Print the findings; return 1 when there are any."""
    found = findings()
    print("\n".join(found) or "no registry host and no machine path in any file")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
