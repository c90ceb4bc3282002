# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""RANGEFINDER, DISTANCE_SENSOR and OPTICAL_FLOW as the vehicle sends them."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.senders.ground import distance_sensor, optical_flow, rangefinder
from mav_handlers.wire.messages import DISTANCE_SENSOR, OPTICAL_FLOW, RANGEFINDER

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

DOWN, UP = 25, 24


def hear(bench: "Bench", cm: int, orientation: int = DOWN, *, quality: int = 0) -> None:
    bench.client.tell(DISTANCE_SENSOR(9, 50, 1500, cm, 1, 9, orientation, 9, signal_quality=quality))
    bench.run_ms(50)


def test_without_sensors_nothing_is_told(bench: "Bench") -> None:
    for builder in (rangefinder, distance_sensor, optical_flow):
        assert builder(bench.vehicle, bench.client.channel, 0) is None


def test_range_finder_that_looks_down_is_told_with_and_without_data(make_bench: "MakeBench") -> None:
    bench = make_bench(RNGFND1_TYPE=10)
    assert rangefinder(bench.vehicle, bench.client.channel, 0) == RANGEFINDER(0.0, 0.0)
    hear(bench, 250)
    assert rangefinder(bench.vehicle, bench.client.channel, 0) == RANGEFINDER(2.5, 0.0)


@pytest.mark.parametrize(("heard", "told"), [(0, 0), (1, 1), (2, 2), (100, 100), (101, 1)])
def test_distance_is_told_with_the_limits_that_count(make_bench: "MakeBench", heard: int, told: int) -> None:
    bench = make_bench(RNGFND1_TYPE=10)
    hear(bench, 250, quality=heard)
    assert distance_sensor(bench.vehicle, bench.client.channel, 5_000_999) == DISTANCE_SENSOR(
        5000, 50, 700, 250, 1, 0, DOWN, 0, signal_quality=told
    )


def test_silent_range_finder_tells_no_distance(make_bench: "MakeBench") -> None:
    bench = make_bench(RNGFND1_TYPE=10)
    hear(bench, 250)
    bench.run_ms(600)
    assert distance_sensor(bench.vehicle, bench.client.channel, 0) is None


def test_every_range_finder_has_a_message_of_its_own(make_bench: "MakeBench") -> None:
    bench = make_bench(RNGFND1_TYPE=10, RNGFND2_TYPE=10, RNGFND2_ORIENT=UP)
    hear(bench, 250)
    hear(bench, 400, UP)
    bench.client.read()
    bench.vehicle.endpoint.request_message(bench.client.channel, "DISTANCE_SENSOR")
    bench.run_ms(5)
    told = bench.client.read_of(DISTANCE_SENSOR)
    assert [(message.id, message.orientation, message.current_distance) for message in told] == [
        (0, DOWN, 250),
        (1, UP, 400),
    ]


def test_flow_is_told_while_it_comes_in(make_bench: "MakeBench") -> None:
    bench = make_bench(FLOW_TYPE=5)
    for _ in range(2):
        bench.client.tell(OPTICAL_FLOW(0, 7, 12, -25, 0.0, 0.0, 180, 0.0))
        bench.run_ms(100)
    told = optical_flow(bench.vehicle, bench.client.channel, 5_000_999)
    assert told is not None
    assert (told.time_usec, told.sensor_id, told.quality, told.ground_distance) == (5000, 0, 180, 0.0)
    assert (told.flow_x, told.flow_y) == (1, -2)
    assert (told.flow_rate_x, told.flow_rate_y) == pytest.approx((1.2, -2.5))
    assert (told.flow_comp_m_x, told.flow_comp_m_y) == pytest.approx((1.2, -2.5), abs=1e-3)
    bench.run_ms(500)
    assert optical_flow(bench.vehicle, bench.client.channel, 0) is None
