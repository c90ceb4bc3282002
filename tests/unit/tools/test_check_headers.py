# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The header checker knows which files need the SPDX lines and where they belong."""

from pathlib import Path

import pytest

from tools.check_headers import HEADER, findings, has_header, is_source

LINES = b"\n".join(HEADER)


@pytest.mark.parametrize("content", [LINES, LINES + b"\nimport x\n", b"#!/bin/sh\n" + LINES + b"\n"])
def test_header_at_the_top_passes(content: bytes) -> None:
    assert has_header(content)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"import x\n" + LINES,
        b"\n" + LINES,
        b"\n".join(reversed(HEADER)),
        HEADER[0],
        LINES.replace(b"GPL-3.0-or-later", b"MIT"),
    ],
)
def test_missing_or_misplaced_header_is_found(content: bytes) -> None:
    assert not has_header(content)


@pytest.mark.parametrize("name", ["a.py", "pyproject.toml", "x/run.sh", ".github/w.yml"])
def test_sources_are_known_by_suffix(name: str) -> None:
    assert is_source(Path(name), b"")


def test_scripts_without_suffix_are_sources() -> None:
    assert is_source(Path("tools/check"), b"#!/usr/bin/env python3\n")


@pytest.mark.parametrize("name", ["README.md", "LICENSE", "tests/data/x.csv", "requirements/run.lock"])
def test_texts_and_data_need_no_header(name: str) -> None:
    assert not is_source(Path(name), b"text")


def test_findings_name_the_file(tmp_path: Path) -> None:
    (tmp_path / "good.py").write_bytes(LINES + b"\n")
    (tmp_path / "bad.py").write_bytes(b"import x\n")
    assert findings(tmp_path) == ["bad.py:1: the two SPDX lines do not come first"]
