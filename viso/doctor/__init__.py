# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What would the autopilot do with a stream of external navigation, and what to change."""

from viso.doctor.evidence import Evidence, SeenMessage
from viso.doctor.findings import Finding, Rule, Severity, Sighting, diagnose
from viso.doctor.gather import GatherOptions, gather
from viso.doctor.rules import RULES

__all__ = [
    "RULES",
    "Evidence",
    "Finding",
    "GatherOptions",
    "Rule",
    "SeenMessage",
    "Severity",
    "Sighting",
    "diagnose",
    "gather",
]
