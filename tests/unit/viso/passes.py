# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes of the main loop a vehicle makes."""

import pytest

from viso.vehicle.vehicle import Vehicle


def times_of_passes(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list to which the time of every pass of the main loop is appended, in us since boot."""
    times: list[int] = []
    advance = vehicle.advance

    def noted(times_us: range) -> int:
        count = advance(times_us)
        times.extend(times_us[:count])
        return count

    monkeypatch.setattr(vehicle, "advance", noted)
    return times
