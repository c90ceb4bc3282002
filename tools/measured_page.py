# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of measured figures in pages: what stands between `<!-- measured: NAME -->` and `<!-- end -->`."""

import re
from collections.abc import Iterable, Sequence

from viso.errors import InputError


def render(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, tuple("---" for _ in head), *body]
    return "".join("| " + " | ".join(cells) + " |\n" for cells in lines)


def replace(text: str, name: str, table: str) -> str:
    """Return a page with its table of a name made anew.

    Raises:
        InputError: if it has no place for one.
    """
    block = re.compile(rf"(<!-- measured: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
    page, count = block.subn(lambda match: f"{match[1]}\n{table}\n{match[2]}", text)
    if not count:
        raise InputError(f"no line <!-- measured: {name} --> with <!-- end --> after it")
    return page
