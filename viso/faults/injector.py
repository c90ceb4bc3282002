# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The injector: frames go in, and come out late, changed, twice or not at all, in virtual time."""

import heapq
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from random import Random

from viso.faults.fault import Moment
from viso.faults.packet import Key, Packet, PassedOver, read_packet
from viso.faults.timeline import Entry, Timeline

BY_CHANCE = "by chance"

TimedFrame = tuple[int, bytes]


@dataclass(frozen=True, slots=True)
class EntryTally:
    """What one entry of a timeline has done; frames met = done + passed over.

    Attributes:
        number: of the entry, from 1.
        entry: itself.
        met: frames that it was for, at their time.
        done: frames that it happened to.
        lost: frames that it lost.
        added: frames that it added.
        passed_over: frames that it left alone, by reason.
    """

    number: int
    entry: Entry
    met: int
    done: int
    lost: int
    added: int
    passed_over: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Tally:
    """Outcome of all frames; received + added = passed on + lost + waiting.

    Attributes:
        received: frames that came in, by the name of the message.
        changed: frames passed on, or waiting, whose bytes are not those of one that came in.
        passed_on: frames that went out.
        waiting: frames held back.
        entries: what each entry has done.
    """

    received: Mapping[str, int]
    changed: int
    passed_on: int
    waiting: int
    entries: tuple[EntryTally, ...]

    @property
    def lost(self) -> int:
        """Frames that were lost."""
        return sum(entry.lost for entry in self.entries)

    @property
    def added(self) -> int:
        """Frames that were added."""
        return sum(entry.added for entry in self.entries)


class _Run:
    """An entry at work: its fault with a memory, its chance, its counts."""

    def __init__(self, number: int, entry: Entry, seed: int) -> None:
        self.number = number
        self.entry = entry
        self._fault = replace(entry.fault)
        # A source of its own: what other entries draw makes no difference.
        self._random = Random(f"{seed}:{number}")
        self._met = self._done = self._lost = self._added = 0
        self._passed_over: Counter[str] = Counter()

    def meet(self, packet: Packet, since_start_us: int) -> tuple[Packet, ...]:
        entry = self.entry
        if not entry.covers(since_start_us, packet.name) or (entry.once and self._done):
            return (packet,)
        self._met += 1
        try:
            became = self._act(packet, since_start_us)
        except PassedOver as reason:
            self._passed_over[str(reason)] += 1
            return (packet,)
        self._done += 1
        self._lost += not became
        self._added += max(len(became) - 1, 0)
        return became

    def _act(self, packet: Packet, since_start_us: int) -> tuple[Packet, ...]:
        if not self._fault.goes_on and self.entry.probability < 1 and self._random.random() >= self.entry.probability:
            raise PassedOver(BY_CHANCE)
        return self._fault.act(packet, Moment(since_start_us - self.entry.start_us, self._random))

    def tally(self) -> EntryTally:
        return EntryTally(
            self.number, self.entry, self._met, self._done, self._lost, self._added, dict(self._passed_over)
        )


class Injector:
    """Takes frames as they arrive and gives them, with a timeline's faults, when they are due.

    The same frames at the same times, with the same timeline and seed, come out the same, byte for byte. Frames of one
    kind from one sender stay in order unless a fault lets them overtake; others pass each other as delays have it.

    Args:
        timeline: the faults, in the order in which a frame meets them.
        seed: in place of the timeline's.
        start_us: where the timeline begins; the time of the first frame if None.
    """

    def __init__(self, timeline: Timeline, seed: int | None = None, start_us: int | None = None) -> None:
        chosen = timeline.seed if seed is None else seed
        self._runs = [_Run(number, entry, chosen) for number, entry in enumerate(timeline.entries, 1)]
        self._start_us = start_us
        self._now_us: int | None = None
        self._waiting: list[tuple[int, int, int, bytes]] = []
        self._count = 0
        self._last_due_us: dict[Key, int] = {}
        self._received: Counter[str] = Counter()
        self._changed = self._passed_on = 0

    def push(self, time_us: int, frame: bytes) -> None:
        """Take a frame that arrives.

        Args:
            time_us: when, on any clock. A frame earlier than the one before is handled with that one, and keeps the
                difference.
            frame: one whole MAVLink frame; anything else passes as bytes that are no frame.
        """
        now_us = time_us if self._now_us is None else max(time_us, self._now_us)
        self._now_us = now_us
        if self._start_us is None:
            self._start_us = now_us
        packet = read_packet(frame)
        self._received[packet.name] += 1
        packets: Sequence[Packet] = (packet,)
        for run in self._runs:
            packets = [out for packet in packets for out in run.meet(packet, now_us - self._start_us)]
        for packet in packets:
            self._changed += packet.frame != frame
            self._schedule(packet, now_us, time_us - now_us)

    def _schedule(self, packet: Packet, now_us: int, early_us: int) -> None:
        due_us = max(now_us + packet.delay_us, self._last_due_us.get(packet.key, now_us))
        if not packet.may_overtake:
            self._last_due_us[packet.key] = due_us
        heapq.heappush(self._waiting, (due_us, self._count, due_us + early_us, packet.frame))
        self._count += 1

    def next_due_us(self) -> int | None:
        """Return when the next frame is due, None while none waits."""
        return self._waiting[0][0] if self._waiting else None

    def pop_due(self, now_us: int) -> list[TimedFrame]:
        """Return the frames that are due, each with its time, in order."""
        due = []
        while self._waiting and self._waiting[0][0] <= now_us:
            _, _, time_us, frame = heapq.heappop(self._waiting)
            due.append((time_us, frame))
        self._passed_on += len(due)
        return due

    def drain(self) -> list[TimedFrame]:
        """Return all that waits, in order, as if there were no end of time."""
        return self.pop_due(max((due_us for due_us, *_ in self._waiting), default=0))

    def tally(self) -> Tally:
        """Return what has become of all frames so far."""
        entries = tuple(run.tally() for run in self._runs)
        return Tally(dict(self._received), self._changed, self._passed_on, len(self._waiting), entries)


def inject(messages: Iterable[TimedFrame], timeline: Timeline, seed: int | None = None) -> Iterator[TimedFrame]:
    """Yield a stream with a timeline's faults.

    Args:
        messages: the stream: times in us on any clock, and frames; the timeline begins with the first.
        timeline: the faults.
        seed: in place of the timeline's.
    """
    yield from run_through(messages, Injector(timeline, seed))


def run_through(messages: Iterable[TimedFrame], injector: Injector) -> Iterator[TimedFrame]:
    """Yield what a fresh injector makes of a stream; its tally is then complete."""
    for time_us, frame in messages:
        yield from injector.pop_due(time_us - 1)
        injector.push(time_us, frame)
    yield from injector.drain()
