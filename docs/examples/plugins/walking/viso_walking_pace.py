# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A check of the doctor, for a vehicle that is pushed along by hand: nobody pushes it faster than 3 m/s."""

import math
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
    fast = [one for one in evidence.stream.vision if speed_of(one.message) > MOST_M_S]
    if fast:
        yield Sighting.in_messages(f"{len(fast)} messages report more than {MOST_M_S:g} m/s", fast)


def speed_of(message: object) -> float:
    """Return the speed that a message reports in m/s; 0 for one that reports none."""
    return math.hypot(message.x, message.y, message.z) if isinstance(message, VISION_SPEED_ESTIMATE) else 0.0
