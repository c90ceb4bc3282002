# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What would the autopilot do with a stream of external navigation, and what to change."""

from emulator.doctor.evidence import Evidence, SeenMessage
from emulator.doctor.findings import Finding, Rule, Severity, Sighting, diagnose
from emulator.doctor.gather import GatherOptions, gather
from emulator.doctor.rules import RULES

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
