# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot's own clock in a recording with times of another clock, such as one of a slowed simulation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from viso.doctor.evidence.sender_clock import Departure, SenderClock, sender_clock
from viso.doctor.evidence.tracks import Ints, Sender, Track
from viso.streams.stream_kinds import Stream, StreamMessage

_KNOT_US: Final = 1_000_000  # between the moments that are known by both clocks
_ATTITUDES: Final = Sender(0, 0, "ATTITUDE")


@dataclass(frozen=True, slots=True, eq=False)
class BootClock:
    """How an autopilot's clock ran against that of a recording: K moments by both clocks, whose differences count."""

    found: SenderClock
    recorded_us: Ints
    boot_us: Ints

    def boot_of(self, recorded_us: Ints) -> Ints:
        """Return times of the recording by the autopilot's clock, which has its mean rate outside the known moments."""
        inside = np.interp(recorded_us, self.recorded_us, self.boot_us)
        outside = recorded_us - np.clip(recorded_us, self.recorded_us[0], self.recorded_us[-1])
        return np.asarray(inside + outside * self.found.factor, dtype=np.int64)


def boot_clock(times_us: Sequence[tuple[int, int]]) -> BootClock | None:
    """Return how the autopilot's clock ran, from pairs of the recording's time and its own.

    None if it ran as the recording's did, or that is not known.
    """
    if not times_us:
        return None
    recorded_us, boot_us = np.array(times_us, dtype=np.int64).T
    zeros = np.zeros(len(recorded_us), dtype=np.int64)
    found = sender_clock(Track(_ATTITUDES, zeros, recorded_us, boot_us - boot_us[0], int(boot_us[0]), zeros))
    if found is None or found.departure not in (Departure.RATE, Departure.CHANGING) or found.factor <= 0:
        return None
    # The quickest message of each second: the link's delays are not the clock's.
    second = (recorded_us - recorded_us[0]) // _KNOT_US
    starts = np.flatnonzero(np.diff(second, prepend=-1))
    ahead_us = boot_us - found.factor * recorded_us
    parts = zip(starts.tolist(), np.split(ahead_us, starts[1:]), strict=True)
    chosen = [0, *(start + int(np.argmax(part)) for start, part in parts), len(boot_us) - 1]
    rising = np.diff(np.maximum.accumulate(boot_us[chosen]), prepend=-1) > 0
    knots = np.array(chosen)[rising]
    return BootClock(found, recorded_us[knots], boot_us[knots])


def by_boot_clock(stream: Stream, clock: BootClock) -> Stream:
    """Return a stream with times by the autopilot's clock, and a note; the time of the first message stays."""
    known = [message.arrival_us for message in stream.messages if message.arrival_us is not None]
    boot_us = clock.boot_of(np.array(known, dtype=np.int64))
    moved = iter(np.maximum.accumulate(known[0] + boot_us - boot_us[0]).tolist() if known else [])
    messages = tuple(
        StreamMessage(None if message.arrival_us is None else next(moved), message.frame) for message in stream.messages
    )
    found = clock.found
    note = (
        f"{stream.name}: the autopilot's clock runs at {found.factor:.2g} times that of the recording "
        f"({found.slowest:.2g} to {found.quickest:.2g} in stretches), as that of a simulation does; times are by the "
        "autopilot's"
    )
    return replace(stream, messages=messages, notes=(*stream.notes, note))
