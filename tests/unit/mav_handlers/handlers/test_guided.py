# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets and sticks: who takes them, and what is understood of them."""

import math
from typing import TYPE_CHECKING, Any

import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from mav_handlers.handlers.commands.flight import GuidedTarget
from mav_handlers.verdicts import HANDLED, NO_FLIGHT, NOT_GUIDED, TARGET_REFUSED
from mav_handlers.wire.messages import (
    COMMAND_INT,
    SET_POSITION_TARGET_GLOBAL_INT,
    SET_POSITION_TARGET_LOCAL_NED,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

ACCEPTED, _, DENIED, UNSUPPORTED, FAILED = range(5)
GUIDED, ALT_HOLD = 4, 2
CONDITION_YAW, CHANGE_SPEED, REPOSITION, SET_MODE = 115, 178, 192, 176
POS, VEL, ACC, YAW, RATE = 0b111, 0b111 << 3, 0b111 << 6, 1 << 10, 1 << 11
FORCE = 1 << 9
HERE = Location(473977420, 85455940, 48800)


class Flight:
    """Who flies, for a test: remembers what it was told."""

    def __init__(self) -> None:
        self.told: list[Any] = []

    def guide(self, target: GuidedTarget | None) -> None:
        self.told.append(target)

    def place_ned(self, place: Location) -> tuple[float, float, float] | None:
        way = HERE.distance_ned(place)
        return float(way.x), float(way.y), float(way.z)

    def turn_to(self, yaw_rad: float, slew_rad_s: float, direction: int, *, is_relative: bool) -> None:
        self.told.append((round(math.degrees(yaw_rad)), round(math.degrees(slew_rad_s)), direction, is_relative))

    def change_speed(self, kind: int, speed_m_s: float) -> None:
        self.told.append((kind, speed_m_s))


@pytest.fixture
def flight(bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> Flight:
    """Return who flies the vehicle on the bench, in GUIDED."""
    flight = Flight()
    monkeypatch.setattr(bench.vehicle.copter, "flight", flight)
    assert bench.client.command(SET_MODE, 1, GUIDED) == ACCEPTED
    return flight


def local(mask: int, frame: int = 1, **values: float) -> SET_POSITION_TARGET_LOCAL_NED:
    zeros = dict.fromkeys(("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0)
    return SET_POSITION_TARGET_LOCAL_NED(0, 1, 1, frame, mask, **{**zeros, **values})


def on_earth(mask: int, frame: int, lat: int, lng: int, alt_m: float) -> SET_POSITION_TARGET_GLOBAL_INT:
    return SET_POSITION_TARGET_GLOBAL_INT(0, 1, 1, frame, mask, lat, lng, alt_m, *(0.0,) * 8)


PLACE_ALONE = VEL | ACC | YAW | RATE


def test_nobody_flies_it(bench: "Bench") -> None:
    assert bench.client.tell(local(PLACE_ALONE)) == NO_FLIGHT
    for number in (CONDITION_YAW, CHANGE_SPEED):
        assert bench.client.command(number) == UNSUPPORTED
    assert bench.client.command_int(REPOSITION) == UNSUPPORTED


def test_target_counts_in_guided_alone(bench: "Bench", flight: Flight) -> None:
    assert bench.client.command(SET_MODE, 1, ALT_HOLD) == ACCEPTED
    assert bench.client.tell(local(PLACE_ALONE, x=1.0)) == NOT_GUIDED
    assert flight.told == []


@pytest.mark.parametrize(
    ("message", "target"),
    [
        (local(PLACE_ALONE, x=1.0, y=2.0, z=-3.0), GuidedTarget((1.0, 2.0, -3.0))),
        (local(POS | ACC | YAW | RATE, vx=1.0, vz=-0.5), GuidedTarget(vel_ned_m_s=(1.0, 0.0, -0.5))),
        (local(POS | VEL | YAW | RATE, afx=0.5), GuidedTarget(acc_ned_m_s2=(0.5, 0.0, 0.0))),
        (local(ACC | YAW | RATE, x=1.0, vx=1.0), GuidedTarget((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
        (local(PLACE_ALONE, x=1.0, afx=math.nan), GuidedTarget((1.0, 0.0, 0.0))),
        (local(VEL | ACC | RATE, x=1.0, yaw=0.5), GuidedTarget((1.0, 0.0, 0.0), yaw_rad=0.5)),
        (local(VEL | ACC | YAW, x=1.0, yaw_rate=0.5), GuidedTarget((1.0, 0.0, 0.0), yaw_rate_rad_s=0.5)),
    ],
)
def test_mask_says_what_counts(
    bench: "Bench", flight: Flight, message: SET_POSITION_TARGET_LOCAL_NED, target: GuidedTarget
) -> None:
    assert bench.client.tell(message) == HANDLED
    assert flight.told == [target]


@pytest.mark.parametrize(
    "message",
    [
        local(POS | VEL | ACC | YAW | RATE),
        local(VEL | YAW | RATE, x=1.0, afx=1.0),
        local(PLACE_ALONE, frame=2, x=1.0),
        local(POS | ACC | YAW | RATE, vx=1001.0),
        local(POS | ACC | YAW | RATE, vx=math.nan),
        local(POS | VEL | YAW | RATE, afx=math.nan),
        local(PLACE_ALONE, x=math.inf),
        local((POS | VEL | YAW | RATE | FORCE), afx=1.0),
        on_earth(PLACE_ALONE, 10, HERE.lat, HERE.lng, 5.0),
        on_earth(PLACE_ALONE, 5, 1_000_000_000, 0, 5.0),
        on_earth(PLACE_ALONE, 5, HERE.lat, HERE.lng, math.nan),
    ],
    ids=[
        "nothing",
        "place and acceleration",
        "frame",
        "speed",
        "nan",
        "acceleration of nan",
        "inf",
        "force",
        "terrain",
        "latitude",
        "altitude",
    ],
)
def test_what_is_not_understood_makes_it_stay(bench: "Bench", flight: Flight, message: Any) -> None:
    assert bench.client.tell(message) == TARGET_REFUSED
    assert flight.told == [None]


def test_body_frames_turn_and_count_from_the_vehicle(
    bench: "Bench", flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.ahrs, "get_yaw_rad", lambda: math.pi / 2, raising=False)
    monkeypatch.setattr(
        bench.ahrs, "get_relative_position_NED_origin_float", lambda: Vector3f(10, 20, -5), raising=False
    )
    bench.client.tell(local(PLACE_ALONE, frame=9, x=1.0))
    bench.client.tell(local(PLACE_ALONE, frame=7, x=1.0))
    bench.client.tell(local(POS | ACC | YAW | RATE, frame=8, vx=1.0))
    body, offset, velocity = flight.told
    assert body.pos_ned_m == pytest.approx((10.0, 21.0, -5.0))
    assert offset.pos_ned_m == pytest.approx((11.0, 20.0, -5.0))
    assert velocity.vel_ned_m_s == pytest.approx((0.0, 1.0, 0.0))
    assert [target.is_yaw_relative for target in flight.told] == [True, False, True]


def test_place_on_earth_counts_above_the_sea_or_home(
    bench: "Bench", flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.client.tell(on_earth(PLACE_ALONE, 5, HERE.lat, HERE.lng, 490.0))
    bench.client.tell(on_earth(PLACE_ALONE, 6, HERE.lat, HERE.lng, 5.0))  # home is not set
    monkeypatch.setattr(bench.vehicle.copter.home, "place", HERE)
    bench.client.tell(on_earth(PLACE_ALONE, 6, HERE.lat, HERE.lng, 5.0))
    above_sea, without_home, above_home = flight.told
    assert above_sea.pos_ned_m == pytest.approx((0.0, 0.0, -2.0))
    assert without_home is None
    assert above_home.pos_ned_m == pytest.approx((0.0, 0.0, -5.0))


@pytest.mark.parametrize(("altitude_m", "down_m"), [(490.239, -2.23), (2.3, 485.7), (-1.239, 489.23)])
def test_altitude_is_cut_off_at_whole_centimetres(
    bench: "Bench", flight: Flight, altitude_m: float, down_m: float
) -> None:
    bench.client.tell(on_earth(PLACE_ALONE, 5, HERE.lat, HERE.lng, altitude_m))
    assert bench.client.command_int(REPOSITION, x=HERE.lat, y=HERE.lng, z=altitude_m, frame=5) == ACCEPTED
    assert [target.pos_ned_m[2] for target in flight.told] == pytest.approx([down_m] * 2, abs=1e-4)


@pytest.mark.parametrize(
    ("params", "result", "told"),
    [
        ((90.0, 30.0, -1.0, 0.0), ACCEPTED, [(90, 30, -1, False)]),
        ((20.0, 0.0, 0.0, 1.0), ACCEPTED, [(20, 0, 0, True)]),
        ((361.0, 0.0, 0.0, 0.0), FAILED, []),
        ((math.nan, 0.0, 0.0, 0.0), FAILED, []),
        ((90.0, 0.0, 0.0, 0.5), FAILED, []),
    ],
)
def test_condition_yaw(
    bench: "Bench", flight: Flight, params: tuple[float, ...], result: int, told: list[object]
) -> None:
    assert bench.client.command(CONDITION_YAW, *params) == result
    assert flight.told == told


@pytest.mark.parametrize(
    ("kind", "speed", "result"),
    [
        (1, 3.0, ACCEPTED),
        (0, 3.0, ACCEPTED),
        (3, 3.0, ACCEPTED),
        (4, 3.0, FAILED),
        (1, 0.0, DENIED),
        (1, math.nan, DENIED),
    ],
)
def test_change_of_speed(bench: "Bench", flight: Flight, kind: int, speed: float, result: int) -> None:
    assert bench.client.command(CHANGE_SPEED, kind, speed) == result
    assert flight.told == ([(kind, speed)] if result == ACCEPTED else [])


@pytest.mark.parametrize(
    ("mode", "flags", "frame", "lat", "result"),
    [
        (GUIDED, 0.0, 5, HERE.lat, ACCEPTED),
        (ALT_HOLD, 0.0, 5, HERE.lat, DENIED),
        (ALT_HOLD, 1.0, 5, HERE.lat, ACCEPTED),
        (GUIDED, 0.0, 10, HERE.lat, DENIED),
        (GUIDED, 0.0, 1, HERE.lat, DENIED),
        (GUIDED, 0.0, 5, 1_000_000_000, DENIED),
    ],
)
def test_reposition(bench: "Bench", flight: Flight, mode: int, flags: float, frame: int, lat: int, result: int) -> None:
    bench.client.command(SET_MODE, 1, mode)
    bench.client.tell(COMMAND_INT(1, 1, frame, REPOSITION, 0, 0, 0.0, flags, 0.0, 0.0, lat, HERE.lng, 490.0))
    assert bench.client.acknowledged() == result
    assert len(flight.told) == (result == ACCEPTED)
    assert bench.vehicle.copter.custom_mode() == (GUIDED if result == ACCEPTED else mode)


def test_flying_vehicle_tells_its_truth(make_bench: "MakeBench") -> None:
    bench = make_bench(flies=True)
    flight = bench.vehicle.copter.flight
    assert flight is not None
    assert flight.truth().rpy_rad == (0.0, 0.0, 0.0)
    for name in ("SIMSTATE", "SIM_STATE"):
        bench.endpoint.request_message(bench.client.channel, name)
    bench.run_ms(10)
    told = {type(message).__name__: message for message in bench.client.read()}
    assert told["SIMSTATE"].zacc == pytest.approx(-9.80665, abs=1e-3)  # type: ignore[attr-defined]
    assert told["SIM_STATE"].q1 == 1.0  # type: ignore[attr-defined]
