# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that set home and place the vehicle."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.location import Location
from mav_handlers.handlers.commands.results import u32_of_float, u64_of_float
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_INT, HOME_POSITION, SET_HOME_POSITION, STATUSTEXT

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

ACCEPTED, _, DENIED, UNSUPPORTED, FAILED = range(5)
SET_HOME, GET_HOME, ORIGIN, POSITION, WIND = 179, 410, 611, 43003, 43004
LAT, LNG = -353_632_610, 1_491_652_300
NAN = math.nan


@pytest.fixture
def bench(make_bench: "MakeBench") -> "Bench":
    """Return a vehicle whose EKF has an origin."""
    bench = make_bench()
    assert bench.client.command_int(ORIGIN, LAT, LNG, 584.0) == ACCEPTED
    bench.run_ms(10)
    bench.client.read()
    return bench


def home(bench: "Bench") -> Location | None:
    return bench.vehicle.copter.home.place


class TestSetHome:
    """DO_SET_HOME."""

    @pytest.mark.parametrize("frame", [0, 5])
    def test_place_is_taken(self, bench: "Bench", frame: int) -> None:
        assert bench.client.command_int(SET_HOME, LAT + 1, LNG - 1, 600.129, frame=frame) == ACCEPTED
        assert home(bench) == Location(LAT + 1, LNG - 1, 60_012)

    def test_place_of_a_long_command_is_in_degrees(self, bench: "Bench") -> None:
        assert bench.client.command(SET_HOME, 0, 0, 0, 0, -35.25, 149.5, 600.0) == ACCEPTED
        # In float32 1495000000 is no number.
        assert home(bench) == Location(-352_500_000, 1_495_000_064, 60_000)

    def test_every_link_is_told(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.client.command_int(ORIGIN, LAT, LNG, 584.0)
        bench.run_ms(10)
        for client in bench.clients:
            client.read()
        bench.client.command_int(SET_HOME, LAT + 100, LNG, 600.0)
        bench.run_ms(3)
        for client in bench.clients:
            [told] = client.read_of(HOME_POSITION)
            assert (told.latitude, told.longitude, told.altitude) == (LAT + 100, LNG, 600_000)
            assert (told.x, told.y, told.z) == pytest.approx((1.1132, 0.0, -16.0), abs=1e-3)

    @pytest.mark.parametrize("frame", [3, 6])
    def test_height_above_home_counts_from_the_home_before(self, bench: "Bench", frame: int) -> None:
        assert bench.client.command_int(SET_HOME, LAT, LNG, 10.0, frame=frame) == FAILED
        bench.client.command_int(SET_HOME, LAT, LNG, 600.0)
        assert bench.client.command_int(SET_HOME, LAT, LNG, 10.0, frame=frame) == ACCEPTED
        assert home(bench) == Location(LAT, LNG, 61_000)

    def test_height_above_homes_above_each_other_wraps_in_32_bits(self, bench: "Bench") -> None:
        bench.client.command_int(SET_HOME, LAT, LNG, 0.0)
        for _ in range(259):  # 21 497 km
            assert bench.client.command_int(SET_HOME, LAT, LNG, 83_000.0, frame=3) == ACCEPTED
        assert home(bench) == Location(LAT, LNG, 259 * 8_300_000 - (1 << 32))

    @pytest.mark.parametrize("frame", [10, 11])
    def test_height_above_terrain_is_unknown(self, bench: "Bench", frame: int) -> None:
        assert bench.client.command_int(SET_HOME, LAT, LNG, 10.0, frame=frame) == FAILED

    def test_other_frames_are_denied_with_a_text(self, bench: "Bench") -> None:
        assert bench.client.command_int(SET_HOME, LAT, LNG, 10.0, frame=1) == DENIED
        bench.run_ms(3)
        assert bench.client.read_of(STATUSTEXT) == [STATUSTEXT(6, "Unknown mavlink coordinate frame 1")]

    @pytest.mark.parametrize(("z", "result"), [
        (NAN, DENIED), (83_001.0, DENIED), (-83_001.0, DENIED), (math.inf, DENIED), (83_000.0, ACCEPTED),
    ])  # fmt: skip
    def test_height_has_limits(self, bench: "Bench", z: float, result: int) -> None:
        assert bench.client.command_int(SET_HOME, LAT, LNG, z) == result

    @pytest.mark.parametrize(("lat", "lng"), [(900_000_001, 0), (0, 1_800_000_001), (-900_000_001, 5)])
    def test_place_off_the_globe_fails(self, bench: "Bench", lat: int, lng: int) -> None:
        assert bench.client.command_int(SET_HOME, lat, lng, 10.0) == FAILED

    def test_home_needs_an_origin(self, make_bench: "MakeBench") -> None:
        bench = make_bench()
        assert bench.client.command_int(SET_HOME, LAT, LNG, 584.0) == FAILED
        assert bench.client.command(SET_HOME, 1) == FAILED
        assert bench.client.command(GET_HOME) == FAILED

    @pytest.mark.parametrize("params", [(1.0,), (0.0,), (1.0, 0, 0, 0, 10.0, 20.0)])
    def test_here_is_asked_for_by_param1_or_by_no_place(self, bench: "Bench", params: tuple[float, ...]) -> None:
        assert bench.client.command(SET_HOME, *params) == FAILED
        bench.client.command_int(SET_HOME, LAT + 7, LNG, 600.0)
        vars(bench.ahrs)["get_location"] = lambda: Location(LAT, LNG, 1234)
        assert bench.client.command(SET_HOME, *params) == ACCEPTED
        assert home(bench) == Location(LAT, LNG, 1234)

    def test_other_values_of_param1_fail(self, bench: "Bench") -> None:
        bench.client.tell(COMMAND_INT(1, 1, 0, SET_HOME, 0, 0, 2.0, 0.0, 0.0, 0.0, LAT, LNG, 584.0))
        assert bench.client.read_of(COMMAND_ACK)[0].result == FAILED

    def test_message_that_would_set_home_is_ignored(self, bench: "Bench") -> None:
        before = home(bench)
        q = (1.0, 0.0, 0.0, 0.0)
        bench.client.tell(SET_HOME_POSITION(1, LAT, LNG, 1000, 0.0, 0.0, 0.0, q, 0.0, 0.0, 0.0))
        assert bench.client.read() == []
        assert home(bench) == before


class TestExternalPosition:
    """EXTERNAL_POSITION_ESTIMATE."""

    @pytest.fixture
    def given(self, bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> list[tuple[Location, np.float32, int]]:
        """Return what the AHRS is given; it uses everything."""
        calls: list[tuple[Location, np.float32, int]] = []

        def take(location: Location, accuracy_m: np.float32, time_ms: int) -> bool:
            calls.append((location, accuracy_m, time_ms))
            return True

        monkeypatch.setattr(bench.ahrs, "handle_external_position_estimate", take)
        return calls

    def send(self, bench: "Bench", *, frame: int = 0, z: float = NAN, delay_s: float = 0.0, time_s: float = 0.0) -> int:
        bench.client.tell(COMMAND_INT(1, 1, frame, POSITION, 0, 0, time_s, delay_s, 7.5, 0.0, LAT, LNG, z))
        return bench.client.read_of(COMMAND_ACK)[-1].result

    @pytest.mark.parametrize("frame", [0, 5])
    def test_place_and_accuracy_are_handed_on(self, bench: "Bench", given: list[object], frame: int) -> None:
        assert self.send(bench, frame=frame) == ACCEPTED
        assert given == [(Location(LAT, LNG, 0), 7.5, bench.now_us // 1000)]

    def test_delay_is_taken_off_the_corrected_time(
        self, bench: "Bench", given: list[tuple[Location, np.float32, int]]
    ) -> None:
        self.send(bench, time_s=100.0, delay_s=0.25)
        assert given[0][2] == bench.now_us // 1000 - 250

    def test_delay_longer_than_the_time_since_boot_is_ignored(
        self, bench: "Bench", given: list[tuple[Location, np.float32, int]]
    ) -> None:
        self.send(bench, time_s=100.0, delay_s=1e6)
        assert given[0][2] == bench.now_us // 1000

    @pytest.mark.parametrize(("frame", "z"), [(0, 0.0), (3, NAN), (6, NAN), (1, NAN), (5, 584.0)])
    def test_height_is_not_taken(self, bench: "Bench", given: list[object], frame: int, z: float) -> None:
        assert self.send(bench, frame=frame, z=z) == DENIED
        assert given == []

    def test_what_the_ekf_does_not_use_fails(self, make_bench: "MakeBench") -> None:
        assert self.send(make_bench()) == FAILED

    def test_long_command_is_not_supported(self, bench: "Bench", given: list[object]) -> None:
        assert bench.client.command(POSITION, 0, 0, 7.5, 0, 10.0, 20.0, NAN) == UNSUPPORTED
        assert given == []


@pytest.mark.parametrize(("speed", "direction", "result"), [
    (5, 90, ACCEPTED), (0, 0, ACCEPTED), (0, 360, ACCEPTED), (NAN, NAN, ACCEPTED),
    (-0.1, 90, DENIED), (5, -1, DENIED), (5, 360.5, DENIED),
])  # fmt: skip
def test_wind_has_a_range(bench: "Bench", speed: float, direction: float, result: int) -> None:
    assert bench.client.command(WIND, speed, 0, direction) == result


@pytest.mark.parametrize(("convert", "value", "expected"), [
    (u32_of_float, 1.9, 1), (u32_of_float, -1.0, 0xFFFFFFFF), (u32_of_float, NAN, 0), (u32_of_float, 2.0**32 + 5, 5),
    (u32_of_float, 1e30, 0), (u64_of_float, 1.9, 1), (u64_of_float, -1.0, (1 << 64) - 1),
    (u64_of_float, 2.0**63, 1 << 63), (u64_of_float, NAN, 1 << 63), (u64_of_float, -1e30, 1 << 63),
    (u64_of_float, 1e30, 0), (u64_of_float, math.inf, 0),
])  # fmt: skip
def test_floats_become_integers_as_on_x86_64(convert: Callable[[float], int], value: float, expected: int) -> None:
    assert convert(value) == expected
