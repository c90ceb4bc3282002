# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso serve --web``."""

import sys

import pytest

from tests.places import ROOT
from tests.unit.viso.command_line import Viso, failed_with
from viso.web.faults import SWITCHES
from viso.web.live_view import LiveView
from viso.web.requests import ACTIONS

PAGE = ROOT / "docs" / "web.md"


@pytest.mark.slow
def test_address_is_printed_and_everything_closes_at_the_end(serve: Viso) -> None:
    outcome = serve("--web", "127.0.0.1:0")
    assert outcome.code == 0
    lines = [line for line in outcome.out.splitlines() if line.startswith("live view at ")]
    assert len(lines) == 1
    assert lines[0].startswith("live view at http://127.0.0.1:")
    assert not lines[0].endswith(":0/")


def test_port_alone_is_one_of_loopback() -> None:
    view = LiveView("0", [], "")
    view.close()
    assert view.introduction == f"live view at {view.url}"
    assert view.url.startswith("http://127.0.0.1:")


def test_address_that_others_can_reach_comes_with_a_warning() -> None:
    view = LiveView("0.0.0.0:0", [], "")
    view.close()
    assert view.introduction.endswith("; whoever reaches it can command the vehicle")


@pytest.mark.parametrize("address", ["", "here", "127.0.0.1:99999", "::1:80", "127.0.0.1:"])
def test_address_that_is_none_is_one_line(serve: Viso, address: str) -> None:
    outcome = serve("--web", address)
    assert outcome.code == 2
    assert outcome.err.startswith("viso: --web: bad connection string")
    assert outcome.err.count("\n") == 1


def test_without_the_extra_it_says_what_to_install(serve: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "viso.web.server", raising=False)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    line = "--web: the live view is served with starlette; install it with: pip install 'ardupilot-viso[web]'"
    assert failed_with(serve("--web", "0"), line)


def test_page_names_every_command_and_every_fault() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert [action.label for action in ACTIONS if f"| {action.label} |" not in text] == []
    assert [switch.label for switch in SWITCHES if f"| {switch.label} | {switch.about} |" not in text] == []
