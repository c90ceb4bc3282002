# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the way: what gets lost, late, out of order, twice, damaged, or comes from somebody else."""

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

from viso.faults.fault import Fault, Moment, parameter
from viso.faults.packet import Key, Packet, PassedOver, decode, pack
from viso.faults.stamps import shifted

LONGEST_DELAY_MS = 60_000.0
UNTOUCHED_BYTES = 3
"""Marker, length and flags: a frame with flipped bits is still as long as it says."""


def _held_back(packet: Packet, delay_ms: float) -> Packet:
    return replace(packet, delay_us=packet.delay_us + round(delay_ms * 1e3))


@dataclass(slots=True)
class Fail(Fault):
    """No message of external navigation arrives."""

    sitl: ClassVar[str] = "SIM_VICON_FAIL"

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        return ()


@dataclass(slots=True)
class Blackout(Fail):
    """Nothing at all arrives, bytes that are no frame included."""

    sitl: ClassVar[str] = ""
    every_message: ClassVar[bool] = True


@dataclass(slots=True)
class Loss(Fault):
    """A message is lost, alone or with those that follow.

    Attributes:
        burst_messages: how many are lost in a row.
    """

    burst_messages: int = parameter(1, 1, 1_000_000)
    _left: int = field(default=0, init=False, repr=False)

    @property
    def goes_on(self) -> bool:
        """Return whether the row is not at its end."""
        return self._left > 0

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        self._left = (self._left or self.burst_messages) - 1
        return ()


@dataclass(slots=True)
class Rate(Fault):
    """The rate of each kind of message from each sender is limited; messages above it are lost.

    Attributes:
        rate_hz: largest rate.
    """

    sitl: ClassVar[str] = "SIM_VICON_RATE"
    lasts: ClassVar[bool] = True
    rate_hz: float = parameter(10.0, 0.001, 10_000.0)
    _next_us: dict[Key, float] = field(default_factory=dict, init=False, repr=False)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        now_us, period_us = moment.since_us, 1e6 / self.rate_hz
        next_us = self._next_us.get(packet.key, now_us)
        if now_us < round(next_us):
            return ()
        # On the grid, as far as that is still ahead: 30 Hz become 20, not 15.
        self._next_us[packet.key] = max(next_us + period_us, now_us)
        return (packet,)


@dataclass(slots=True)
class Delay(Fault):
    """A message comes late; later ones of its kind wait for it.

    Attributes:
        delay_ms: how late.
    """

    delay_ms: float = parameter(100.0, 0.0, LONGEST_DELAY_MS)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        return (_held_back(packet, self.delay_ms),)


@dataclass(slots=True)
class Jitter(Fault):
    """Each message comes late by a random time (uniform); later ones of its kind wait for it.

    Attributes:
        jitter_ms: the longest time.
    """

    jitter_ms: float = parameter(50.0, 0.0, LONGEST_DELAY_MS)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        return (_held_back(packet, moment.random.uniform(0.0, self.jitter_ms)),)


@dataclass(slots=True)
class Bunch(Fault):
    """Messages are held back and arrive in bunches.

    Attributes:
        period_ms: from bunch to bunch.
    """

    period_ms: float = parameter(200.0, 0.1, LONGEST_DELAY_MS)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        period_us = self.period_ms * 1e3
        there_us = moment.since_us + packet.delay_us
        return (_held_back(packet, (math.ceil(there_us / period_us) * period_us - there_us) * 1e-3),)


@dataclass(slots=True)
class Reorder(Fault):
    """A message comes late, and later ones overtake it.

    Attributes:
        delay_ms: how late.
    """

    delay_ms: float = parameter(100.0, 0.0, LONGEST_DELAY_MS)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        return (replace(_held_back(packet, self.delay_ms), may_overtake=True),)


@dataclass(slots=True)
class Duplicate(Fault):
    """A message arrives again, with the same bytes.

    Attributes:
        copies: how often again.
        delay_ms: from one to the next.
    """

    copies: int = parameter(1, 1, 100)
    delay_ms: float = parameter(0.0, 0.0, LONGEST_DELAY_MS)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        """Add the copies; nothing behind waits for them."""
        again = (_held_back(packet, number * self.delay_ms) for number in range(1, self.copies + 1))
        return packet, *(replace(copy, may_overtake=True) for copy in again)


@dataclass(slots=True)
class Corrupt(Fault):
    """Bits of a frame flip, anywhere behind its marker, length and flags, so that its checksum is wrong.

    Attributes:
        bits: how many, each another one.
    """

    bits: int = parameter(1, 1, 64)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        frame = bytearray(packet.frame)
        places = range(UNTOUCHED_BYTES * 8, len(frame) * 8)
        if len(places) < self.bits:
            raise PassedOver("too short")
        for place in moment.random.sample(places, self.bits):
            frame[place // 8] ^= 1 << place % 8
        return (replace(packet, frame=bytes(frame), message=None),)


@dataclass(slots=True)
class Mavlink1(Fault):
    """A message comes as MAVLink 1, without its extension fields; ODOMETRY cannot."""

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        return (packet if packet.version == 1 else pack(replace(decode(packet), version=1)),)


@dataclass(slots=True)
class SenderId(Fault):
    """A message comes from another sender.

    Attributes:
        system_id: of that sender.
        component_id: of that sender.
    """

    system_id: int = parameter(2, 1, 255)
    component_id: int = parameter(197, 1, 255)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        changed = replace(decode(packet), system_id=self.system_id, component_id=self.component_id)
        return (pack(changed),)


@dataclass(slots=True)
class SecondSender(Fault):
    """A second sender sends the same data, with sequence numbers and a clock of its own.

    Attributes:
        system_id: of that sender.
        component_id: of that sender.
        delay_ms: how long after the first.
        clock_offset_s: how far its clock is ahead of the first sender's.
    """

    lasts: ClassVar[bool] = True
    system_id: int = parameter(1, 1, 255)
    component_id: int = parameter(198, 1, 255)
    delay_ms: float = parameter(5.0, 0.0, LONGEST_DELAY_MS)
    clock_offset_s: float = parameter(0.0, -1e9, 1e9)
    _sent: int = field(default=0, init=False, repr=False)

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        heard = decode(packet)
        message = shifted(heard.message, self.clock_offset_s * 1e6) or heard.message
        other = replace(
            _held_back(heard, self.delay_ms),
            message=message,
            system_id=self.system_id,
            component_id=self.component_id,
            sequence=self._sent % 256,
        )
        second = pack(other)
        self._sent += 1
        return packet, second
