# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The site of docs/: it builds without a network, needs none to be read, and leads to all its pages."""

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Final

import pytest

from tests.places import ROOT

BROWSER: Final = shutil.which("chromium")
NOWHERE: Final = "http://127.0.0.1:9"


class Page(HTMLParser):
    """What a page loads, and where its navigation leads."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.navigation: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note the addresses of a tag."""
        values = {name: value or "" for name, value in attrs}
        if tag != "a":
            self.loaded += [values[name] for name in ("src", "srcset", "href") if name in values]
        elif "md-nav__link" in values.get("class", ""):
            self.navigation.add(values.get("href", "").partition("#")[0])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    build: list[str | Path]
    build = [sys.executable, "-P", "-m", "mkdocs", "build", "--config-file", ROOT / "mkdocs.yml", "--site-dir", folder]
    no_network = dict.fromkeys(("http_proxy", "https_proxy", "HTTPS_PROXY", "ALL_PROXY"), NOWHERE)
    done = subprocess.run(build, env=os.environ | no_network, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr  # a warning counts as an error there
    return folder


@pytest.mark.slow
def test_pages_load_nothing_from_a_network(site: Path) -> None:
    loaded = {address for path in site.rglob("*.html") for address in Page(path).loaded}
    for path in site.rglob("*.css"):
        loaded |= set(re.findall(r"(?:url\(|@import)[\s'\"]*([^)'\"]*)", path.read_text(encoding="utf-8")))
    assert loaded
    assert [address for address in loaded if re.match(r"(https?:)?//", address)] == []


@pytest.mark.slow
def test_navigation_leads_to_all_pages(site: Path) -> None:
    pages = {str(path.relative_to(site)) for path in site.rglob("*.html")} - {"404.html"}
    assert pages - Page(site / "index.html").navigation == set()


@pytest.mark.interop
def test_search_finds_a_word_without_a_server(site: Path, tmp_path: Path) -> None:
    if BROWSER is None:
        pytest.skip("chromium is not installed")
    switches = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=10000", "--dump-dom"]
    switches.append(f"--user-data-dir={tmp_path}")
    address = f"{(site / 'index.html').as_uri()}?q=horizon"
    shown = subprocess.run([BROWSER, *switches, address], capture_output=True, text=True, check=True).stdout
    assert re.search(r'href="[^"]*glossary\.html[^"]*#horizon', shown)
