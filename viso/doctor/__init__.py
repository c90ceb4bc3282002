# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso doctor`: what the autopilot would do with a stream of external navigation, and what to change."""

from viso.doctor.evidence import Evidence, SeenMessage
from viso.doctor.findings import Finding, Rule, Severity, Sighting, diagnose, error, note, warning
from viso.doctor.gathering import GatherOptions, gather
from viso.doctor.measures.own_filter import Witness
from viso.doctor.rules import RULES, all_rules

__all__ = [
    "RULES",
    "Evidence",
    "Finding",
    "GatherOptions",
    "Rule",
    "SeenMessage",
    "Severity",
    "Sighting",
    "Witness",
    "all_rules",
    "diagnose",
    "error",
    "gather",
    "note",
    "warning",
]
