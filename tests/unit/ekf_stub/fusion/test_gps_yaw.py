# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When yaw is set by the velocity of GPS, and when the GSF runs at all."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ekf_stub.filter.inertial import GRAVITY_MSS, InertialStep
from ekf_stub.fusion.height_source import Vehicle
from ekf_stub.inputs.gps_reading import GpsFix

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

PARKED = Vehicle(armed=False, on_ground=True, in_flight=False)
FLYING = Vehicle(armed=True, on_ground=False, in_flight=True)
BY_GSF, BY_NOTHING, BY_COMPASS = "33138", "33130", "33131"
DT = 0.01
STEPS_PER_FIX = 20
HEADING = 1.0


class Flight:
    """A level vehicle that accelerates back and forth along its nose, and sees it by GPS."""

    def __init__(self, parts: "FilterParts") -> None:
        self.parts = parts
        self.parts.gps.speed_good = True
        self.now_ms = 100_000
        self._speed, self._sign = 0.0, 1
        at_rest = InertialStep(0, np.array([0.0, 0.0, -GRAVITY_MSS * DT]), np.zeros(3), DT, DT)
        parts.yaw.by_gps.predict(at_rest)

    def go(self, duration_s: float, vehicle: Vehicle = FLYING, *, accel_mss: float = 6.0) -> None:
        parts = self.parts
        for _ in range(round(duration_s / DT)):
            self.now_ms += 10
            if not 2 < self._speed < 6:
                self._sign = 1 if self._speed <= 2 else -1
            accel = self._sign * accel_mss
            self._speed += accel * DT
            step = InertialStep(self.now_ms, DT * np.array([accel, 0.0, -GRAVITY_MSS]), np.zeros(3), DT, DT)
            parts.gps.is_due = self.now_ms % (10 * STEPS_PER_FIX) == 0
            if parts.gps.is_due:
                vel = self._speed * np.array([math.cos(HEADING), math.sin(HEADING), 0.0])
                parts.gps.delayed = parts.gps.newest = GpsFix(self.now_ms, np.zeros(3), vel, True, None)
            parts.yaw.by_gps.follow_flight(vehicle, takeoff_expected=False, dt_ekf_avg=DT)
            parts.yaw.by_gps.predict(step)
            parts.yaw.control(vehicle)
            parts.yaw.step(self.now_ms, vehicle, step, is_still=False, climbed_m=lambda: 1.0)
            parts.yaw.correct_by_gps(self.now_ms, vehicle)

    def yaw_error_deg(self) -> float:
        return math.degrees(math.remainder(self.parts.state.yaw(by_321=True) - HEADING, 2 * math.pi))


def test_yaw_is_aligned_by_the_gsf_and_then_fused(make_parts: MakeParts) -> None:
    flight = Flight(make_parts(BY_GSF))
    flight.go(2.5)
    assert flight.parts.told() == ["yaw aligned using GPS"]
    assert (flight.parts.yaw.aligned, flight.parts.yaw.resets) == (True, 1)
    flight.parts.turn_to(yaw=HEADING + 0.2)
    flight.go(2.5)
    assert abs(flight.yaw_error_deg()) < 8
    assert flight.parts.told() == []


def test_gsf_aligns_yaw_where_a_compass_is_missing(make_parts: MakeParts) -> None:
    flight = Flight(make_parts(BY_NOTHING))
    flight.go(2.5)
    assert flight.parts.told()[0] in ("yaw aligned using GPS", "yaw aligned to GPS velocity")
    assert abs(flight.yaw_error_deg()) < 15


def test_yaw_is_aligned_to_the_course_without_the_gsf(make_parts: MakeParts) -> None:
    flight = Flight(make_parts(BY_NOTHING, GSF_USE_MASK=0))
    flight.go(2.5)
    assert flight.parts.told() == ["yaw aligned to GPS velocity"]
    assert abs(flight.yaw_error_deg()) < 1


@pytest.mark.parametrize(("sources", "params", "vehicle"), [
    (BY_GSF, {"GSF_RUN_MASK": 2}, FLYING),
    ("63138", {}, FLYING),
    ("36138", {}, FLYING),
    (BY_GSF, {}, PARKED),
])  # fmt: skip
def test_gsf_does_not_align_yaw(
    make_parts: MakeParts, sources: str, params: dict[str, float], vehicle: Vehicle
) -> None:
    flight = Flight(make_parts(sources, **params))
    flight.go(3.0, vehicle)
    assert (flight.parts.told(), flight.parts.yaw.aligned) == ([], False)


def test_gsf_waits_for_a_gps_that_tells_velocity_well(make_parts: MakeParts) -> None:
    flight = Flight(make_parts(BY_GSF))
    flight.parts.gps.speed_good = False
    flight.go(2.0)
    assert flight.parts.yaw.by_gps.report() is None


def test_gsf_stops_when_the_vehicle_is_disarmed(make_parts: MakeParts) -> None:
    flight = Flight(make_parts(BY_GSF))
    flight.go(2.0)
    assert flight.parts.yaw.by_gps.estimate() is not None
    flight.go(DT, PARKED)
    assert flight.parts.yaw.by_gps.estimate() is None


def test_emergency_resets_yaw_as_often_as_allowed_and_ends_the_use_of_the_compass(make_parts: MakeParts) -> None:
    flight = Flight(make_parts(BY_COMPASS, GSF_RST_MAX=1))
    parts = flight.parts
    parts.yaw.aligned = True
    flight.go(2.5)
    assert (parts.told(), parts.yaw.uses_compass) == ([], True)
    parts.yaw.by_gps.request(flight.now_ms)
    flight.go(0.1)
    assert (parts.told(), parts.yaw.uses_compass) == (["emergency yaw reset"], False)
    assert abs(flight.yaw_error_deg()) < 5
    parts.yaw.by_gps.request(flight.now_ms)
    flight.go(0.1)
    assert parts.told() == []


def test_request_for_a_reset_lasts_5_s(make_parts: MakeParts) -> None:
    flight = Flight(make_parts(BY_COMPASS))
    flight.parts.yaw.aligned = True
    flight.go(0.5, accel_mss=0.0)
    flight.parts.yaw.by_gps.request(flight.now_ms - 5000)
    flight.go(2.5)
    assert flight.parts.told() == []
