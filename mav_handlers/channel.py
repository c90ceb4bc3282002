# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The MAVLink state of one link: codec, time correction, intervals, queues and counters.

Also the context that a handler gets with a message.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from ap_core.cint import u32, u64
from ap_core.verdict import Verdict, VerdictKind
from mav_handlers.jitter_correction import JitterCorrection
from mav_handlers.schedule import DeferredMessages, IntervalBuckets
from mav_handlers.wire.codec import Codec, Header, full_length
from mav_handlers.wire.messages import Message

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

OUTPUT_LIMIT_BYTES: Final = 65536
TXSPACE_LIMIT_BYTES: Final = 8192
RESERVED_BYTES: Final = 100
RESERVED_US: Final = 2_000_000
MAX_INTERVAL_MS: Final = 60_000
_SLOW_FACTOR: Final = 4

CountKey = tuple[str, VerdictKind, str]


@dataclass(slots=True)
class ParamListState:
    """A parameter list being sent: the next index, and the count reported to the client."""

    next_index: int
    count: int


@dataclass(slots=True)
class ModesRequest:
    """Requested flight modes: one by its index, from 1, or with 0 all from ``next_index`` on."""

    index: int
    next_index: int


class TransmitReserve:
    """Room that all links reserve for 2 s after a parameter did not fit (GCS_MAVLINK::packet_overhead_chan)."""

    def __init__(self) -> None:
        self._start_us: int | None = None

    def start(self, now_us: int) -> None:
        """Start to reserve room."""
        self._start_us = now_us

    def bytes_at(self, now_us: int) -> int:
        """Return the number of reserved bytes."""
        return RESERVED_BYTES if self._start_us is not None and now_us - self._start_us < RESERVED_US else 0


@dataclass(slots=True)
class Rest:
    """Time (us since boot) until which nothing is due on any link; new work ends it early."""

    until_us: int = 0

    def end(self) -> None:
        """Make the next poll check everything."""
        self.until_us = 0


