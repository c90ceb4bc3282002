# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings for machines and for people."""

import json
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import pytest

from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.evidences import START_US, evidence_of, stream_of
from viso.doctor import CHECKS, Finding, Severity, VehicleData, diagnose
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.output.machine_formats import as_json, as_junit, as_sarif
from viso.doctor.output.summary import summarise
from viso.doctor.output.terminal import count_text, finding_lines

EVIDENCE = evidence_of(
    stream_of([odometry(1 + number * 40_000, q=(2.0, 0, 0, 0)) for number in range(100)]),
    {"VISO_ORIENT": 4, "VISO_DELAY_MS": 900},
    vehicle=VehicleData(texts=((START_US, 2, "EKF \x00 <says> & so"),)),
)
FINDINGS = diagnose(EVIDENCE, CHECKS)


def test_worst_comes_first_then_the_code() -> None:
    assert [(finding.severity.rank, finding.code) for finding in FINDINGS] == sorted(
        (finding.severity.rank, finding.code) for finding in FINDINGS
    )
    assert {finding.severity for finding in FINDINGS} == set(Severity)


def test_severities_are_in_order() -> None:
    assert Severity.ERROR.at_least(Severity.WARNING)
    assert Severity.WARNING.at_least(Severity.WARNING)
    assert not Severity.NOTE.at_least(Severity.WARNING)


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ((), ""),
        ((7,), "message 7"),
        ((1, 2, 3), "messages 1, 2, 3"),
        (range(1, 9), "messages 1, 2, 3, 4, 5, … (8 in all)"),
    ],
)
def test_message_numbers_in_words(numbers: tuple[int, ...], text: str) -> None:
    assert replace(FINDINGS[0], message_numbers=numbers).messages_text == text


def test_json_holds_findings_and_summary() -> None:
    data: dict[str, Any] = as_json(EVIDENCE, summarise(EVIDENCE), FINDINGS)
    first = data["findings"][0]
    assert first["code"] == FINDINGS[0].code
    assert first["messages"] == list(FINDINGS[0].message_numbers)
    assert data["summary"]["messages"] == [{"message": "ODOMETRY", "outcome": "accepted", "count": 100}]


def test_sarif_names_every_check_and_every_finding() -> None:
    log: dict[str, Any] = as_sarif("my.tlog", "1.2", CHECKS, FINDINGS)
    (run,) = log["runs"]
    assert log["version"] == "2.1.0"
    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == [check.code for check in CHECKS]
    assert len(run["results"]) == len(FINDINGS)
    for result, finding in zip(run["results"], FINDINGS, strict=True):
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"] == finding.code
        assert result["level"] == finding.severity.value
        (location,) = result["locations"]
        assert location["physicalLocation"]["artifactLocation"]["uri"] == "my.tlog"


@pytest.mark.parametrize(
    ("file", "uri"),
    [("logs/my log.tlog", "logs/my%20log.tlog"), ("\x1b#\udcff", "%1B%23%FF"), ("udpin::14550", "udpin::14550")],
)
def test_sarif_names_the_file_by_its_uri(file: str, uri: str) -> None:
    log: dict[str, Any] = as_sarif(file, "1.2", CHECKS, FINDINGS[:1])
    (location,) = log["runs"][0]["results"][0]["locations"]
    assert location["physicalLocation"]["artifactLocation"]["uri"] == uri


def test_junit_spells_out_what_xml_cannot_hold() -> None:
    text = as_junit("\x1b\udcff.tlog", CHECKS, FINDINGS, Severity.NOTE)
    assert ET.fromstring(text).attrib["name"] == r"viso doctor \x1b\udcff.tlog"
    assert r"EKF \x00 &lt;says&gt; &amp; so" in text


@pytest.mark.parametrize("fail_on", list(Severity))
def test_junit_has_a_case_a_check_that_fails_from_a_severity_on(fail_on: Severity) -> None:
    suite = ET.fromstring(as_junit("my.tlog", CHECKS, FINDINGS, fail_on))
    failed = {case.attrib["name"].split()[0] for case in suite if case.find("failure") is not None}
    told = {case.attrib["name"].split()[0] for case in suite if case.find("system-out") is not None}
    assert suite.attrib["tests"] == str(len(CHECKS))
    assert suite.attrib["failures"] == str(len(failed))
    assert failed == {finding.code for finding in FINDINGS if finding.severity.at_least(fail_on)}
    assert told == {finding.code for finding in FINDINGS if not finding.severity.at_least(fail_on)}


def test_people_get_what_was_seen_what_happens_and_what_to_do() -> None:
    (finding,) = [finding for finding in FINDINGS if finding.code == "XN5-05"]
    head, seen, happens, fix, empty = (line.plain for line in finding_lines(finding, None))
    assert head == "error XN5-05  Quaternion not of length one"
    assert seen.startswith(
        "    stream: ODOMETRY from 1/197: 100 of 100 (100 %) messages have a quaternion of length 2 to 2"
    )
    assert happens.endswith("[AP_Math/quaternion.cpp, Quaternion::operator*]")
    assert fix.startswith("    fix: Normalise q")
    assert empty == ""


def test_lines_keep_to_the_width_of_the_terminal() -> None:
    assert all(len(line.plain) <= 70 for finding in FINDINGS for line in finding_lines(finding, 70))


@pytest.mark.parametrize("witness", list(Witness))
def test_witness_is_named_wherever_a_finding_is_told(witness: Witness) -> None:
    finding = Finding("XN9-01", Severity.NOTE, "t", "e", "f.", "s", "x.", witness, (), None, None)
    assert f"    {witness.value}: e" in [line.plain for line in finding_lines(finding, None)]
    assert f"(Witness: {witness.value}.)" in as_junit("a", CHECKS, [finding], Severity.NOTE)
    told = finding.as_dict()
    assert (told["witness"], told["model"]) == (witness.value, witness is Witness.MODEL)
    (run,) = json.loads(json.dumps(as_sarif("a", "1", CHECKS, [finding])))["runs"]
    assert run["results"][0]["properties"]["witness"] == witness.value


def test_counts_in_words() -> None:
    finding = FINDINGS[0]
    assert count_text([]) == "nothing was found"
    assert count_text([finding]) == "1 error"
    assert count_text([finding, finding]) == "2 errors"
