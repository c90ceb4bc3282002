# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of the pages are those that the code draws, and show what the code decides."""

import re
from xml.etree import ElementTree

import ap_visualodom.verdicts
from ekf_stub.inputs import ingest_rules
from tests.places import ROOT
from tools.pictures import drawn

FILES = dict(drawn())


def test_pictures_are_those_of_the_code() -> None:
    images = ROOT / "docs" / "images"
    assert [name for name, svg in FILES.items() if (images / name).read_text(encoding="utf-8") != svg] == []


def test_the_way_of_a_message_has_every_end_in_port_and_filter() -> None:
    shown = re.findall(r"\w+", " ".join(ElementTree.fromstring(FILES["message_light.svg"]).itertext()))
    codes = {verdict.rule.code for verdict in ap_visualodom.verdicts.VERDICTS}
    codes |= {rule.code for rule in ingest_rules.RULES if rule is not ingest_rules.TAKEN}
    assert codes - set(shown) == set()


def test_light_and_dark_differ_in_colours_alone() -> None:
    for name in FILES:
        light, dark = (
            re.sub("#[0-9a-f]{6}", "", FILES[re.sub("light|dark", scheme, name)]) for scheme in ("light", "dark")
        )
        assert light == dark
