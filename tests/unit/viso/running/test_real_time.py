# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pacer follows a clock: here one that moves only when the pacer waits, so nothing sleeps."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pytest

from mav_handlers.endpoint import MessageEvent
from mav_handlers.links.base import Link
from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, PARAM_SET, PARAM_VALUE, Message
from viso.parameters.store import MemoryParamStore
from viso.running import exchange
from viso.running import real_time as realtime
from viso.running.power import Port, PoweredVehicle
from viso.running.real_time import Pacer
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig


class WallClock:
    """A wall clock in seconds; ``waits`` lists how long the pacer waited, ``early_s`` lets it wake up early."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.waits: list[float] = []
        self.early_s = 0.0
        self.on_wait: Callable[[], None] = lambda: None

    def __call__(self) -> float:
        return self.now_s

    def wait(self, links: Iterable[Link], timeout_s: float) -> list[Link]:
        self.waits.append(timeout_s)
        self.now_s += max(timeout_s - self.early_s, 1e-6)
        self.on_wait()
        return []


class Rig:
    """A vehicle with two links in step with a wall clock; ``loops`` holds the time of every pass."""

    def __init__(self, clock: WallClock, monkeypatch: pytest.MonkeyPatch, speedup: float, **config: Any) -> None:
        self.clock = clock
        self.loops: list[int] = []
        advance = Vehicle.advance

        def noted(vehicle: Vehicle, times_us: range) -> int:
            count = advance(vehicle, times_us)
            self.loops += times_us[:count]
            return count

        monkeypatch.setattr(Vehicle, "advance", noted)
        ends = [make_pair((f"vehicle{number}", f"client{number}")) for number in (1, 2)]
        self.clients = [client for _, client in ends]
        links = [end for end, _ in ends]
        self.powered = PoweredVehicle(VehicleConfig(links=2, **config), [Port(link.name) for link in links])
        self.pacer = Pacer(self.powered, links, speedup=speedup, now_s=clock)

    @property
    def vehicle(self) -> Vehicle:
        return self.powered.vehicle

    def run_to(self, time_us: int) -> None:
        self.pacer.run(lambda: False, until_us=time_us)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> WallClock:
    clock = WallClock()
    monkeypatch.setattr(realtime, "wait_readable", clock.wait)
    return clock


@pytest.fixture
def make(clock: WallClock, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Rig]:
    return lambda speedup=1.0, **config: Rig(clock, monkeypatch, speedup, **config)


def messages(client: PairLink) -> list[Message]:
    codec = Codec(255, 190)
    codec.feed(client.receive())
    found = []
    while (received := codec.next_received()) is not None:
        if isinstance(received, Received) and received.message is not None:
            found.append(received.message)
    return found


def test_loop_runs_400_times_a_second(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run_to(1_000_000)
    assert 399 <= len(rig.loops) <= 401
    assert rig.loops == pytest.approx(range(0, len(rig.loops) * 2500, 2500), abs=2)


def test_pacer_waits_between_passes(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run_to(10_000)
    assert sum(rig.clock.waits) == pytest.approx(0.01, abs=1e-5)


def test_speedup_makes_the_vehicle_faster(make: Callable[..., Rig]) -> None:
    rig = make(10.0)
    rig.run_to(1_000_000)
    assert rig.clock.now_s == pytest.approx(1000.1, abs=1e-3)
    assert 390 <= len(rig.loops) <= 401


def test_late_pass_is_not_made_up_for(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run_to(5000)
    rig.clock.now_s += 1.0
    rig.loops.clear()
    rig.pacer.step()
    rig.pacer.step()
    assert rig.loops[0] == pytest.approx(1_005_000, abs=2600)
    assert len(rig.loops) == 2
    rig.pacer.step()
    assert rig.loops[2] - rig.loops[0] >= 2500


def test_passes_keep_their_rate_when_a_few_come_late(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.clock.on_wait = lambda: setattr(rig.clock, "now_s", rig.clock.now_s + 0.0005)
    rig.run_to(1_000_000)
    assert 398 <= len(rig.loops) <= 401


def test_waking_up_for_bytes_makes_no_pass(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run_to(2500)
    before = len(rig.loops)
    rig.clock.early_s = 0.002
    rig.pacer.step()
    assert len(rig.loops) == before


def test_bytes_are_handled_when_they_come(make: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make()
    rig.run_to(2500)
    times: list[int] = []
    rig.vehicle.endpoint.on_event = lambda event: times.append(event.now_us)
    rig.clock.early_s = 0.001
    rig.clients[0].send(Codec(255, 190).encode(HEARTBEAT(6, 8, 0, 0, 4, 3)))
    rig.pacer.step()
    assert len(times) == 1
    assert times[0] == pytest.approx(4000, abs=5)


def test_each_link_feeds_its_channel(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.clients[1].send(Codec(255, 190).encode(HEARTBEAT(6, 8, 0, 0, 4, 3)))
    rig.pacer.step()
    assert [channel.frames_received for channel in rig.vehicle.endpoint.channels] == [0, 1]


def test_links_hand_in_by_turns_until_the_main_loop_is_due(make: Callable[..., Rig]) -> None:
    rig = make()
    frame = Codec(255, 190).encode(HEARTBEAT(6, 8, 0, 0, 4, 3))
    fits = exchange.READ_BYTES // len(frame)
    rounds = 3
    heard: list[int] = []

    def take_time(event: MessageEvent) -> None:
        heard.append(event.channel)
        rig.clock.now_s += exchange.READ_BUDGET_S / fits / rounds

    rig.vehicle.endpoint.on_event = take_time
    for client, count in zip(rig.clients, (10 * rounds * fits, 1), strict=True):
        client.send(frame * count)
    rig.pacer.step()
    assert heard.index(1) == fits
    assert rounds * fits <= len(heard) <= (rounds + 1) * fits


def test_peer_that_never_stops_does_not_keep_the_main_loop_from_its_turn(
    make: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make()
    monkeypatch.setattr(PairLink, "receive", lambda _link, _max_bytes=1: b"\xfd")
    rig.run_to(50_000)
    assert len(rig.loops) == 21


def test_output_goes_to_every_link(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run_to(2_100_000)
    beats = [[message for message in messages(client) if isinstance(message, HEARTBEAT)] for client in rig.clients]
    assert [len(found) for found in beats] == [3, 3]


class StoreOnWatch(MemoryParamStore):
    """Parameters in memory that note how often they are saved, and call back before it."""

    def __init__(self) -> None:
        super().__init__()
        self.saves = 0
        self.before_save: Callable[[], None] = lambda: None

    def save_if_changed(self, values: Mapping[str, float], *, synced: bool = True) -> bool:
        self.saves += 1
        self.before_save()
        return super().save_if_changed(values, synced=synced)


def confirmed(client: PairLink) -> list[tuple[str, float]]:
    values = (message for message in messages(client) if isinstance(message, PARAM_VALUE))
    return [(value.param_id, value.param_value) for value in values]


def test_parameter_is_stored_before_it_is_confirmed(make: Callable[..., Rig]) -> None:
    store = StoreOnWatch()
    rig = make(param_store=store)
    codec, client = Codec(255, 190), rig.clients[0]
    client.send(codec.encode(HEARTBEAT(6, 8, 0, 0, 4, 3)))
    rig.run_to(10_000)
    before = store.saves
    store.before_save = lambda: seen.extend(confirmed(client))
    seen: list[tuple[str, float]] = []
    client.send(codec.encode(PARAM_SET(1, 1, "VISO_DELAY_MS", 30.0, 4)))
    rig.pacer.step()
    assert (store.saves, seen) == (before + 1, [])
    assert confirmed(client) == [("VISO_DELAY_MS", 30.0)]


def test_run_stops_when_told_to(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.pacer.run(lambda: len(rig.loops) == 3)
    assert len(rig.loops) == 3


def test_run_ends_at_its_time(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run_to(100_000)
    assert rig.vehicle.clock.micros64() == pytest.approx(100_000, abs=2600)


def test_restarted_vehicle_counts_its_time_from_zero_and_keeps_its_links(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.run_to(1_000_000)
    before = rig.vehicle
    before.reboot_requested = True
    rig.run_to(4_000_000)
    assert rig.vehicle is not before
    assert rig.vehicle.clock.micros64() == pytest.approx(3_000_000, abs=5200)
    rig.clients[0].receive()
    rig.run_to(5_100_000)
    assert [beat for beat in messages(rig.clients[0]) if isinstance(beat, HEARTBEAT)]


def test_further_client_is_served_beside_the_first_also_after_a_restart(
    make: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make()
    end, client = make_pair(("vehicle1#2", "client3"))
    waiting: list[Link | None] = [end]
    server = rig.pacer._exchange.links[0]
    monkeypatch.setattr(server, "admit", lambda: waiting.pop() if waiting else None)
    frame = Codec(255, 190).encode(HEARTBEAT(6, 8, 0, 0, 4, 3))
    client.send(frame)
    rig.run_to(10_000)
    assert [channel.frames_received for channel in rig.powered.channels] == [0, 0, 1]
    rig.vehicle.reboot_requested = True
    rig.run_to(1_500_000)
    client.send(frame)
    rig.run_to(1_510_000)
    assert [(channel.port, channel.frames_received) for channel in rig.powered.channels] == [(0, 0), (1, 0), (0, 1)]
    client.close()
    rig.run_to(1_520_000)
    assert [channel.name for channel in rig.powered.channels] == ["vehicle1", "vehicle2"]


def records_of(vehicle: Vehicle) -> list[tuple[str, str]]:
    """Return a list to which the records of a vehicle are appended."""
    records: list[tuple[str, str]] = []
    vehicle.logger.on_write = lambda structure, values: records.append((structure.name, str(values)))
    return records


def test_pacer_sleeps_over_passes_of_which_nothing_comes(make: Callable[..., Rig]) -> None:
    rig = make(defaults={"LOG_DISARMED": 1.0})
    records = records_of(rig.vehicle)
    rig.run_to(6_000_000)
    rig.clock.waits.clear()
    rig.run_to(6_200_000)
    assert len(rig.clock.waits) < 20
    other = Vehicle(VehicleConfig(links=2, defaults={"LOG_DISARMED": 1.0}))
    for client in rig.clients:
        other.endpoint.open_channel(client.name)
    expected = records_of(other)
    Scheduler(other).run_until(6_150_000)
    assert records[: len(expected)] == expected


class Beside:
    """Who exchanges with the vehicle every 7 ms; ``times_us`` holds when he did."""

    readers = ()

    def __init__(self) -> None:
        self.times_us: list[int] = []

    def due_us(self) -> int:
        return 7_000 * (len(self.times_us) + 1)

    def exchange(self, vehicle: Vehicle) -> None:
        if vehicle.clock.micros64() >= self.due_us():
            self.times_us.append(vehicle.clock.micros64())


def test_pacer_gets_up_for_who_is_beside_the_links(clock: WallClock) -> None:
    beside: Any = Beside()
    pacer = Pacer(PoweredVehicle(VehicleConfig(), [Port("link")]), [make_pair()[0]], beside=[beside], now_s=clock)
    pacer.run(lambda: False, until_us=100_000)
    assert beside.times_us == pytest.approx([7_000 * number for number in range(1, 15)], abs=2)
