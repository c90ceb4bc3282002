# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Places of sensors on the vehicle, m, body (FRD), as counted from an IMU (accelPosOffset)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final, Generic, TypeVar

from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.reports.core_report import Three

_HERE: Final = (0.0, 0.0, 0.0)

T = TypeVar("T")


def from_imu(place_frd: Three, imu_frd: Three) -> Three:
    """Return a place as counted from an IMU, m, body (FRD)."""
    x, y, z = (place - imu for place, imu in zip(place_frd, imu_frd, strict=True))
    return x, y, z


def gps_seen_from(solution: GpsSample, imu_frd: Three) -> GpsSample:
    """Return a solution with its antenna's place as counted from an IMU, which is at a place in m, body (FRD)."""
    antenna = from_imu(solution.antenna, imu_frd)
    return solution if antenna == solution.antenna else replace(solution, antenna=antenna)


class Moved(Generic[T]):
    """What has a place, as ``move`` counts it from each IMU: the same until it or the IMU's place changes."""

    def __init__(self, move: Callable[[T, Three], T]) -> None:
        self._move = move
        self._known: dict[int, tuple[T, Three, T]] = {}

    def __call__(self, imu: int, said: T, imu_frd: Three) -> T:
        """Return it as counted from an IMU, by its number and its place in m, body (FRD)."""
        if imu_frd == _HERE:
            return said
        known = self._known.get(imu)
        if known is None or known[0] is not said or known[1] != imu_frd:
            known = self._known[imu] = said, imu_frd, self._move(said, imu_frd)
        return known[2]
