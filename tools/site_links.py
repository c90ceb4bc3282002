# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the site has besides docs/, and links as they have to be there; mkdocs calls these functions.

Pages link as a reader of the repository needs it. The site has the pages of docs/ and three of the root, all in one
folder. A link to anything else of the repository becomes its text.
"""

from __future__ import annotations

import posixpath
import re
from typing import Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from tools.project_files import ROOT

ROOT_PAGES: Final = ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")
_LINK: Final = re.compile(r"(?<!!)\[([^\]]+)\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root to those of docs/."""
    for name in ROOT_PAGES:
        files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return a page whose links lead to pages and files of the site."""
    name = page.file.src_uri
    folder = "" if name in ROOT_PAGES else "docs"

    def linked(match: re.Match[str]) -> str:
        text, target, anchor = match.groups("")
        path = posixpath.normpath(posixpath.join(folder, target))
        page_or_file = path.removeprefix("docs/")
        is_elsewhere = files.get_file_from_path(page_or_file) is None and (ROOT / path).exists()
        return text if is_elsewhere else f"[{text}]({page_or_file}{anchor})"

    return _LINK.sub(linked, markdown)
