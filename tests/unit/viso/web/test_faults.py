# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults that are switched while messages come in."""

import math
from typing import Any

import pytest

from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY, Message
from tests.unit.viso.conftest import odometry
from viso.web.faults import SWITCHES, FaultSwitches, FaultyLink

ALIVE = HEARTBEAT(6, 8, 0, 0, 4, 3)


class Rig:
    """A link with switches, its other end, and a clock that is set."""

    def __init__(self) -> None:
        self.now_us = 0
        ours, self.client = make_pair()
        self.inner: PairLink = ours
        self.link = FaultyLink(ours, lambda: self.now_us)
        self.switches = FaultSwitches([self.link])
        self._sender = Codec(1, 197)
        self._reader = Codec(1, 1)

    def send(self, *messages: Message) -> bytes:
        """Send messages, and return their bytes."""
        data = b"".join(map(self._sender.encode, messages))
        self.client.send(data)
        return data

    def received(self) -> list[Any]:
        """Return the messages that have come through."""
        while data := self.link.receive():
            self._reader.feed(data)
        found = []
        while (received := self._reader.next_received()) is not None:
            assert isinstance(received, Received)
            found.append(received.message)
        return found


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_without_a_fault_every_byte_comes_as_it_was_sent(rig: Rig) -> None:
    rig.client.send(b"not a frame \xfd\x01")
    assert rig.link.receive(5) == b"not a"
    assert rig.link.receive() == b" frame \xfd\x01"


def test_link_with_a_fault_reads_no_more_than_it_is_asked_for(rig: Rig) -> None:
    sent = rig.send(*[ALIVE] * 50)
    rig.switches.set("loss", on=True)
    assert rig.link.receive(300) == sent[:294]  # the rest of the last frame is still to come
    assert rig.inner.stats.bytes_in == 300


@pytest.mark.parametrize("switch", SWITCHES, ids=lambda switch: str(switch.name))
def test_every_switch_changes_vision_and_nothing_else(rig: Rig, switch: Any) -> None:
    sent: list[Message] = [odometry(1_000_000 + 1000 * number, x=float(number)) for number in range(20)]
    rig.switches.set(switch.name, on=True)
    assert rig.switches.on == (switch.name,)
    rig.send(*sent, ALIVE)
    received = rig.received()
    assert received[-1] == ALIVE
    assert received[:-1] != sent


def test_switched_off_everything_is_as_before(rig: Rig) -> None:
    for on in (True, False):
        for switch in SWITCHES:
            rig.switches.set(switch.name, on=on)
    data = rig.send(odometry(5), ALIVE)
    assert rig.link.receive() == data
    assert rig.switches.on == ()


def test_faults_add_up(rig: Rig) -> None:
    rig.switches.set("frames", on=True)
    rig.switches.set("nan", on=True)
    rig.send(odometry(1))
    (message,) = rig.received()
    assert (message.frame_id, message.child_frame_id) == (1, 8)
    assert math.isnan(message.x)


def test_one_fault_remembers_while_others_are_switched(rig: Rig) -> None:
    rig.switches.set("frozen", on=True)
    rig.send(odometry(1, x=1.0))
    rig.switches.set("frames", on=True)
    rig.send(odometry(2, x=2.0))
    assert [(message.time_usec, message.x) for message in rig.received()] == [(1, 1.0), (2, 1.0)]


def test_late_messages_come_when_they_are_due_and_at_once_when_switched_off(rig: Rig) -> None:
    rig.switches.set("late", on=True)
    rig.send(odometry(1))
    assert rig.received() == []
    rig.now_us = 149_999
    assert rig.received() == []
    rig.now_us = 150_000
    assert [message.time_usec for message in rig.received()] == [1]
    rig.send(odometry(2))
    assert rig.received() == []
    rig.switches.set("late", on=False)
    assert [message.time_usec for message in rig.received()] == [2]


def test_what_is_held_back_still_meets_the_faults_behind(rig: Rig) -> None:
    rig.switches.set("late", on=True)
    rig.switches.set("frames", on=True)
    rig.send(odometry(1))
    rig.received()
    rig.switches.set("late", on=False)
    assert [message.frame_id for message in rig.received()] == [1]


def test_frame_that_was_cut_by_the_switching_arrives_whole(rig: Rig) -> None:
    data = Codec(1, 197).encode(odometry(9))
    rig.client.send(data[:40])
    first = rig.link.receive()
    rig.switches.set("late", on=True)
    rig.client.send(data[40:])
    rig.send(odometry(10))
    first += rig.link.receive()
    rig.switches.set("late", on=False)
    codec = Codec(1, 1)
    codec.feed(first + rig.link.receive())
    stamps = []
    while (received := codec.next_received()) is not None:
        assert isinstance(received, Received)
        assert isinstance(received.message, ODOMETRY)
        stamps.append(received.message.time_usec)
    assert stamps == [9, 10]


def test_no_more_is_given_than_was_asked_for(rig: Rig) -> None:
    rig.switches.set("frames", on=True)
    rig.send(odometry(1), odometry(2))
    pieces = []
    while piece := rig.link.receive(10):
        assert len(piece) <= 10
        pieces.append(piece)
    codec = Codec(1, 1)
    codec.feed(b"".join(pieces))
    assert codec.next_received() is not None
    assert codec.next_received() is not None


def test_everything_else_is_the_links_own(rig: Rig) -> None:
    rig.link.send(b"out")
    assert rig.client.receive() == b"out"
    assert rig.link.stats == rig.inner.stats
    assert (rig.link.fileno(), rig.link.name, rig.link.baud) == (-1, rig.inner.name, None)
    rig.link.close()
    assert rig.client.stats.disconnects == 1


def test_unknown_fault_is_none(rig: Rig) -> None:
    assert not rig.switches.set("gremlins", on=True)
    assert rig.switches.on == ()


@pytest.mark.parametrize("on_before", [True, False])
def test_further_client_of_a_server_has_the_same_faults(
    rig: Rig, on_before: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, client = make_pair()
    monkeypatch.setattr(rig.inner, "admit", lambda: ours)
    if on_before:
        rig.switches.set("silence", on=True)
    other = rig.link.admit()
    assert other is not None
    rig.switches.set("silence", on=True)
    frames = [Codec(1, 197).encode(message) for message in (odometry(1), ALIVE)]
    client.send(b"".join(frames))
    assert other.receive() == frames[1]
    rig.switches.set("silence", on=False)
    client.send(frames[0])
    assert other.receive() == frames[0]
