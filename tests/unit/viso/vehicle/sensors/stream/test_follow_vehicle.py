# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole vehicle that follows a stream, as with ``viso serve --imu follow``: it starts aiding, aligns, arms, flies."""

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from mav_handlers.wire.messages import ODOMETRY
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource

if TYPE_CHECKING:
    from tests.unit.viso.conftest import Bench

pytestmark = pytest.mark.slow

ARM, ACCEPTED, DENIED = 400, 0, 4
RATE_HZ = 30
HEADING_RAD = math.radians(40)
CAMERA_YAW_RAD = math.radians(-20)
STARTS_S, READY_S, MOVES_S = 7.0, 25.0, 30.0

T265 = {
    "VISO_TYPE": 2,
    "GPS1_TYPE": 0,
    "DISARM_DELAY": 0,
    **dict.fromkeys(("EK3_SRC1_POSXY", "EK3_SRC1_VELXY", "EK3_SRC1_POSZ", "EK3_SRC1_VELZ"), 6),
}


def walk(time_s: float) -> tuple[float, float]:
    """Return how far the vehicle has come along its way at a time since it set out, m, and how fast it is, m/s."""
    if time_s <= 0:
        return 0.0, 0.0
    return 2 * (1 - math.cos(0.4 * time_s)), 0.8 * math.sin(0.4 * time_s)


def report(time_us: int, leap_m: float = 0.0) -> ODOMETRY:
    """Return what a camera sees that is turned about the vertical: the vehicle goes ahead, and back."""
    way, speed = walk(time_us * 1e-6 - MOVES_S)
    half, zeros = 0.5 * CAMERA_YAW_RAD, (0.0,) * 21
    x, y = way * math.cos(CAMERA_YAW_RAD), way * math.sin(CAMERA_YAW_RAD)
    quat = (math.cos(half), 0.0, 0.0, math.sin(half))
    motion = (speed, 0.0, 0.0, 0.0, 0.0, 0.0)
    return ODOMETRY(time_us, 20, 12, x + leap_m, y, 0.0, quat, *motion, zeros, zeros, 0, 3, 90)


class Follower:
    """A vehicle that follows, and a camera that reports to it until a time."""

    def __init__(self, bench: "Bench") -> None:
        self.bench = bench
        ahrs = bench.vehicle.ahrs
        assert isinstance(ahrs, Ekf3Ahrs)
        self.ahrs = ahrs

    def run_to(self, time_s: float, leap_m: float = 0.0) -> None:
        while self.bench.scheduler.now_us < time_s * 1e6:
            self.bench.send(report(self.bench.scheduler.now_us, leap_m))
            self.bench.run_for(1 / RATE_HZ)

    def texts(self) -> list[str]:
        return [text for _, _, text in self.bench.texts]

    def place(self) -> tuple[float, float]:
        position = self.ahrs.get_relative_position_NED_origin_float()
        assert position is not None
        return float(position.x), float(position.y)


@pytest.fixture
def follower(make_bench: Callable[..., "Bench"]) -> Follower:
    make = by_ekf3(FollowSource, ImuOptions(heading_rad=HEADING_RAD))
    made = Follower(make_bench(make_ahrs=make, **T265))
    made.bench.run_to(STARTS_S)
    return made


def test_vehicle_starts_aiding_aligns_and_arms(follower: Follower) -> None:
    assert follower.bench.command(ARM, 1) != ACCEPTED
    follower.run_to(READY_S)
    texts = follower.texts()
    assert "EKF3 IMU0 is using external nav data" in texts
    # The text has whole degrees, cut off.
    assert any(re.fullmatch(r"VisOdom: yaw shifted -?\d+ to (39|40) deg", text) for text in texts), texts
    assert follower.bench.command(ARM, 1) == ACCEPTED


def test_estimate_goes_where_the_camera_goes_turned_to_the_vehicles_heading(follower: Follower) -> None:
    follower.run_to(READY_S)
    assert follower.bench.command(ARM, 1) == ACCEPTED
    follower.run_to(MOVES_S)
    start = follower.place()
    for time_s in (32.0, 34.0, 38.0):
        follower.run_to(time_s)
        way, _ = walk(follower.bench.scheduler.now_us * 1e-6 - MOVES_S)
        there = start[0] + way * math.cos(HEADING_RAD), start[1] + way * math.sin(HEADING_RAD)
        assert math.dist(follower.place(), there) < 0.1


def test_leap_of_the_camera_is_rejected_by_the_gate(follower: Follower) -> None:
    follower.run_to(READY_S)
    before = follower.place()
    follower.run_to(READY_S + 3, leap_m=5.0)
    assert math.dist(follower.place(), before) < 0.1
    assert follower.ahrs.ext_nav_counts["pose", "model_gate_position"] > 2 * RATE_HZ
