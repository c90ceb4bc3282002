# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the site has besides docs/, links as they have to be there, and our docstrings; mkdocs calls all of this.

Pages link as a reader of the repository needs it. The site has the pages of docs/ and three of the root, all in one
folder. A link to anything else of the repository becomes its text and the path.
"""

from __future__ import annotations

import posixpath
import re
from typing import Any, Final

import griffe
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from tools.project_files import ROOT

ROOT_PAGES: Final = ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")
# Who searches has a trouble more often than a program to write.
BOOSTS: Final = {"why.md": 4.0, "arming.md": 3.0, "start.md": 2.0, "api.md": 0.01, "CHANGELOG.md": 0.01}
_LINK: Final = re.compile(r"(?<!!)\[([^\]]+)\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)")
_ENTRY: Final = re.compile(r"^    (\w+(?:, \w+)+): (.*(?:\n {8}.*)*)", re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root to those of docs/."""
    for name in ROOT_PAGES:
        files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return a page whose links lead to pages and files of the site, and say where search lists it."""
    name = page.file.src_uri
    page.meta["search"] = {"boost": BOOSTS.get(name, 1.0)}
    folder = "" if name in ROOT_PAGES else "docs"

    def linked(match: re.Match[str]) -> str:
        text, target, anchor = match.groups("")
        path = posixpath.normpath(posixpath.join(folder, target))
        page_or_file = path.removeprefix("docs/")
        is_elsewhere = files.get_file_from_path(page_or_file) is None and (ROOT / path).exists()
        named = text if path in text else f"{text} (`{path}`)"
        return named if is_elsewhere else f"[{text}]({page_or_file}{anchor})"

    return _LINK.sub(linked, markdown)


class Docstrings(griffe.Extension):
    """Reads our classes as we write them."""

    def on_class_instance(self, *, cls: griffe.Class, **_: Any) -> None:
        """Show each of several fields that a docstring describes by one text."""
        if cls.docstring:
            cls.docstring.value = _ENTRY.sub(_one_each, cls.docstring.value)


def _one_each(match: re.Match[str]) -> str:
    return "\n".join(f"    {name}: {match[2]}" for name in match[1].split(", "))
