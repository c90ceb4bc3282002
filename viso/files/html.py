# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pages share: the frame with its style, and tables. No script, no other file, no network."""

import itertools
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from typing import Final

_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def document(title: str, body: Iterable[str]) -> str:
    """Return a page of a title, as it is to be read, and of a body in HTML."""
    css = resources.files("viso.files").joinpath("style.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{css}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    numeric: Sequence[int] = (),
    classes: Iterable[str] | None = None,
) -> str:
    """Return texts, as they are to be read, as a table in HTML; the columns ``numeric`` hold numbers."""

    def cell(tag: str, column: int, text: str) -> str:
        kind = ' class="number"' if column in numeric else ""
        return f"<{tag}{kind}>{escape(text)}</{tag}>"

    def line(tag: str, texts: Sequence[str], kind: str = "") -> str:
        return f"<tr{kind}>" + "".join(cell(tag, column, text) for column, text in enumerate(texts)) + "</tr>"

    kinds = itertools.repeat("") if classes is None else (f' class="{one}"' for one in classes)
    body = "\n".join(line("td", row, kind) for row, kind in zip(rows, kinds, strict=False))
    return f'<div class="scroll"><table><thead>{line("th", head)}</thead><tbody>\n{body}\n</tbody></table></div>'
