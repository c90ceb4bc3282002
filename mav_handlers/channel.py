# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The MAVLink state of one link: codec, time correction, intervals, queues and counters."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Final

from ap_core.cint import u32, u64
from ap_core.verdict import Outcome, Verdict
from mav_handlers.jitter_correction import JitterCorrection
from mav_handlers.wire.codec import Codec, full_length
from mav_handlers.wire.messages import PARAM_VALUE, Message

OUTPUT_LIMIT_BYTES: Final = 65536

CountKey = tuple[str, Outcome, str]


@dataclass(slots=True)
class ParamListState:
    """A parameter list being sent: the next index, and the count told to the client."""

    next_index: int
    count: int
    last_run_us: int


@dataclass(slots=True)
class Channel:
    """One link as the endpoint sees it.

    Args:
        index: number of the link, from 0.
        name: what the user calls it.
        codec: parser and packer of this link.
        baud: bits per second for the transport time of a UART; None for links that add no delay.
    """

    index: int
    name: str
    codec: Codec
    baud: int | None = None
    jitter: JitterCorrection = field(default_factory=JitterCorrection)
    active: bool = False
    open: bool = True
    intervals_ms: dict[str, int] = field(default_factory=dict)
    last_sent_us: dict[str, int] = field(default_factory=dict)
    requested: deque[str] = field(default_factory=deque)
    param_reads: deque[PARAM_VALUE] = field(default_factory=deque)
    param_reads_due_us: int = 0
    param_list: ParamListState | None = None
    timesync_sent_us: int = 0
    timesync_ts1: int | None = None
    counters: Counter[CountKey] = field(default_factory=Counter)
    bytes_received: int = 0
    frames_received: int = 0
    packets_dropped: int = 0
    frames_not_sent: int = 0
    frames_forwarded: int = 0
    bytes_sent: int = 0
    _output: bytearray = field(default_factory=bytearray)

    @property
    def streaming(self) -> bool:
        """Tell whether anything but the heartbeat is sent at an interval."""
        return any(name != "HEARTBEAT" for name in self.intervals_ms)

    def count(self, name: str, verdict: Verdict, amount: int = 1) -> None:
        """Count a message, or ``amount`` bytes that are none, under its verdict."""
        self.counters[name, verdict.outcome, verdict.rule.code] += amount

    def has_room(self) -> bool:
        """Tell whether output may be added; a peer that does not read must not cost memory."""
        return len(self._output) < OUTPUT_LIMIT_BYTES

    def send(self, *messages: Message) -> bool:
        """Pack messages for sending, all or none; False, and counted, when the peer does not take its output."""
        if not self.has_room():
            self.frames_not_sent += len(messages)
            return False
        for message in messages:
            self._output += self.codec.encode(message)
        return True

    def forward(self, frame: bytes) -> bool:
        """Send on somebody else's frame as it came; False, and counted, when the peer does not take its output."""
        if not self.has_room():
            self.frames_not_sent += 1
            return False
        self._output += frame
        self.frames_forwarded += 1
        return True

    def take_output(self) -> bytes:
        """Return and forget what is to be sent."""
        data = bytes(self._output)
        self._output.clear()
        self.bytes_sent += len(data)
        return data

    def arrival_us(self, message_type: type[Message], read_us: int) -> int:
        """Return the latest time at which a message can have been sent, in us since boot.

        The link delivered its bytes one after the other at ``baud``; those still unread came after it. The length is
        that of the whole message, whatever number of bytes arrived.

        Args:
            message_type: the message being handled.
            read_us: when the link was last read.

        Source: AP_HAL UARTDriver::receive_time_constraint_us.
        """
        if self.baud is None:
            return read_us
        length = full_length(message_type) + self.codec.overhead_bytes
        per_byte_us = 10_000_000 // self.baud
        return u64(read_us - u32(per_byte_us * (length + self.codec.unread_bytes)))

    def correct_time_ms(self, message_type: type[Message], remote_us: int, read_us: int, now_us: int) -> int:
        """Return the time of a sample in ms since boot, from the sender's stamp.

        Source: GCS_MAVLINK::correct_offboard_timestamp_usec_to_ms.
        """
        local_us = self.arrival_us(message_type, read_us) or now_us
        return u32(self.jitter.correct_offboard_timestamp_usec(remote_us, local_us) // 1000)
