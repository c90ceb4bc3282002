# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The main loop runs at its rate, and bytes come at exact times in between."""

from collections.abc import Callable

import pytest

from mav_handlers.channel import Channel
from tests.unit.viso.conftest import Bench
from tests.unit.viso.passes import times_of_passes
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle(VehicleConfig())


def test_loop_runs_400_times_a_second(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    times = times_of_passes(vehicle, monkeypatch)
    Scheduler(vehicle).run_until(1_000_000)
    assert times == list(range(0, 1_000_001, 2500))


def test_time_stands_where_it_was_asked_to(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    times = times_of_passes(vehicle, monkeypatch)
    scheduler = Scheduler(vehicle)
    scheduler.run_until(6_001)
    assert scheduler.now_us == vehicle.clock.micros64() == 6_001
    assert times == [0, 2500, 5000]


def test_no_pass_is_made_twice(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    times = times_of_passes(vehicle, monkeypatch)
    scheduler = Scheduler(vehicle)
    for time_us in (2500, 2500, 4000, 5000):
        scheduler.run_until(time_us)
    assert times == [0, 2500, 5000]


def test_time_does_not_run_backwards(vehicle: Vehicle) -> None:
    scheduler = Scheduler(vehicle)
    scheduler.run_until(5000)
    with pytest.raises(ValueError, match="time 4999 us has passed, it is 5000 us"):
        scheduler.run_until(4999)


def test_time_can_pass_without_the_loop(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    times = times_of_passes(vehicle, monkeypatch)
    scheduler = Scheduler(vehicle)
    scheduler.run_until(6_001)
    scheduler.pass_over(3_600_000_000)
    assert scheduler.now_us == 3_600_000_000
    scheduler.run_until(3_600_005_000)
    assert times == [0, 2500, 5000, 3_600_002_500, 3_600_005_000]
    with pytest.raises(ValueError, match="has passed"):
        scheduler.pass_over(3_600_004_999)


@pytest.mark.parametrize("read_us", [None, 3000])
def test_bytes_come_at_the_present_time(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch, read_us: int | None) -> None:
    scheduler = Scheduler(vehicle)
    channel = vehicle.endpoint.open_channel("client")
    scheduler.run_until(4321)
    got: list[tuple[Channel, bytes, int | None]] = []
    monkeypatch.setattr(vehicle, "receive_bytes", lambda *args: got.append(args))
    scheduler.deliver(channel, b"bytes", read_us=read_us)
    assert got == [(channel, b"bytes", read_us)]
    assert vehicle.clock.micros64() == 4321


def test_passes_at_which_the_filter_alone_runs_are_made_many_at_once(
    make_bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    # tests/property/test_blocks_of_passes.py has all sensors, and much that happens.
    one, other = (make_bench(LOG_DISARMED=1) for _ in range(2))
    advance, counts = one.vehicle.advance, []

    def counted(times_us: range) -> int:
        counts.append(advance(times_us))
        return counts[-1]

    monkeypatch.setattr(one.vehicle, "advance", counted)
    single = other.vehicle.advance
    monkeypatch.setattr(other.vehicle, "advance", lambda times_us: single(times_us[:1]))
    for bench in (one, other):
        bench.scheduler.run_until(bench.scheduler.now_us + 500_000)
    assert sum(counts) > 190
    assert len(counts) < 30
    assert one.records == other.records
    assert one.vehicle.endpoint.bytes_to_send(one.channel) == other.vehicle.endpoint.bytes_to_send(other.channel)
