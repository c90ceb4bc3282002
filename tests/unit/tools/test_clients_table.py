# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of what the tests did with real clients."""

import json
import re
from pathlib import Path

from tests.places import ROOT
from tools import clients_table

REPORT = """<testsuites><testsuite name="pytest">
<testcase classname="tests.interop.test_mavproxy" name="test_log_is_downloaded" />
<testcase classname="tests.interop.test_mavproxy" name="test_arms[tcp]" />
<testcase classname="tests.interop.test_mavproxy" name="test_arms[udp]"><failure message="no" /></testcase>
<testcase classname="tests.interop.test_node_mavlink" name="test_every_frame_decodes" />
<testcase classname="tests.interop.test_web_page" name="test_path_is_turned" />
</testsuite></testsuites>"""


def test_row_tells_version_deeds_and_results_of_a_client(tmp_path: Path) -> None:
    packages = tmp_path / "lib" / "python3.11" / "site-packages" / "mavproxy-1.8.dist-info"
    packages.mkdir(parents=True)
    (packages / "METADATA").write_text("Metadata-Version: 2.1\nName: MAVProxy\nVersion: 1.8\n")
    node = tmp_path / clients_table.NODE_PACKAGES / "node-mavlink"
    node.mkdir(parents=True)
    (node / "package.json").write_text(json.dumps({"version": "2.3.0"}))
    report, page = tmp_path / "report.xml", tmp_path / "page.md"
    report.write_text(REPORT)
    page.write_text("<!-- measured: clients -->\n<!-- end -->\n")
    clients_table.refresh(page, report, tmp_path)
    lines = page.read_text().splitlines()
    assert "| MAVProxy | 1.8 | log is downloaded; arms | 2 passed, 1 failure |" in lines
    assert "| node-mavlink | 2.3.0 | every frame decodes | 1 passed |" in lines
    assert "| MAVSDK 3 |  |  | not run |" in lines
    assert "path is turned" not in page.read_text()


def test_page_tells_of_every_test_with_a_client_and_of_the_locked_versions() -> None:
    page = (ROOT / "docs" / "clients.md").read_text(encoding="utf-8")
    names = [
        f"{file.stem}.{test}"
        for file in (ROOT / "tests" / "interop").glob("test_*.py")
        for test in re.findall(r"^def (test_\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    lock = (ROOT / "requirements" / "interop.lock").read_text(encoding="utf-8").lower()
    for client in clients_table.CLIENTS:
        (row,) = re.findall(rf"^\| {re.escape(client.name)} \| ([\w.]*) \| (.*) \| \d+ passed \|$", page, re.MULTILINE)
        told = {name.partition(".test_")[2].replace("_", " ") for name in names if name.startswith(client.tests)}
        assert set(row[1].split("; ")) == told
        if client.package not in {"", "node-mavlink"}:
            assert f"{client.package.lower()}=={row[0]}" in lock
