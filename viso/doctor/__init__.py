# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso doctor`: what the autopilot would do with a stream of external navigation, and what to change."""

from viso.doctor.checks import CHECKS, all_checks
from viso.doctor.checks.check import Check, Finding, Severity, Sighting, check, diagnose
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.gathering import gather
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.tracks import HandledMessage
from viso.doctor.evidence.vehicle_data import VehicleData

__all__ = [
    "CHECKS",
    "Check",
    "Evidence",
    "Finding",
    "HandledMessage",
    "Severity",
    "Sighting",
    "VehicleData",
    "Witness",
    "all_checks",
    "check",
    "diagnose",
    "gather",
]
