# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Feeds a recorded stream to a vehicle in virtual time."""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from ap_core.log_field import LogValue
from ap_core.log_structure import MAV, LogStructure
from ap_core.verdict import Verdict
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from mav_handlers.channel import Channel
from mav_handlers.endpoint import MessageEvent
from mav_handlers.handlers import VISION_MESSAGES
from mav_handlers.handlers.vision import odometry_frames_accepted
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ODOMETRY
from viso.files.float_bits import json_value
from viso.running.virtual_time import Scheduler
from viso.streams.stream import LONGEST_SILENCE_US
from viso.streams.stream_kinds import Stream, StreamMessage
from viso.vehicle.outcomes import OUTCOME_WAIT_US, FilterWatch, HandedSample, SampleOutcomes
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle

_VISUAL_ODOM_RECORDS: Final = frozenset(structure.name for structure in LOG_STRUCTURE_FROM_VISUALODOM)
# A capture's arrival is the time of handling; the port was read up to one loop (2500 us) earlier, and unrecorded bytes
# may have waited behind. This value keeps every recorded CTimeMS within 2 ms.
READ_BEFORE_HANDLING_US: Final = 1800
_PERIOD_WITHOUT_FILTER_US: Final = 40 * LOOP_PERIOD_US
SILENCE_BEGIN_US: Final = 30_000_000
"""The part of a long silence that is run at its start; health, aiding and arming time out within 15 s."""
SILENCE_END_US: Final = 5_000_000
"""The part that is run before the message that ends it, so that sensors and filter are up to date again."""


@dataclass(frozen=True, slots=True)
class ReplayedMessage:
    """The outcome of one message.

    ``records`` are the VISO, VISP and VISV records: name, then the fields. ``arrival_us`` is as recorded. ``samples``
    are those passed to the filter; None if that is not recorded.
    """

    arrival_us: int | None
    type: str
    records: tuple[tuple[str, tuple[LogValue, ...]], ...]
    verdict: Verdict
    samples: tuple[HandedSample, ...] | None = None

    def as_dict(self) -> dict[str, object]:
        """Return the message for machine-readable output, floats of records in hex."""
        out = [[name, *map(json_value, values)] for name, values in self.records]
        verdict = self.verdict.as_dict()
        line: dict[str, object] = {"arrival_us": self.arrival_us, "type": self.type, "out": out, "verdict": verdict}
        if self.samples is not None:
            line["filter"] = [outcome for sample in self.samples for outcome in sample.outcomes_as_dicts()]
        return line


@dataclass(frozen=True, slots=True)
class _Handled:
    """A message, and the time until which it waits for the outcomes of its samples."""

    message: ReplayedMessage
    until_us: int

    def is_ripe(self, now_us: int) -> bool:
        return now_us >= self.until_us or all(sample.is_settled for sample in self.message.samples or ())


