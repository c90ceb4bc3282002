# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A settled vehicle whose AHRS, GPS, home and origin are what a test says."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import GpsSample
from ekf_stub.reports import FilterStatus
from mav_handlers.channel import Channel
from mav_handlers.wire.messages import Message
from viso.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

M = TypeVar("M", bound=Message)

NOW_US = 42_500_999


@dataclass(slots=True)
class KnownAhrs:
    """Every answer is an attribute."""

    quat: Quaternion | None = field(default_factory=Quaternion)
    gyro: Vector3f = field(default_factory=Vector3f)
    drift: Vector3f = field(default_factory=Vector3f)
    pos: Vector3f | None = None
    vel: Vector3f | None = None
    location: Location | None = None
    status: FilterStatus | None = None
    baro_m: float = 0.0
    is_initialised: bool = True
    is_healthy: bool = True
    place_of_origin: Location | None = None

    def face(self, roll: float, pitch: float, yaw: float) -> None:
        """Turn to an attitude in rad."""
        self.quat = Quaternion.from_euler(f32(roll), f32(pitch), f32(yaw))

    def initialised(self) -> bool:
        return self.is_initialised

    def healthy(self) -> bool:
        return self.is_healthy

    def get_quaternion(self) -> Quaternion | None:
        return self.quat

    def get_yaw_rad(self) -> np.float32:
        return f32(0) if self.quat is None else self.quat.get_euler_yaw()

    def get_gyro(self) -> Vector3f:
        return self.gyro

    def get_gyro_drift(self) -> Vector3f:
        return self.drift

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        return self.pos

    def baro_height_m(self) -> float:
        return self.baro_m

    def get_velocity_NED(self) -> Vector3f | None:
        return self.vel

    def get_location(self) -> Location | None:
        return self.location

    def last_location(self) -> Location | None:
        return self.location

    def get_filter_status(self) -> FilterStatus | None:
        return self.status

    def origin(self) -> Location | None:
        return self.place_of_origin


@dataclass(slots=True)
class KnownHome:
    """Home where a test puts it."""

    place: Location | None = None

    def take_changed(self) -> bool:
        return False


class Desk:
    """Asks builders what they have to say of the vehicle."""

    def __init__(self, bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
        self.bench = bench
        self.vehicle = bench.vehicle
        self.channel = bench.client.channel
        self.ahrs = KnownAhrs()
        self.gps: GpsSample | None = None
        self.second_gps: GpsSample | None = None
        self.known_home = KnownHome()
        monkeypatch.setattr(self.vehicle, "ahrs", self.ahrs)
        first, second = self.vehicle.gps.all
        monkeypatch.setattr(first, "sample", lambda: self.gps)
        monkeypatch.setattr(second, "sample", lambda: self.second_gps)
        monkeypatch.setattr(self.vehicle.copter, "home", self.known_home)

    @property
    def home(self) -> Location | None:
        """Home."""
        return self.known_home.place

    @home.setter
    def home(self, place: Location | None) -> None:
        self.known_home.place = place

    @property
    def origin(self) -> Location | None:
        """The EKF origin."""
        return self.ahrs.place_of_origin

    @origin.setter
    def origin(self, place: Location | None) -> None:
        self.ahrs.place_of_origin = place

    def ask(self, builder: Callable[[Vehicle, Channel, int], M | None], now_us: int = NOW_US) -> M:
        """Return the message, which must come."""
        message = builder(self.vehicle, self.channel, now_us)
        assert message is not None
        return message

    def has_nothing(self, builder: Callable[[Vehicle, Channel, int], Message | None]) -> bool:
        """Return whether there is nothing to report."""
        return builder(self.vehicle, self.channel, NOW_US) is None


@pytest.fixture
def desk(make_bench: "MakeBench", monkeypatch: pytest.MonkeyPatch) -> Desk:
    """Return a desk in front of a settled vehicle on a MAVLink 2 link."""
    return Desk(make_bench(filter_starts=False), monkeypatch)
