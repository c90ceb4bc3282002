# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vehicle's attitude and position come from: the bench, or a recorded log."""

import math
from collections.abc import Callable
from pathlib import Path

from ekf_stub.ahrs_recorded import RecordedAhrs
from emulator.errors import InputError
from emulator.recorded_log import read_recorded_states
from emulator.vehicle_config import AhrsParts, VehicleAhrs, bench


def ahrs_maker(log: Path | None, heading_deg: float) -> Callable[[AhrsParts], VehicleAhrs]:
    """Return the maker of an AHRS that follows a log, or without one stands still with a heading.

    Raises:
        InputError: the log cannot be read, or has no attitude; or the heading is no angle.
    """
    if not math.isfinite(heading_deg):
        raise InputError(f"--heading {heading_deg}: not an angle in degrees")
    if log is None:
        return bench(heading_deg)
    states = read_recorded_states(log)
    return lambda parts: RecordedAhrs(parts.clock, parts.sources, parts.log, states)
