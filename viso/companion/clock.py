# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion computer's clock, which is not the autopilot's."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OffsetClock:
    """A clock with its own epoch and its own rate.

    Attributes:
        offset_us: what it shows when the autopilot boots.
        drift_ppm: how much faster it runs, in parts per million.
    """

    offset_us: int = 0
    drift_ppm: float = 0.0

    def time_us(self, true_us: int) -> int:
        """Return what it shows ``true_us`` after the autopilot's boot."""
        return self.offset_us + true_us + int(true_us * self.drift_ppm * 1e-6)
