# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A check of the doctor, for a vehicle that is pushed along by hand: nobody pushes it faster than 3 m/s."""

from collections.abc import Iterator

from mav_handlers import VISION_SPEED_ESTIMATE
from viso.doctor import Evidence, Severity, Sighting, check

MOST_M_S = 3.0


@check(
    code="WALK-01",
    severity=Severity.WARNING,
    title="Faster than anybody walks",
    firmware="The filter takes any speed that its gates let through.",
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseVelPosNED",
    fix="Look for a wrong scale, or for mismatches.",
)
def too_fast(evidence: Evidence) -> Iterator[Sighting]:
    """Yield what is reported faster than anybody walks."""
    speeds = ((one.number, one.message) for one in evidence.messages if isinstance(one.message, VISION_SPEED_ESTIMATE))
    numbers = [number for number, said in speeds if said.x**2 + said.y**2 + said.z**2 > MOST_M_S**2]
    if numbers:
        yield Sighting(f"{len(numbers)} messages report more than {MOST_M_S:g} m/s", numbers)
