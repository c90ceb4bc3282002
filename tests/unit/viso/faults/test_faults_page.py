# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page about faults shows is true."""

import re

import pytest

from tests.places import ROOT
from viso.faults import FAULTS, load_timeline, parse_timeline
from viso.faults.fault import parameters_of

DOCS = ROOT / "docs"
PAGE = (DOCS / "faults.md").read_text(encoding="utf-8")


def test_timeline_of_the_page_is_one() -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert [entry.kind for entry in parse_timeline(text).entries] == ["loss", "glit", "quality"]


def test_example_file_is_a_timeline() -> None:
    timeline = load_timeline(DOCS / "examples" / "faults.yaml")
    assert (timeline.seed, len(timeline.entries)) == (7, 6)


def test_program_of_the_page_prints_what_the_page_says(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(block, {})
    printed = capsys.readouterr().out.splitlines()
    assert printed
    assert all(f"`{line}`" in PAGE for line in printed)


def test_single_fault_of_the_page_is_one() -> None:
    (text,) = re.findall(r'--fault "(.*?)"', PAGE)
    assert parse_timeline(f"faults: [{{{text}}}]").entries[0].kind == "yawerr"


def test_every_parameter_says_what_it_is() -> None:
    for kind, fault in FAULTS.items():
        said = (fault.__doc__ or "").partition("Attributes:")[2]
        assert all(re.search(rf"\b{field.name}\b", said) for field in parameters_of(fault)), kind
