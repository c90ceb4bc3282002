# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the documentation shows is true: code runs, links lead somewhere, tables are those of the code."""

import re
from pathlib import Path
from typing import Any

import pytest

from tests.places import ROOT
from tools import make_docs
from viso.testing import Autopilot

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


def _python_blocks(page: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def test_first_walk_prints_what_the_page_says(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {}
    (block,) = _python_blocks(ROOT / "docs" / "concepts.md")
    exec(block, names)
    verdict, state = capsys.readouterr().out.splitlines()
    assert "'outcome': 'accepted', 'rule': 'consumed'" in verdict
    assert state == "True None"
    step = "time.run_until({})\nprint(vehicle.visual_odom.pre_arm_check())\n"
    exec(step.format(3_299_999) + step.format(3_300_000), names)
    assert capsys.readouterr().out.splitlines() == ["None", "not healthy"]


def test_readme_test_passes(extnav_autopilot: Autopilot) -> None:
    names: dict[str, Any] = {}
    exec(next(block for block in _python_blocks(ROOT / "README.md") if "extnav_autopilot" in block), names)
    names["test_autopilot_navigates_by_what_we_send"](extnav_autopilot)


def test_readme_script_is_the_example_without_its_frame() -> None:
    readme = next(block for block in _python_blocks(ROOT / "README.md") if "odometry_send" in block)
    example = (ROOT / "docs" / "examples" / "send_odometry.py").read_text(encoding="utf-8")
    (call,) = re.findall(r"odometry_send\(.*\)", readme)
    assert call in example


def test_relative_links_lead_somewhere() -> None:
    link = re.compile(r"(?:\]\(|(?:src|srcset)=\")(?!https?:|#)([^)#\"]+)")
    links = [page.parent / target for page in PAGES for target in link.findall(page.read_text(encoding="utf-8"))]
    assert [path for path in links if not path.exists()] == []


def test_files_that_pages_name_are_there() -> None:
    name = re.compile(r"`((?:ap_core|ap_visualodom|ekf_stub|mav_handlers|viso|tests|tools)/[\w./]*)`")
    named = [(page.name, path) for page in PAGES for path in name.findall(page.read_text(encoding="utf-8"))]
    assert [(page, path) for page, path in named if not (ROOT / path).exists()] == []


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tables_are_those_of_the_code(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert make_docs.refresh(text) == text


def test_a_stale_table_is_noticed() -> None:
    page = "<!-- table: backends -->\n| old |\n<!-- end -->"
    assert "AP_VisualOdom_MAV" in make_docs.refresh(page)
    assert make_docs.refresh(make_docs.refresh(page)) == make_docs.refresh(page)


def test_every_table_is_used_on_a_page() -> None:
    used = {name for page in PAGES for name in re.findall(r"<!-- table: (\w+) -->", page.read_text(encoding="utf-8"))}
    assert used == set(make_docs.TABLES)