class Replay:
    """One replay of a stream into a vehicle.

    Args:
        vehicle: fresh, with one link's parameters.
        stream: the stream to feed.
        baud: rate of the link's transport-time model; None for a link without delay.
        watch: of the vehicle's filter; with it the vehicle runs on after the last message until the filter is done.
        filter_until_us: since boot; the filter, which takes most of the time, stops then. None for no limit.
        on_sent: called with the vehicle's output; None to discard it.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        stream: Stream,
        baud: int | None,
        watch: FilterWatch | None = None,
        filter_until_us: int | None = None,
        on_sent: Callable[[bytes], None] | None = None,
    ) -> None:
        self._vehicle = vehicle
        self._on_sent = on_sent
        self._watch = watch
        self._filter_until_us = math.inf if filter_until_us is None else filter_until_us
        self._outcomes = SampleOutcomes()
        self._stream = stream
        self._scheduler = Scheduler(vehicle)
        if watch is not None:
            watch.listeners.append(self._outcomes.take)
            self._scheduler.on_pass = watch.look
        self._channel: Channel = vehicle.endpoint.open_channel(stream.name, baud=baud)
        self._records: list[tuple[str, tuple[LogValue, ...]]] = []
        self._handled: deque[_Handled] = deque()
        self._arrival_us: int | None = None
        self._silences_us: list[tuple[int, int]] = []
        self._tell_record, self._tell_event = vehicle.logger.on_write, vehicle.endpoint.on_event
        vehicle.logger.on_write = self._take_record
        vehicle.logger.wanted_by_listener = _VISUAL_ODOM_RECORDS
        self._channel.has_reader = on_sent is not None or vehicle.logger.takes(MAV)  # a log counts what was sent
        vehicle.endpoint.on_event = self._take_event

    def _take_record(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        if structure.name in _VISUAL_ODOM_RECORDS:
            self._records.append((structure.name, tuple(values)))
            if self._tell_record is not None:
                self._tell_record(structure, values)

    def _take_event(self, event: MessageEvent) -> None:
        samples = None if self._watch is None else self._outcomes.take_handed()
        message = ReplayedMessage(self._arrival_us, event.name, tuple(self._records), event.verdict, samples)
        self._handled.append(_Handled(message, event.now_us + OUTCOME_WAIT_US))
        self._records.clear()
        if self._tell_event is not None:
            self._tell_event(event)

    def run(self, on_progress: Callable[[int], None] = lambda _count: None) -> Iterator[ReplayedMessage]:
        """Feed the stream and yield the outcome of each message, in order; the vehicle's log is then complete.

        ``on_progress`` is called with the number of messages fed so far.
        """
        fed = 0
        for batch in batches(self._stream):
            self._deliver(batch)
            yield from self._take_ripe()
            fed += len(batch)
            on_progress(fed)
        if self._watch is not None:
            self._run_until(self._scheduler.now_us + OUTCOME_WAIT_US)
        yield from self._take_ripe()

    def notes(self) -> tuple[str, ...]:
        """Return a line on the parts of the stream's time that were not run, if any."""
        if not self._silences_us:
            return ()
        start_us, length_us = max(self._silences_us, key=lambda silence: silence[1])
        count, total_us = len(self._silences_us), sum(length_us for _, length_us in self._silences_us)
        others = f" ({count} gaps, {total_us / 1e6:.0f} s in all; this is the longest)" if count > 1 else ""
        run_s = (SILENCE_BEGIN_US / 1e6, SILENCE_END_US / 1e6)
        gap = f"gap of {length_us / 1e6:.0f} s from {start_us / 1e6:.3f} s on{others}"
        return (f"{self._stream.name}: {gap}: passed over except its first {run_s[0]:g} s and last {run_s[1]:g} s",)

    def _deliver(self, batch: Sequence[StreamMessage]) -> None:
        self._arrival_us = arrival_us = batch[0].arrival_us
        time_us = self._stream.begins_us if arrival_us is None else arrival_us
        self._wait_until(max(time_us, self._scheduler.now_us))
        data = b"".join(message.frame for message in batch)
        if not data:
            return
        read_us = time_us - READ_BEFORE_HANDLING_US if self._stream.shared_arrival else None
        self._scheduler.deliver(self._channel, data, read_us=read_us)
        if self._on_sent is not None:
            self._on_sent(self._vehicle.endpoint.bytes_to_send(self._channel))

    def _wait_until(self, time_us: int) -> None:
        """Run until a message comes; of a long silence without motion, only its start and its end."""
        silent_us = self._scheduler.now_us
        while time_us - self._scheduler.now_us > LONGEST_SILENCE_US:
            self._run_until(self._scheduler.now_us + SILENCE_BEGIN_US)
            again_us = time_us - SILENCE_END_US
            if self._vehicle.source.is_at_rest(again_us):
                self._scheduler.pass_over(again_us)
                if silent_us:  # from boot to the begin of the recording there is no gap
                    self._silences_us.append((silent_us, time_us - silent_us))
        self._run_until(time_us)

    def _run_until(self, time_us: int) -> None:
        if self._watch is not None and self._scheduler.period_us == LOOP_PERIOD_US:
            loop_us = int(min(time_us, self._filter_until_us)) // LOOP_PERIOD_US * LOOP_PERIOD_US
            if loop_us > self._scheduler.now_us:
                self._scheduler.run_until(loop_us)
            if time_us > self._filter_until_us:
                self._watch.end()
                self._scheduler.on_pass = None
                self._scheduler.period_us = _PERIOD_WITHOUT_FILTER_US
        self._scheduler.run_until(time_us)

    def _take_ripe(self) -> Iterator[ReplayedMessage]:
        now_us = self._scheduler.now_us
        while self._handled and self._handled[0].is_ripe(now_us):
            message = self._handled.popleft().message
            self._outcomes.forget(message.samples or ())
            yield message


def batches(stream: Stream) -> Iterator[tuple[StreamMessage, ...]]:
    """Yield the messages that were waiting at the same time.

    In a capture a message that makes no record carries its predecessor's time. It was waiting with it only if one that
    does make a record follows it at the same time; otherwise its own time is unknown, and it is fed alone.
    """
    if not stream.shared_arrival:
        yield from ((message,) for message in stream.messages)
        return
    group: list[StreamMessage] = []
    for message in stream.messages:
        if group and (message.arrival_us is None or message.arrival_us != group[0].arrival_us):
            yield from _split_tail(group)
            group = []
        group.append(message)
    if group:
        yield from _split_tail(group)


def _split_tail(group: Sequence[StreamMessage]) -> Iterator[tuple[StreamMessage, ...]]:
    together = len(group)
    while together > 1 and not makes_record(group[together - 1].frame):
        together -= 1
    yield tuple(group[:together])
    yield from ((message,) for message in group[together:])


def makes_record(frame: bytes) -> bool:
    """Return whether a frame carries external navigation that reaches the log."""
    codec = Codec(0, 0)
    codec.feed(frame)
    received = codec.next_received()
    if not isinstance(received, Received) or type(received.message) not in VISION_MESSAGES:
        return False
    message = received.message
    return not isinstance(message, ODOMETRY) or odometry_frames_accepted(message)
