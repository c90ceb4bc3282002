# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated time: no pass is lost however slow the computer is, and the clock keeps to its speed if it can."""

from collections.abc import Iterable

import pytest

from mav_handlers.links.base import Link
from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_LONG, TIMESYNC, Message
from viso.running import lockstep as module
from viso.running.lockstep import Lockstep
from viso.running.power import Port, PoweredVehicle
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

REBOOT = COMMAND_LONG(1, 1, 246, 0, 1, 0, 0, 0, 0, 0, 0)


class Rig:
    """A vehicle in lockstep with a clock that moves when it waits, and by ``cost_s`` in each call that runs passes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, speed: float = 1.0, cost_s: float = 0.0) -> None:
        self.now_s = 100.0
        self.speed = speed
        self.passes_us: list[int] = []
        advance = Vehicle.advance

        def noted(vehicle: Vehicle, times_us: range) -> int:
            count = advance(vehicle, times_us)
            self.passes_us += times_us[:count]
            self.now_s += cost_s
            return count

        def wait(_links: Iterable[Link], timeout_s: float) -> list[Link]:
            self.now_s += timeout_s
            return []

        monkeypatch.setattr(Vehicle, "advance", noted)
        monkeypatch.setattr(module, "wait_readable", wait)
        self.link, self.client = make_pair(("vehicle", "client"))
        self.powered = PoweredVehicle(VehicleConfig(), [Port("vehicle")])
        self.lockstep = Lockstep(self.powered, [self.link], None, lambda: self.speed, now_s=lambda: self.now_s)
        self._codec = Codec(255, 190)

    def run(self, wall_s: float) -> float:
        """Run for some seconds of the wall clock; return how many of the vehicle passed."""
        end_s, start_us = self.now_s + wall_s, self.vehicle_us
        self.lockstep.run(lambda: self.now_s >= end_s)
        return (self.vehicle_us - start_us) / 1e6

    @property
    def vehicle_us(self) -> int:
        return self.passes_us[-1] if self.passes_us else 0

    def send(self, message: Message) -> None:
        self.client.send(self._codec.encode(message))

    def received(self) -> list[Message]:
        self._codec.feed(self.client.receive())
        found = []
        while (received := self._codec.next_received()) is not None:
            if isinstance(received, Received) and received.message is not None:
                found.append(received.message)
        return found


@pytest.mark.parametrize("speed", [0.5, 1.0, 10.0, 100.0])
def test_time_passes_at_the_speed_that_is_asked_for(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    assert Rig(monkeypatch, speed).run(0.5) == pytest.approx(0.5 * speed, abs=0.06 * max(1.0, speed / 10))


def test_no_pass_is_lost_when_the_computer_is_too_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, speed=50.0, cost_s=0.02)
    assert 0 < rig.run(2.0) < 50.0
    assert rig.passes_us == list(range(0, rig.vehicle_us + 1, LOOP_PERIOD_US))


def test_what_was_lost_is_not_caught_up_with(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch)
    slept: list[float] = []

    def stop() -> bool:
        if not slept and rig.vehicle_us > 200_000:
            slept.append(rig.now_s)
            rig.now_s += 60.0  # the computer slept
        return rig.now_s > 160.7

    rig.lockstep.run(stop)
    assert rig.vehicle_us / 1e6 == pytest.approx(0.7 + module.MOST_BEHIND_S, abs=0.06)


def test_speed_changes_at_run_time(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch)
    rig.run(0.5)
    rig.speed = 20.0
    assert rig.run(0.5) == pytest.approx(10.0, abs=0.2)


def test_request_of_a_restart_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch)
    rig.send(REBOOT)
    assert rig.lockstep.run(lambda: rig.now_s > 110.0)
    assert rig.now_s < 105.0


def test_messages_of_the_first_moment_are_answered_with_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    # A client sends as soon as it is let in; an answer of time 0 would look like a request.
    rig = Rig(monkeypatch)
    rig.send(TIMESYNC(0, 1250))
    rig.run(0.1)
    (answer,) = [message for message in rig.received() if isinstance(message, TIMESYNC) and message.ts1 == 1250]
    assert answer.tc1 > 0


def test_vehicle_waits_for_a_client_before_it_boots(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch)
    lone = PairLink("server")
    looks = iter([False, False, True])
    rig.lockstep.wait_for_client(lone, lambda: next(looks))
    assert rig.passes_us == []
    assert rig.now_s > 100.0