@dataclass(slots=True)
class Channel:
    """The endpoint's state of one link.

    Args:
        index: number of the link, from 0.
        name: the user's name for the link.
        baud: bits per second for the transport time of a UART; None for links that add no delay.
        reserve: room for parameters, shared by all links.
        rest: time until which no poll has anything to do, shared by all links.
        port: number of the link whose parameters apply; a further client of a server uses the first client's.

    Attributes:
        requested: messages to be sent once; ``request`` adds to them.
        card_intervals_ms: default intervals by message, from a file; 0 is off.
        stream_slowdown_ms: how much a radio's full buffer lengthens the intervals.
        ftp_is_busy: whether a file transfer slows down the other messages.
        awaits_items: whether items of missions, requested on any link, do so.
        params_sent_us: time of the last turn that sent parameters.
        times_full: number of messages that did not fit.
        has_reader: whether anybody reads the output; if not, it is discarded and nothing is streamed.
        is_open: False after a further client has left, until another takes its place.
    """

    index: int
    name: str
    codec: Codec
    baud: int | None = None
    jitter: JitterCorrection = field(default_factory=JitterCorrection)
    active: bool = False
    reserve: TransmitReserve = field(default_factory=TransmitReserve)
    rest: Rest = field(default_factory=Rest)
    port: int = -1
    deferred: DeferredMessages = field(default_factory=DeferredMessages)
    buckets: IntervalBuckets = field(init=False)
    requested: set[str] = field(default_factory=set)
    card_intervals_ms: Mapping[str, int] = field(default_factory=dict)
    stream_slowdown_ms: int = 0
    ftp_is_busy: bool = False
    awaits_items: bool = False
    heartbeat_sent_us: int = 0
    param_list: ParamListState | None = None
    params_sent_us: int = 0
    modes_request: ModesRequest | None = None
    timesync_sent_us: int = 0
    timesync_ts1: int | None = None
    counters: Counter[CountKey] = field(default_factory=Counter)
    bytes_received: int = 0
    frames_received: int = 0
    # FIRMWARE PARITY: the firmware never increments its own count.
    packets_dropped: int = 0
    frames_not_sent: int = 0
    times_full: int = 0
    has_reader: bool = True
    is_open: bool = True
    bytes_sent: int = 0
    _output: bytearray = field(default_factory=bytearray)

    def __post_init__(self) -> None:
        """Create the buckets, whose intervals follow the link's slow-down."""
        self.buckets = IntervalBuckets(self.reschedule_interval_ms)
        if self.port < 0:
            self.port = self.index

    def close(self) -> None:
        """Stop sending for good; the counters keep their values."""
        self.is_open = self.has_reader = self.active = False
        self.deferred, self.buckets = DeferredMessages(), IntervalBuckets(self.reschedule_interval_ms)
        self.requested.clear()
        self.param_list = self.modes_request = None
        self._output.clear()

    def request(self, name: str) -> None:
        """Request that a message is sent once."""
        self.requested.add(name)
        self.rest.end()

    def wait_ms(self, now_ms: int) -> int:
        """Return the time until the next message is due, 0 while one waits or is due."""
        if self.requested:
            return 0
        wait_ms = self.deferred.wait_ms(now_ms)
        return min(wait_ms, self.buckets.wait_ms(now_ms)) if self.has_reader else wait_ms

    @property
    def streaming(self) -> bool:
        """Return whether anything but the heartbeat is sent at an interval."""
        return not self.buckets.is_empty

    @property
    def intervals_ms(self) -> Mapping[str, int]:
        """The interval of each message that has one, before any slow-down (GCS_MAVLINK::get_ap_message_interval)."""
        return self.deferred.intervals_ms() | self.buckets.intervals_ms()

    def reschedule_interval_ms(self, interval_ms: int) -> int:
        """Return the effective interval of a bucket (GCS_MAVLINK::get_reschedule_interval_ms)."""
        interval_ms += self.stream_slowdown_ms
        if self.param_list is not None:
            interval_ms *= _SLOW_FACTOR
        if self.awaits_items:
            interval_ms *= _SLOW_FACTOR
        if self.ftp_is_busy:
            interval_ms *= _SLOW_FACTOR
        return min(interval_ms, MAX_INTERVAL_MS)

    def count(self, name: str, verdict: Verdict, amount: int = 1) -> None:
        """Count a message, or ``amount`` bytes that are no message, under its verdict."""
        self.counters[name, verdict.kind, verdict.rule.code] += amount

    def has_room(self) -> bool:
        """Return whether output may be added; the limit bounds the memory for a peer that does not read."""
        return len(self._output) < OUTPUT_LIMIT_BYTES

    def txspace(self) -> int:
        """Return the free transmit space in bytes, at most 8192 (GCS_MAVLINK::txspace)."""
        return max(0, min(OUTPUT_LIMIT_BYTES - len(self._output), TXSPACE_LIMIT_BYTES))

    def overhead_bytes(self, now_us: int) -> int:
        """Return a frame's bytes beside its payload, plus the room reserved for parameters (packet_overhead_chan)."""
        return self.codec.overhead_bytes + self.reserve.bytes_at(now_us)

    def has_space_for(self, message_type: type[Message], now_us: int | None = None) -> bool:
        """Return whether a message fits; count it if not (GCS_MAVLINK::check_payload_size).

        Args:
            message_type: type of the message to send.
            now_us: time since boot; None allows use of the room reserved for parameters.
        """
        overhead = self.codec.overhead_bytes if now_us is None else self.overhead_bytes(now_us)
        fits = self.txspace() >= overhead + full_length(message_type)
        self.times_full += not fits
        return fits

    def send(self, *messages: Message) -> bool:
        """Pack messages for sending, all or none; count them and return False if the output is full.

        A link of MAVLink 1 sends none whose id needs more than a byte, without a word (mavlink_helpers.h,
        _mav_finalize_message_chan_send).
        """
        if not self.has_room():
            self.frames_not_sent += len(messages)
            return False
        if self.has_reader:
            for message in messages:
                if self.codec.can_send(type(message)):
                    self._output += self.codec.encode(message)
        return True

    def forward(self, frame: bytes) -> bool:
        """Forward a frame unchanged; count it and return False if the output is full."""
        if not self.has_room():
            self.frames_not_sent += 1
            return False
        self._output += frame
        return True

    def take_output(self) -> bytes:
        """Return the output and clear it."""
        if not self._output:
            return b""
        data = bytes(self._output)
        self._output.clear()
        self.bytes_sent += len(data)
        return data

    def arrival_us(self, message_type: type[Message], read_us: int, now_us: int) -> int:
        """Return the latest possible time of sending of a message, in us since boot.

        The link delivered its bytes at ``baud``; bytes still unread came after the message. The length used is that of
        the full message, even if it arrived trimmed.

        Args:
            message_type: the message being handled.
            read_us: when the link was last read.
            now_us: time of handling; the room reserved for parameters counts as received bytes.

        Source: AP_HAL UARTDriver::receive_time_constraint_us.
        """
        if self.baud is None:
            return read_us
        length = full_length(message_type) + self.overhead_bytes(now_us)
        per_byte_us = 10_000_000 // self.baud
        return u64(read_us - u32(per_byte_us * (length + self.codec.unread_bytes)))

    def correct_time_ms(self, message_type: type[Message], remote_us: int, read_us: int, now_us: int) -> int:
        """Return the time of a sample in ms since boot, from the sender's stamp.

        Source: GCS_MAVLINK::correct_offboard_timestamp_usec_to_ms.
        """
        arrival_us = read_us if self.baud is None else self.arrival_us(message_type, read_us, now_us)
        return u32(self.jitter.correct_offboard_timestamp_usec(remote_us, arrival_us or now_us) // 1000)


@dataclass(frozen=True, slots=True)
class Context:
    """What a handler gets with its message.

    Attributes:
        vehicle: the receiving vehicle, with its endpoint.
        channel: the link that brought it.
        header: of its frame.
        now_us: time of handling, us since boot.
        read_us: when the link was last read, us since boot.
    """

    vehicle: Vehicle
    channel: Channel
    header: Header
    now_us: int
    read_us: int

    def correct_time_ms(self, message_type: type[Message], remote_us: int) -> int:
        """Return the time of a sample in ms since boot, from the sender's stamp in us."""
        return self.channel.correct_time_ms(message_type, remote_us, self.read_us, self.now_us)
