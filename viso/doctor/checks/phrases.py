# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How findings speak of times, counts and shares."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from viso.doctor.checks import limits
from viso.doctor.checks.check import Sighting
from viso.doctor.evidence.tracks import HandledMessage, Track


def at(time_us: float) -> str:
    """Return a time in s since boot."""
    return f"{time_us * 1e-6:.3f} s"


def per_second(times_us: npt.ArrayLike) -> str:
    """Return how many messages come a second, counted over time, and whether they come in bursts; at least two."""
    times = np.asarray(times_us, dtype=np.float64)
    rate, middle_us = 1e6 * (len(times) - 1) / np.ptp(times), float(np.median(np.diff(times)))
    bursts = "" if middle_us * rate > limits.BURST_INTERVAL * 1e6 else ", in bursts or with gaps"
    return f"{rate:.3g} messages per second{bursts}"


def share(part: int, whole: int) -> str:
    """Return a count of a whole, and in percent."""
    return f"{part} of {whole} ({100 * part / whole:.0f} %)" if whole else f"{part} of 0"


def how_often(count: int) -> str:
    """Return how often something happens."""
    return "once" if count == 1 else f"{count} times"


def listed(texts: Sequence[str], most: int = 4) -> str:
    """Return the first few of some texts."""
    return ", ".join(texts[:most]) + (", …" if len(texts) > most else "")


def by_type(messages: Iterable[HandledMessage]) -> Iterator[tuple[str, list[HandledMessage]]]:
    """Yield the names of messages in alphabetical order, and those of each."""
    found = list(messages)
    for name in sorted({message.name for message in found}):
        yield name, [message for message in found if message.name == name]


def masked(text: str, track: Track, mask: npt.ArrayLike) -> Iterator[Sighting]:
    """Yield how many messages of a track show what ``text`` says, by a mask of N; nothing if it is none."""
    chosen = np.flatnonzero(mask)
    if len(chosen):
        yield Sighting.in_track(f"{track.sender}: {share(len(chosen), len(track))} messages {text}", track, chosen)
