# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A peer that reads nothing for a minute: the other link is served as ever, and what comes afterwards is whole."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.channel import OUTPUT_LIMIT_BYTES
from mav_handlers.links.base import DROP_BACKLOG_FULL
from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import BadData, Codec, Received
from mav_handlers.wire.messages import COMMAND_LONG, HEARTBEAT, TIMESYNC, Message
from viso.running.power import Port, PoweredVehicle
from viso.running.real_time import Pacer
from viso.vehicle.vehicle import VehicleConfig

if TYPE_CHECKING:
    from tests.fault.conftest import MakeBench

pytestmark = pytest.mark.slow

BOOT_US = 5_000_000
SET_MESSAGE_INTERVAL = 511
ATTITUDE_ID = 30
SPEEDUP = 1e6
QUESTIONS = 5_000  # their answers are more than the output of a link
LONGEST_BURST_BYTES = 8 * 280


class TickingClock:
    """A monotonic clock that goes on by 1.25 ms of the vehicle's time whenever somebody looks."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def __call__(self) -> float:
        self._now_s += 1.25e-3 / SPEEDUP
        return self._now_s


class Peer:
    """The other end of a link."""

    def __init__(self, link: PairLink) -> None:
        self._link = link
        self._codec = Codec(255, 190)
        self.bad = 0

    def send(self, message: Message) -> None:
        self._link.send(self._codec.encode(message))

    def read(self) -> list[Message]:
        """Return what has come since the last call, and count stretches that are no frames."""
        while data := self._link.receive():
            self._codec.feed(data)
        found = []
        while (received := self._codec.next_received()) is not None:
            self.bad += isinstance(received, BadData)
            if isinstance(received, Received) and received.message is not None:
                found.append(received.message)
        return found


def attitude_every(period_us: int) -> COMMAND_LONG:
    return COMMAND_LONG(1, 1, SET_MESSAGE_INTERVAL, 0, ATTITUDE_ID, period_us, 0.0, 0.0, 0.0, 0.0, 0.0)


def count_heartbeats(messages: list[Message]) -> int:
    return sum(isinstance(message, HEARTBEAT) for message in messages)


def test_link_that_stalls_for_a_minute_keeps_no_other_waiting() -> None:
    pairs = [make_pair(), make_pair()]
    links = [ours for ours, _ in pairs]
    stalled, other = (Peer(theirs) for _, theirs in pairs)
    powered = PoweredVehicle(VehicleConfig(links=2), [Port(link.name) for link in links])
    pacer = Pacer(powered, links, speedup=SPEEDUP, now_s=TickingClock())
    pacer.run(lambda: False, until_us=BOOT_US)
    stalled.send(attitude_every(5000))
    other.read()

    beats = 0
    for second in range(60):
        pacer.run(lambda: False, until_us=BOOT_US + (second + 1) * 1_000_000)
        beats += count_heartbeats(other.read())
    assert 59 <= beats <= 61
    stats = links[0].stats
    assert stats.drop_reasons[DROP_BACKLOG_FULL] > 1000
    assert stats.bytes_dropped > 100_000
    assert links[1].stats.bytes_dropped == 0

    backlog = stalled.read()
    assert 0 < count_heartbeats(backlog) < 60
    pacer.run(lambda: False, until_us=BOOT_US + 62_000_000)
    assert count_heartbeats(stalled.read()) in (2, 3)
    assert stalled.bad == 0
    powered.close()


def test_output_for_a_link_that_takes_nothing_is_bounded_and_counted(make_bench: "MakeBench") -> None:
    bench = make_bench()
    bench.send(0, *[TIMESYNC(0, -1)] * QUESTIONS)
    bench.run_ms(5_000)
    output = bench.channels[0].take_output()
    assert OUTPUT_LIMIT_BYTES <= len(output) < OUTPUT_LIMIT_BYTES + LONGEST_BURST_BYTES
    assert bench.channels[0].frames_not_sent > QUESTIONS // 4
    bench.check_everything()
