# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures and quoted outputs of the pages name what the code has now."""

import re
from xml.etree import ElementTree

from ap_visualodom import verdicts as port
from ekf_stub.inputs import ingest_rules
from mav_handlers.verdicts import ALL_VERDICTS
from tests.places import ROOT
from viso.doctor.checks import CHECKS

DOCS = ROOT / "docs"
SVG = "{http://www.w3.org/2000/svg}"


def in_code(name: str, *, soft: bool) -> set[str]:
    """Return the words of a picture that are set as code: soft ones name files, all others verdicts."""
    texts = ElementTree.parse(DOCS / "images" / name).getroot().iter(f"{SVG}text")
    look = "code soft" if soft else "code"
    return {word for text in texts if text.get("class") == look for word in re.findall(r"[\w./]+", text.text or "")}


def test_the_way_of_a_message_names_verdicts_that_there_are_and_every_end_in_port_and_filter() -> None:
    shown = in_code("message.svg", soft=False)
    ends = {verdict.rule.code for verdict in port.VERDICTS}
    ends |= {rule.code for rule in ingest_rules.RULES if rule is not ingest_rules.TAKEN}
    assert ends <= shown <= ends | {verdict.rule.code for verdict in ALL_VERDICTS}


def test_pictures_name_files_that_there_are() -> None:
    folders = ROOT, ROOT / "ekf_stub" / "core"
    named = in_code("message.svg", soft=True) | in_code("filter.svg", soft=True) - {"..."}
    assert [name for name in named if not any((folder / name).exists() for folder in folders)] == []


def test_outputs_in_the_first_page_are_what_the_commands_say_now() -> None:
    page = (DOCS / "start.md").read_text(encoding="utf-8")
    (finding,) = (check for check in CHECKS if check.code == "XN3-02")
    assert f"error {finding.code}  {finding.title}\n" in page
    assert finding.firmware.split(".")[0] in page
    assert f"accepted │ {port.CONSUMED.rule.text} │" in page
