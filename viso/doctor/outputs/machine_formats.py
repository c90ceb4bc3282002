# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings for machines: JSON, SARIF 2.1.0 for code hosts, JUnit for build servers."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from typing import Final
from urllib.parse import quote

from viso.doctor.evidence import Evidence
from viso.doctor.findings import Finding, Rule, Severity, numbers_text
from viso.doctor.outputs.summary import Summary
from viso.terminal.printable import printable

SARIF_VERSION: Final = "2.1.0"
_NUMBERS_IN_SARIF: Final = 100


def as_json(evidence: Evidence, summary: Summary, findings: Sequence[Finding]) -> dict[str, object]:
    """Return everything for machines."""
    return {
        "stream": evidence.name,
        "firmware": evidence.firmware.name,
        "findings": [finding.as_dict() for finding in findings],
        "summary": summary.as_dict(),
        "assumed": {one.name: one.value for one in evidence.assumed},
        "notes": list(evidence.notes),
    }


def whole_text(finding: Finding) -> str:
    """Return a finding as one paragraph: what was seen, by what witness, what the autopilot does, what to do."""
    return f"{finding.evidence}. (Witness: {finding.witness.value}.) {finding.firmware} Fix: {finding.fix}"


def _sarif_rule(rule: Rule) -> dict[str, object]:
    return {
        "id": rule.code,
        "name": "".join(word.capitalize() for word in rule.title.split() if word.isalnum()),
        "shortDescription": {"text": rule.title},
        "fullDescription": {"text": rule.firmware},
        "help": {"text": rule.fix},
        "defaultConfiguration": {"level": rule.severity.value},
        "properties": {"firmware": rule.source, "witness": rule.witness.value},
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
                "logicalLocations": [{"name": numbers_text(finding.message_numbers) or "the whole stream"}],
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


def as_sarif(file: str, version: str, rules: Sequence[Rule], findings: Iterable[Finding]) -> dict[str, object]:
    """Return findings of some rules in a file, as the user named it, as SARIF; its levels are those of findings."""
    index = {rule.code: number for number, rule in enumerate(rules)}
    return {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": SARIF_VERSION,
        "runs": [
            {
                "tool": {"driver": {"name": "viso doctor", "version": version, "rules": [*map(_sarif_rule, rules)]}},
                "results": [_sarif_result(finding, index[finding.code], file) for finding in findings],
            }
        ],
    }


def as_junit(file: str, rules: Sequence[Rule], findings: Sequence[Finding], fail_on: Severity) -> str:
    """Return findings as JUnit XML: a test case a rule, which fails with findings at or above a severity.

    Findings below it are in the output of their case. XML cannot hold control characters: they are spelled out.
    """
    suite = ET.Element(
        "testsuite", name=f"viso doctor {printable(file)}", tests=str(len(rules)), errors="0", skipped="0"
    )
    failed = 0
    for rule in rules:
        case = ET.SubElement(suite, "testcase", classname=f"doctor.{rule.family}", name=f"{rule.code} {rule.title}")
        of_rule = [finding for finding in findings if finding.code == rule.code]
        bad = [finding for finding in of_rule if finding.severity.at_least(fail_on)]
        if bad:
            failed += 1
            failure = ET.SubElement(case, "failure", message=printable(bad[0].evidence), type=bad[0].severity.value)
            failure.text = printable("\n".join(map(whole_text, bad)))
        mild = [finding for finding in of_rule if finding not in bad]
        if mild:
            ET.SubElement(case, "system-out").text = printable("\n".join(map(whole_text, mild)))
    suite.set("failures", str(failed))
    ET.indent(suite)
    return ET.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
