# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Check that pages and docstrings are in plain English, by proselint with the phrases of tools/words.toml."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from proselint.checks import __register__ as proselint_checks
from proselint.config import DEFAULT
from proselint.registry import CheckRegistry
from proselint.registry.checks import Check, types
from proselint.tools import LintFile

from tools.project_files import ROOT, project_files

WORDS: Final = Path(__file__).with_name("words.toml")
# Of proselint's own checks those that do not stumble over technical English.
THEIR_CHECKS: Final = ("hedging", "malapropisms", "needless_variants", "nonwords", "redundancy")
PAGES: Final = ("CHANGELOG.md", "CONTRIBUTING.md", "README.md", "SECURITY.md", "docs/")
PACKAGES: Final = ("ap_core/", "ap_visualodom/", "ekf_stub/", "mav_handlers/", "tools/", "viso/")
# What is quoted from programs and from the firmware: blocks and code within a sentence.
_QUOTED: Final = re.compile(r"^```.*?^```|``[^`]+``|`[^`\n]+`", re.DOTALL | re.MULTILINE)


def prepare() -> dict[str, bool]:
    """Register all checks; return which of them count."""
    phrases = tomllib.loads(WORDS.read_text(encoding="utf-8"))["write"]
    own = Check(types.PreferredForms(phrases), path="viso", message="{1!r}: write {0!r}")
    registry = CheckRegistry()
    registry.register_many((*proselint_checks, own))
    return {check: check in {"viso", *THEIR_CHECKS} for check in ("viso", *DEFAULT["checks"])}


def texts_of(name: str, content: str) -> Iterator[tuple[int, str]]:
    """Yield each text of a file that people read, with the number of the line before it."""
    if name.endswith(".md"):
        yield 0, content
        return
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.lineno - 1, node.value.value


def findings_in(name: str, content: str, checks: dict[str, bool]) -> list[str]:
    """Return a line for each phrase of a page or module that is not plain English."""
    found = []
    for line, text in texts_of(name, content):
        plain = _QUOTED.sub(lambda quoted: re.sub(r"[^\n]", " ", quoted[0]), text)
        if plain.strip():
            results = LintFile(name, plain).lint({"max_errors": len(plain), "checks": checks})
            found += [f"{name}:{line + result.pos[0]}: {result.check_result.message}" for result in results]
    return found


def main() -> int:
    """Print what is not plain English; return 1 if there is anything."""
    checks = prepare()
    names = [str(name) for name in project_files()]
    names = [name for name in names if name.startswith(PAGES) and name.endswith(".md")] + [
        name for name in names if name.startswith(PACKAGES) and name.endswith(".py")
    ]
    found = [line for name in names for line in findings_in(name, (ROOT / name).read_text(encoding="utf-8"), checks)]
    print("\n".join(found) or f"{len(names)} files in plain English")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
