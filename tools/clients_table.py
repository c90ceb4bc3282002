# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests did with real clients, as a table in Markdown: of pytest's own report, --junit-xml."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Final, NamedTuple
from xml.etree import ElementTree

from tools.measured_page import render, replace

HEAD: Final = ("client", "version", "what the tests did", "result")
NODE_PACKAGES: Final = Path("node", "node_modules")


class Client(NamedTuple):
    """A client: what its package is called, and how its tests' names in tests/interop, ``FILE.TEST``, begin."""

    name: str
    package: str
    tests: tuple[str, ...]


CLIENTS: Final = (
    Client("MAVProxy", "MAVProxy", ("test_mavproxy.",)),
    Client("MAVSDK 4", "mavsdk", ("test_mavsdk.", "test_flying.test_mavsdk_")),
    Client("MAVSDK 3", "mavsdk-grpc", ("test_mavsdk3.",)),
    Client("dronekit2", "dronekit2", ("test_dronekit.",)),
    Client("node-mavlink", "node-mavlink", ("test_node_mavlink.",)),
    Client("pymavlink", "pymavlink", ("test_pymavlink_", "test_flying.test_example_")),
    Client("two by TCP, three by UDP, one by a serial port, at once", "", ("test_several_clients.",)),
)


def version(package: str, environment: Path) -> str:
    """Return what is installed of a package in the clients' environment, as Python's or Node's; else nothing."""
    described = environment / NODE_PACKAGES / package / "package.json"
    if package and described.exists():
        return str(json.loads(described.read_text(encoding="utf-8"))["version"])
    folders = [str(folder) for folder in environment.glob("lib/python*/site-packages")]
    return next((found.version for found in metadata.distributions(name=package, path=folders)), "") if package else ""


def rows(report: Path, environment: Path) -> Iterator[tuple[str, ...]]:
    """Yield a row a client, of a report of its tests."""
    results: dict[str, list[str]] = {}
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        name = f"{case.attrib['classname'].rpartition('.')[2]}.{case.attrib['name'].partition('[')[0]}"
        ends = [child.tag for child in case if child.tag in {"error", "failure", "skipped"}]
        results.setdefault(name, []).extend(ends or ["passed"])
    for client in CLIENTS:
        # Which worker ends first is chance: by file, then as they stand in it.
        files = sorted(results, key=lambda name: name.partition(".")[0])
        own = {name: results[name] for name in files if name.startswith(client.tests)}
        done = "; ".join(name.partition(".test_")[2].replace("_", " ") for name in own)
        counts = Counter(end for ends in own.values() for end in ends)
        result = ", ".join(f"{count} {end}" for end, count in counts.items()) or "not run"
        yield client.name, version(client.package, environment), done, result


def refresh(page: Path, report: Path, environment: Path) -> None:
    """Put the table into a page.

    Raises:
        InputError: the page has no place for it.
    """
    text = replace(page.read_text(encoding="utf-8"), "clients", render(HEAD, rows(report, environment)))
    page.write_text(text, encoding="utf-8")
