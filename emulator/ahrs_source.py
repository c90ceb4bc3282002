# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vehicle's attitude and position come from: the bench, or a recorded log."""

from collections.abc import Callable
from pathlib import Path

from ekf_stub.ahrs_recorded import RecordedAhrs
from emulator.recorded_log import read_recorded_states
from emulator.vehicle_config import AhrsParts, VehicleAhrs, bench


def ahrs_maker(log: Path | None, heading_deg: float) -> Callable[[AhrsParts], VehicleAhrs]:
    """Return the maker of an AHRS that follows a log, or without one stands still with a heading.

    Raises:
        InputError: the log cannot be read, or has no attitude.
    """
    if log is None:
        return bench(heading_deg)
    states = read_recorded_states(log)
    return lambda parts: RecordedAhrs(parts.clock, parts.sources, parts.log, states)
