# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured, as the filter takes it: inertial data, GPS, optical flow, ranges; and places on the vehicle."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.reports import Three

Array = npt.NDArray[np.float64]


@dataclass(slots=True)
class InertialDelta:
    """What an IMU has measured since the last pass: m/s (specific force, gravity included) and rad, body (FRD).

    ``del_vel_dt`` and ``del_ang_dt`` are the seconds over which each was measured.
    """

    del_vel: Array
    del_ang: Array
    del_vel_dt: float
    del_ang_dt: float


def row_of(delta: InertialDelta) -> Array:
    """Return inertial data as eight numbers: change of velocity, rotation, and the seconds of either."""
    return np.array(numbers_of(delta))


def numbers_of(delta: InertialDelta) -> list[float]:
    """Return inertial data as eight numbers: change of velocity, rotation, and the seconds of either."""
    return [*delta.del_vel.tolist(), *delta.del_ang.tolist(), delta.del_vel_dt, delta.del_ang_dt]


class ImuReading(NamedTuple):
    """The data of an IMU in a pass, and whether gyro and accelerometer may be used."""

    delta: InertialDelta
    has_gyro: bool = True
    has_accel: bool = True


def first_usable(readings: tuple[ImuReading, ...]) -> tuple[int, int]:
    """Return the numbers of the first gyro and of the first accelerometer that may be used, 0 where none may."""
    gyro = next((imu for imu, reading in enumerate(readings) if reading.has_gyro), 0)
    return gyro, next((imu for imu, reading in enumerate(readings) if reading.has_accel), 0)


class BaroReading(NamedTuple):
    """The last reading of a barometer: ms since boot and height in m; and whether the barometer works."""

    time_ms: int
    height: float
    is_healthy: bool = True

    @property
    def timed_height(self) -> tuple[int, float]:
        """Its time and height."""
        return self.time_ms, self.height

    def lowered(self, zero_m: float) -> "BaroReading":
        """Return it with the height counted from another zero, in single precision."""
        return self._replace(height=float(np.float32(self.height - zero_m))) if zero_m else self


def first_healthy(readings: Sequence[BaroReading]) -> int:
    """Return the number of the first barometer that works, 0 where none does (AP_Baro::update)."""
    return next((number for number, reading in enumerate(readings) if reading.is_healthy), 0)


FIX_3D: Final = 3
USUAL_LAG_S: Final = 0.2


def whole_ms(lag_s: float) -> int:
    """Return a lag in ms as the firmware has it, which computes it in single precision and cuts it off."""
    return int(np.float32(1000) * np.float32(lag_s))


@dataclass(frozen=True, slots=True)
class GpsSample:
    """One solution of a GPS.

    ``time_ms`` is since boot. Accuracies and the vertical velocity are None when the receiver gives none; hdop and
    vdop are x 100, 65535 when unknown. ``yaw_deg`` is 0..360 from north. ``last_fix_ms`` is the ``time_ms`` of the last
    solution with a fix, 0 before the first. ``is_healthy`` says whether solutions have come regularly. ``lag_s`` is
    how old a solution is when it comes; the default is what the firmware assumes of most receivers. ``antenna`` is the
    antenna's place from the IMU, m, body (FRD).
    """

    time_ms: int
    fix_type: int
    location: Location
    vel_ned: Vector3f
    num_sats: int
    hdop: int = 65535
    vdop: int = 65535
    has_vertical_velocity: bool = False
    speed_accuracy: float | None = None
    horizontal_accuracy: float | None = None
    vertical_accuracy: float | None = None
    yaw_deg: float | None = None
    last_fix_ms: int = 0
    is_healthy: bool = True
    lag_s: float = USUAL_LAG_S
    antenna: Three = (0.0, 0.0, 0.0)


MAX_GPS: Final = 2
"""How many GPS receivers there may be."""


class AllGps(NamedTuple):
    """The newest solution of each GPS, None of one without any, and the number of the primary one, which is used."""

    solutions: tuple[GpsSample | None, ...] = ()
    primary: int = 0

    def of(self, number: int) -> GpsSample | None:
        """Return the solution of a GPS, None if there is none."""
        return self.solutions[number] if number < len(self.solutions) else None

    @property
    def used(self) -> GpsSample | None:
        """That of the primary one."""
        return self.of(self.primary)


NO_GPS: Final = AllGps()


class FlowMeasurement(NamedTuple):
    """What a flow sensor measures: rates about x and y, rad/s, positive as the sensor itself turns.

    Attributes:
        quality: 0..255; 0 is unusable.
        flow: by its camera.
        gyro: by its own gyro.
        offset: its place on the vehicle or from the IMU, m, body (FRD).
    """

    quality: int
    flow: tuple[float, float]
    gyro: tuple[float, float]
    offset: Three = (0.0, 0.0, 0.0)


_HERE: Final = (0.0, 0.0, 0.0)

T = TypeVar("T")


def from_imu(place_frd: Three, imu_frd: Three) -> Three:
    """Return a place as counted from an IMU, m, body (FRD)."""
    x, y, z = (place - imu for place, imu in zip(place_frd, imu_frd, strict=True))
    return x, y, z


def gps_counted_from(solution: GpsSample, imu_frd: Three) -> GpsSample:
    """Return a solution with its antenna's place as counted from an IMU, which is at a place in m, body (FRD)."""
    antenna = from_imu(solution.antenna, imu_frd)
    return solution if antenna == solution.antenna else replace(solution, antenna=antenna)


class PlaceCache(Generic[T]):
    """Measurements with their places counted from IMUs by ``move``, computed once.

    A measurement is replaced by a new object when it changes, and never changed itself. The result is the same object
    until then, or until the place of the IMU changes.
    """

    def __init__(self, move: Callable[[T, Three], T]) -> None:
        self._move = move
        self._known: dict[int, tuple[T, Three, T]] = {}

    def __call__(self, imu: int, measured: T, imu_frd: Three) -> T:
        """Return a measurement with places from an IMU, by the IMU's number and place in m, body (FRD)."""
        if imu_frd == _HERE:
            return measured
        known = self._known.get(imu)
        if known is None or known[0] is not measured or known[1] != imu_frd:
            known = self._known[imu] = measured, imu_frd, self._move(measured, imu_frd)
        return known[2]


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

    def counted_from(self, imu_frd: Three) -> "RangeState":
        """Return them with their places as counted from an IMU, which is at a place in m, body (FRD)."""
        finders = (finder._replace(place_frd=from_imu(finder.place_frd, imu_frd)) for finder in self.finders)
        return self._replace(finders=tuple(finders))
