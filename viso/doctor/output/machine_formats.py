# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings for machines: JSON, SARIF 2.1.0 for code hosts, JUnit for build servers."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from typing import Final
from urllib.parse import quote

from viso.doctor.checks.causes import probable_cause
from viso.doctor.checks.check import Check, Finding, Severity
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.output.summary import Summary
from viso.terminal.process import printable

SARIF_VERSION: Final = "2.1.0"
_NUMBERS_IN_SARIF: Final = 100


def as_json(evidence: Evidence, summary: Summary, findings: Sequence[Finding]) -> dict[str, object]:
    """Return evidence, summary and findings as JSON has them."""
    cause = probable_cause(findings)
    return {
        "stream": evidence.stream.name,
        **evidence.set_up.judged_by.as_dict(),
        "findings": [finding.as_dict() for finding in findings],
        "probable_cause": None if cause is None else cause.as_dict(),
        "summary": summary.as_dict(),
        "assumed": {parameter.name: parameter.value for parameter in evidence.set_up.assumed},
        "notes": list(evidence.notes),
    }


def whole_text(finding: Finding) -> str:
    """Return a finding as one paragraph: the evidence, its witness, what the autopilot does, what to do."""
    return f"{finding.evidence}. (Witness: {finding.witness.value}.) {finding.firmware} Fix: {finding.fix}"


def _sarif_rule(check: Check) -> dict[str, object]:
    return {
        "id": check.code,
        "name": "".join(word.capitalize() for word in check.title.split() if word.isalnum()),
        "shortDescription": {"text": check.title},
        "fullDescription": {"text": check.firmware},
        "help": {"text": check.fix},
        "defaultConfiguration": {"level": check.severity.value},
        "properties": {"firmware": check.source, "witness": check.witness.value},
    }


def _sarif_result(finding: Finding, index: int, file: str) -> dict[str, object]:
    return {
        "ruleId": finding.code,
        "ruleIndex": index,
        "level": finding.severity.value,
        "message": {"text": whole_text(finding)},
        "locations": [
            {
                "physicalLocation": {"artifactLocation": {"uri": quote(os.fsencode(file), safe="/:")}},
                "logicalLocations": [{"name": finding.messages_text or "the whole stream"}],
            }
        ],
        "properties": {
            "messages": list(finding.message_numbers[:_NUMBERS_IN_SARIF]),
            "count": len(finding.message_numbers),
            "witness": finding.witness.value,
            "start_us": finding.start_us,
            "end_us": finding.end_us,
        },
    }


def as_sarif(file: str, version: str, checks: Sequence[Check], findings: Iterable[Finding]) -> dict[str, object]:
    """Return the findings of some checks as SARIF; ``file`` is the name that the user gave."""
    index = {check.code: number for number, check in enumerate(checks)}
    return {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": SARIF_VERSION,
        "runs": [
            {
                "tool": {"driver": {"name": "viso doctor", "version": version, "rules": [*map(_sarif_rule, checks)]}},
                "results": [_sarif_result(finding, index[finding.code], file) for finding in findings],
            }
        ],
    }


def as_junit(file: str, checks: Sequence[Check], findings: Sequence[Finding], fail_on: Severity) -> str:
    """Return findings as JUnit XML: one test case per check, which fails with findings at or above a severity.

    Findings below it are in the output of their case. XML cannot hold control characters: they are spelled out.
    """
    suite = ET.Element(
        "testsuite", name=f"viso doctor {printable(file)}", tests=str(len(checks)), errors="0", skipped="0"
    )
    failed = 0
    for check in checks:
        case = ET.SubElement(suite, "testcase", classname=f"doctor.{check.family}", name=f"{check.code} {check.title}")
        of_check = [finding for finding in findings if finding.code == check.code]
        bad = [finding for finding in of_check if finding.severity.at_least(fail_on)]
        if bad:
            failed += 1
            failure = ET.SubElement(case, "failure", message=printable(bad[0].evidence), type=bad[0].severity.value)
            failure.text = printable("\n".join(map(whole_text, bad)))
        mild = [finding for finding in of_check if finding not in bad]
        if mild:
            ET.SubElement(case, "system-out").text = printable("\n".join(map(whole_text, mild)))
    suite.set("failures", str(failed))
    ET.indent(suite)
    return ET.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
