# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator is told of the range finders in each frame (AP_DAL/AP_DAL_RangeFinder.cpp)."""

from enum import IntEnum
from typing import Final, NamedTuple

from ekf_stub.inputs.range_reading import RangeFinder, RangeFinders
from ekf_stub.reports.core_report import Three

DOWNWARD: Final = 25
"""The orientation of range finders that the estimator uses (ROTATION_PITCH_270)."""


class RangeStatus(IntEnum):
    """What a range is worth (RangeFinder::Status)."""

    NOT_CONNECTED = 0
    NO_DATA = 1
    TOO_NEAR = 2
    TOO_FAR = 3
    GOOD = 4


class FinderState(NamedTuple):
    """One range finder: its place on the vehicle in m, body (FRD), its range in m, and where it looks."""

    place_frd: Three
    distance: float
    orientation: int
    status: int

    @property
    def is_usable(self) -> bool:
        """Whether it looks down and its range counts."""
        return self.orientation == DOWNWARD and self.status == RangeStatus.GOOD


class RangeState(NamedTuple):
    """All range finders, and how high the first that looks down stands on the ground and how far it sees, m."""

    finders: tuple[FinderState, ...]
    ground_clearance: float
    max_distance: float

    def seen_from(self, imu_frd: Three) -> RangeFinders:
        """Return what the filter takes of them, with their places from an IMU, which is at a place in m, body (FRD)."""
        finders = (RangeFinder(finder.distance, finder.is_usable, finder.place_frd) for finder in self.finders)
        return RangeFinders(tuple(finders), self.ground_clearance, self.max_distance).seen_from(imu_frd)
