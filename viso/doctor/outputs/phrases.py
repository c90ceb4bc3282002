# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How findings speak of times, counts and shares."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from viso.doctor.findings import Severity, Sighting
from viso.doctor.measures.motion import Motion
from viso.doctor.measures.tracks import SeenMessage, Track

_ALL = slice(None)


def at(time_us: float) -> str:
    """Return a time in s since boot."""
    return f"{time_us * 1e-6:.3f} s"


def share(part: int, whole: int) -> str:
    """Return a count of a whole, and in percent."""
    return f"{part} of {whole} ({100 * part / whole:.0f} %)" if whole else f"{part} of 0"


def often(count: int) -> str:
    """Return how often something happens."""
    return "once" if count == 1 else f"{count} times"


def seen_in(
    text: str, shown: Sequence[SeenMessage], fix: str | None = None, severity: Severity | None = None
) -> Sighting:
    """Return what some messages show; there must be one at least."""
    return Sighting(text, [one.number for one in shown], shown[0].arrival_us, shown[-1].arrival_us, fix, severity)


def by_type(messages: Iterable[SeenMessage]) -> Iterator[tuple[str, list[SeenMessage]]]:
    """Yield the names of messages in alphabetical order, and those of each."""
    found = list(messages)
    for name in sorted({one.name for one in found}):
        yield name, [one for one in found if one.name == name]


def listed(texts: Sequence[str], most: int = 4) -> str:
    """Return the first few of some texts."""
    return ", ".join(texts[:most]) + (", …" if len(texts) > most else "")


def of_track(text: str, track: Track, mask: npt.ArrayLike) -> Iterator[Sighting]:
    """Yield what some messages of a track show, by a mask of N; nothing if it is none."""
    chosen = np.flatnonzero(mask)
    if len(chosen):
        yield of_some(f"{track.sender}: {share(len(chosen), len(track))} messages {text}", track, chosen)


def of_some(
    text: str,
    track: Track | Motion,
    chosen: Any = _ALL,
    fix: str | None = None,
    severity: Severity | None = None,
) -> Sighting:
    """Return what some messages of a track show, by mask, slice or indices; there must be one at least."""
    arrivals = track.arrival_us[chosen]
    return Sighting(text, track.numbers[chosen].tolist(), int(arrivals[0]), int(arrivals[-1]), fix, severity)
