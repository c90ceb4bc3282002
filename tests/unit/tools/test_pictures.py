# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of the pages are those that the code draws, and show what the code decides."""

import re
from xml.etree import ElementTree

from ap_visualodom import verdicts as port
from ekf_stub.inputs import ingest_rules
from tests.places import ROOT
from tools.pictures import drawn
from tools.terminal_picture import picture
from viso.doctor.checks import CHECKS

FILES = dict(drawn())


def test_pictures_are_those_of_the_code() -> None:
    images = ROOT / "docs" / "images"
    assert [name for name, svg in FILES.items() if (images / name).read_text(encoding="utf-8") != svg] == []


def test_the_way_of_a_message_has_every_end_in_port_and_filter() -> None:
    shown = re.findall(r"\w+", " ".join(ElementTree.fromstring(FILES["message_light.svg"]).itertext()))
    codes = {verdict.rule.code for verdict in port.VERDICTS}
    codes |= {rule.code for rule in ingest_rules.RULES if rule is not ingest_rules.TAKEN}
    assert codes - set(shown) == set()


def test_light_and_dark_differ_in_colours_alone() -> None:
    for name in FILES:
        light, dark = (
            re.sub("#[0-9a-f]{6}", "", FILES[re.sub("light|dark", scheme, name)]) for scheme in ("light", "dark")
        )
        assert light == dark


def _shown(name: str) -> str:
    """Return all texts of a picture in docs/images, with single spaces."""
    root = ElementTree.parse(ROOT / "docs" / "images" / name).getroot()
    return " ".join(" ".join(root.itertext()).split())


def test_terminals_show_what_the_commands_say_now() -> None:
    assert port.CONSUMED.rule.text in _shown("terminal_serve.svg")
    doctor = _shown("terminal_doctor.svg")
    codes = re.findall(r"XN\d-\d\d", doctor)
    assert "XN3-02" in codes
    assert [check.code for check in CHECKS if check.code in codes and f"{check.code} {check.title}" not in doctor] == []


def test_a_terminal_asks_the_net_for_no_font() -> None:
    svg = picture("\x1b[1;31merror\x1b[0m", "viso doctor")
    assert ">error<" in svg
    assert "@font-face" not in svg
