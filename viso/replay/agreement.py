# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How near the filter of a flight that is flown again comes to the log's own."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from ekf_stub.inputs.measurements import Array
from viso.logs.filter_records import filter_records_in
from viso.logs.recorded import read_columns

_GAP_US: Final = 500_000
_LATER_US: Final = 1_000_000
_APART_M: Final = 1.0


@dataclass(frozen=True, slots=True)
class Agreement:
    """The distance between the positions of the two filters, as the root of the mean square in m.

    Attributes:
        position_m, horizontal_m, height_m: over all the time in which both knew a position.
        second_half_m: over the second half of that time.
        first_height_m: the distance in height at first.
        log_before_s: for how long the log's filter had known a position before the other did.
    """

    position_m: float
    horizontal_m: float
    height_m: float
    second_half_m: float
    first_height_m: float
    log_before_s: float

    def lines(self) -> Iterator[str]:
        """Yield the agreement in sentences, with a likely reason where it is bad."""
        yield (
            f"Agreement with the log's own filter: positions are {self.position_m:.3f} m apart (root of the mean "
            f"square), {self.horizontal_m:.3f} m horizontally, {self.height_m:.3f} m in height; "
            f"{self.second_half_m:.3f} m in the second half of the time."
        )
        if self.log_before_s * 1e6 > _LATER_US and self.first_height_m > _APART_M:
            yield (
                f"The log's filter had a position {self.log_before_s:.1f} s before: it ran already when the log began. "
                f"The filter here starts later, and takes its first height from the pose, whatever EK3_SRC1_POSZ is, "
                f"{self.first_height_m:.1f} m from the log's."
            )

    def as_dict(self) -> dict[str, float]:
        """Return the distances for machine-readable output."""
        return asdict(self)


def agreement_of(time_us: Array, places: Array, track: Array) -> Agreement | None:
    """Compare places [N, 3] at times with a track [M, 4] of time in us and NED in m, where it has no gap.

    None if the two never knew a position at the same time.
    """
    if len(track) < 2 or not len(places):
        return None
    after = np.clip(np.searchsorted(track[:, 0], time_us), 1, len(track) - 1)
    near = (time_us >= track[0, 0]) & (time_us <= track[-1, 0]) & (track[after, 0] - track[after - 1, 0] < _GAP_US)
    if not near.any():
        return None
    there = np.column_stack([np.interp(time_us, track[:, 0], track[:, axis]) for axis in (1, 2, 3)])
    squares, both_us = ((places - there) ** 2)[near], time_us[near]
    later = squares[both_us >= 0.5 * (both_us[0] + both_us[-1])]

    def root(rows: Array) -> float:
        return float(np.sqrt(np.mean(np.sum(rows, axis=1))))

    return Agreement(
        root(squares),
        root(squares[:, :2]),
        root(squares[:, 2:]),
        root(later),
        float(np.sqrt(squares[0, 2])),
        float(time_us[0] - track[0, 0]) * 1e-6,
    )


def own_yaw_line(log: Path) -> str | None:
    """Return how large the yaw innovations of a log's own filter were, in a sentence; None if they are not known."""
    yaw = filter_records_in(read_columns(log)).innovations["IYAW"]
    yaw = yaw[np.isfinite(yaw)]
    if not len(yaw):
        return None
    rms, worst = float(np.sqrt(np.mean(yaw**2))), float(np.abs(yaw).max())
    return (
        f"Yaw innovations of the log's own filter: {rms:.1f} deg (root of the mean square), {worst:.1f} deg at worst."
    )
