# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The trace checker finds registry hosts and machine paths, and leaves device and relative paths alone."""

from pathlib import Path

import pytest

from tools.check_traces import REGISTRIES, findings, findings_in


@pytest.mark.parametrize("host", REGISTRIES)
def test_registry_host_is_found(host: str) -> None:
    assert findings_in(f"--index-url https://{host}/simple") == [(1, f"registry host {host}")]


def test_host_below_a_registry_is_found() -> None:
    assert findings_in("https://files." + REGISTRIES[2] + "/packages")


@pytest.mark.parametrize("top", ["home", "root", "Users", "work"])
def test_machine_path_is_found_with_its_line(top: str) -> None:
    path = f"/{top}/somebody"
    assert findings_in(f"first\nsee {path}/file\n") == [(2, f"machine path {path}")]


@pytest.mark.parametrize(
    "text",
    [
        "/dev/ttyUSB0",
        "/etc/ssl",
        "docs/Users/flow.md",
        "./home/page.md",
        "https://example.org/home/page",
        "~/Users/x",
        "$HOME/Users/x",
        "{root}/Users/x",
        "piper.org, cratesXio",
    ],
)
def test_other_text_passes(text: str) -> None:
    assert findings_in(text) == []


def test_binary_files_are_not_read_as_text(tmp_path: Path) -> None:
    (tmp_path / "log.BIN").write_bytes(b"\xa3\x95\0" + REGISTRIES[0].encode())
    assert findings(tmp_path) == []


def test_findings_name_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "a.md").write_text("\n" + REGISTRIES[0] + "\n", encoding="utf-8")
    assert findings(tmp_path) == [f"a.md:2: registry host {REGISTRIES[0]}"]
