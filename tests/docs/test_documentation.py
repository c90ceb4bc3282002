# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the documentation shows is true: code runs, links lead somewhere, tables are those of the code."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from mav_handlers.wire.messages import ODOMETRY
from tools import make_docs

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])


def _python_blocks(page: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[path.stem]
    return module


@pytest.fixture
def bridge() -> ModuleType:
    return _load(ROOT / "docs" / "examples" / "test_my_bridge.py")


def test_first_walk_prints_what_the_page_says(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {}
    (block,) = _python_blocks(ROOT / "docs" / "index.md")
    exec(block, names)
    verdict, state = capsys.readouterr().out.splitlines()
    assert "'outcome': 'accepted', 'rule': 'consumed'" in verdict
    assert state == "True None"
    step = "time.run_until({})\nprint(vehicle.visual_odom.pre_arm_check())\n"
    exec(step.format(3_299_999) + step.format(3_300_000), names)
    assert capsys.readouterr().out.splitlines() == ["None", "not healthy"]


def test_readme_test_block_runs(bridge: ModuleType) -> None:
    block = next(block for block in _python_blocks(ROOT / "README.md") if "my_odometry" in block)
    pose: ODOMETRY = bridge.POSE
    exec(block, {"my_odometry": pose})


@pytest.mark.parametrize(
    "name", ["test_good_pose_reaches_the_ekf", "test_ned_frames_are_dropped", "test_low_quality_is_withheld"]
)
def test_bridge_example_passes(bridge: ModuleType, name: str) -> None:
    getattr(bridge, name)()


def test_bridge_example_has_no_other_tests(bridge: ModuleType) -> None:
    assert len([name for name in vars(bridge) if name.startswith("test_")]) == 3


def test_readme_script_is_the_example_without_its_frame() -> None:
    readme = next(block for block in _python_blocks(ROOT / "README.md") if "odometry_send" in block)
    example = (ROOT / "docs" / "examples" / "send_odometry.py").read_text(encoding="utf-8")
    (call,) = re.findall(r"odometry_send\(.*\)", readme)
    assert call in example


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_relative_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8"))
    missing = [target for target in targets if not (page.parent / target).exists()]
    assert not missing


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
