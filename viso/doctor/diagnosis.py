# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The diagnosis: checks run on the evidence that was gathered."""

from collections.abc import Iterable

import numpy as np

from viso.doctor.checks.check import Check, Finding, make_finding
from viso.doctor.evidence.evidence import Evidence


def diagnose(evidence: Evidence, checks: Iterable[Check]) -> list[Finding]:
    """Return what checks find, worst first, then by code.

    A check does not run if the recording lacks what it needs.
    """
    with np.errstate(all="ignore"):  # streams hold NaN and infinity
        findings = [
            make_finding(check, sighting, evidence.vehicle_witness)
            for check in checks
            if check.needs.isdisjoint(evidence.stream.lacks)
            for sighting in check.find(evidence)
        ]
    return sorted(findings, key=lambda finding: (finding.severity.rank, finding.code))
