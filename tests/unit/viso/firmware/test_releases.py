# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Profiles are data: a further one is a row, and nothing asks for one by its name."""

import ast
import gzip
import json
import sys
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import pytest

from mav_handlers.covariance import root_of_sum
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE
from tests.places import RECORDED, ROOT
from tools import make_docs
from viso.firmware import releases as table
from viso.firmware.releases import FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6, Firmware
from viso.testing import Autopilot, AutopilotOptions

if TYPE_CHECKING:
    from tests.unit.viso.command_line import Viso

CAPTURE = RECORDED / "captures" / "mav.jsonl.gz"
PACKAGES = ("ap_core", "ap_visualodom", "ekf_stub", "mav_handlers", "viso")
MADE_UP = "made-up"

ROWS = {
    "ap_visualodom/release.py",
    "ekf_stub/release.py",
    "mav_handlers/release.py",
    "viso/firmware/log_releases.py",
    "viso/parameters/releases.py",
}
"""These have rows of their own by the names of releases."""


def made_up() -> Firmware:
    """Return a release that is the reference except its texts, and its errors from a covariance."""
    return replace(
        JULY_2025,
        name=MADE_UP,
        date="2030-01",
        version_text="ArduCopter V9.8.7",
        source_hash="0badcafe",
        major=9,
        minor=8,
        patch=7,
        endpoint=replace(JULY_2025.endpoint, error_formula=root_of_sum),
    )


@pytest.fixture
def further(monkeypatch: pytest.MonkeyPatch) -> Firmware:
    """Add the made-up release to the table, wherever that has been imported."""
    row, before = made_up(), PROFILES
    profiles = MappingProxyType({**before, row.name: row})
    for module in list(sys.modules.values()):
        if getattr(module, "PROFILES", None) is before:
            monkeypatch.setattr(module, "PROFILES", profiles)
    return row


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the first messages of a capture, of which the last ones have a covariance."""
    path = tmp_path_factory.mktemp("short") / "mav.jsonl.gz"
    with gzip.open(CAPTURE, "rt", encoding="utf-8") as file:
        lines = file.readlines()[:140]
    with gzip.open(path, "wt", encoding="utf-8") as file:
        file.writelines(lines)
    return path


# The table


def test_profiles_are_found_by_their_names_the_oldest_first() -> None:
    assert list(PROFILES) == [one.name for one in PROFILES.values()]
    versions = [(one.major, one.minor) for one in PROFILES.values()]
    assert versions == sorted(versions)


@pytest.mark.parametrize(
    ("firmware", "version"), [(STABLE_4_6, 0x04060380), (JULY_2025, 0x04070000), (FEBRUARY_2026, 0x04070000)]
)
def test_version_is_four_bytes(firmware: Firmware, version: int) -> None:
    assert firmware.sw_version == version
    assert firmware.banner == f"{firmware.version_text} ({firmware.source_hash})"
    assert len(firmware.source_hash) == 8
    assert int(firmware.source_hash, 16) > 0


def test_every_field_of_a_profile_is_explained() -> None:
    documented = Firmware.__doc__ or ""
    assert [one.name for one in fields(Firmware) if one.name not in documented] == []


def test_nothing_but_the_table_asks_for_a_release_by_its_name() -> None:
    names = {*PROFILES, "STABLE_4_6", "FEBRUARY_2026", "APRIL_2026"}
    askers = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if path != Path(table.__file__) and _mentions(path, names)
    }
    assert askers <= ROWS


def _mentions(path: Path, names: set[str]) -> bool:
    text = path.read_text(encoding="utf-8")
    if not any(name in text for name in names):
        return False
    nodes = ast.walk(ast.parse(text))
    return any(
        (isinstance(node, ast.Constant) and node.value in names) or (isinstance(node, ast.Name) and node.id in names)
        for node in nodes
    )


# A further one


@pytest.mark.slow
def test_further_release_replays_as_it_does_things(viso: "Viso", further: Firmware, short: Path) -> None:
    outcome = viso("replay", str(short), "--versus", MADE_UP, "--json")
    assert outcome.code == 0
    told = json.loads(outcome.out)
    assert told["firmware"] == {"before": JULY_2025.name, "after": MADE_UP}
    assert [change["type"] for change in told["differs"]["errors"]] == ["VISION_POSITION_ESTIMATE"]
    same = json.loads(viso("replay", str(short), "--firmware", MADE_UP, "--versus", "2026-02", "--json").out)
    assert same["differs"]["errors"] == []


@pytest.mark.parametrize("command", ["ekf", "doctor", "vectors"])
def test_further_release_is_known_to_every_command(
    viso: "Viso", further: Firmware, tmp_path: Path, command: str
) -> None:
    outcome = viso(command, str(tmp_path / "missing"), "--firmware", MADE_UP)
    assert outcome.code == 2
    assert "no such profile" not in outcome.err
    assert "missing" in outcome.err


@pytest.mark.slow
def test_further_release_is_an_autopilot_for_tests(further: Firmware) -> None:
    autopilot = Autopilot(AutopilotOptions(firmware=MADE_UP))
    try:
        firmware = autopilot.vehicle.firmware
        assert (firmware.sw_version, firmware.banner) == (0x09080700, "ArduCopter V9.8.7 (0badcafe)")
        autopilot.send(VISION_POSITION_ESTIMATE(1, 0, 0, 0, 0, 0, 0, (4.0, *[0.0] * 20)))
        [record] = autopilot.records_of("VISP")
        assert record.fields["PErr"] == 2.0
    finally:
        autopilot.close()


def test_further_release_has_its_column_in_the_documentation(further: Firmware) -> None:
    rows = list(make_docs.TABLES["firmware"][1]())
    assert {len(row) for row in rows} == {2 + len(PROFILES)}
    assert [row[-2] for row in rows if "0badcafe" in row[-2]] == ["`ArduCopter V9.8.7 (0badcafe)`"]
