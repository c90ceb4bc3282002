# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of plain English."""

import pytest

from tools import prose


@pytest.fixture(scope="module")
def checks() -> dict[str, bool]:
    return prose.prepare()


@pytest.mark.parametrize(("name", "content", "found"), [
    ("a.md", "# A\n\nIt is\nwritten anew.\n", ["a.md:4: 'anew': write 'again, or restart'"]),
    ("a.md", "`write anew`\n\n```\nwrite anew\n```\n", []),
    ("a.py", 'x = "anew"\n\ndef f():\n    """Do.\n\n    Do anew."""', ["a.py:6: 'anew': write 'again, or restart'"]),
])  # fmt: skip
def test_phrase_is_found_where_people_read_it(
    checks: dict[str, bool], name: str, content: str, found: list[str]
) -> None:
    assert prose.findings_in(name, content, checks) == found


def test_proselint_looks_as_well(checks: dict[str, bool]) -> None:
    (line,) = prose.findings_in("a.md", "Irregardless of that, it works.\n", checks)
    assert line.startswith("a.md:1: ")
