# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator is told of the range finders in each frame (AP_DAL/AP_DAL_RangeFinder.cpp)."""

from enum import IntEnum
from typing import Final, NamedTuple

from ekf_stub.inputs.places import from_imu
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
    """One range finder: its place on the vehicle or from the IMU, m, body (FRD), its range in m, and where it looks."""

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
    ground_clearance: float = 0.0
    max_distance: float = 0.0

    def seen_from(self, imu_frd: Three) -> "RangeState":
        """Return them with their places as counted from an IMU, which is at a place in m, body (FRD)."""
        finders = (finder._replace(place_frd=from_imu(finder.place_frd, imu_frd)) for finder in self.finders)
        return self._replace(finders=tuple(finders))
