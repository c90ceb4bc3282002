# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How findings speak of times, counts and shares."""

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from viso.doctor.findings import Sighting
from viso.doctor.measures.judged_message import SeenMessage
from viso.doctor.measures.tracks import Track


def at(time_us: float) -> str:
    """Return a time in s since boot."""
    return f"{time_us * 1e-6:.3f} s"


def share(part: int, whole: int) -> str:
    """Return a count of a whole, and in percent."""
    return f"{part} of {whole} ({100 * part / whole:.0f} %)" if whole else f"{part} of 0"


def seen_in(text: str, messages: Iterable[SeenMessage]) -> Sighting:
    """Return what some messages show; there must be one at least."""
    shown = list(messages)
    return Sighting(text, [one.number for one in shown], shown[0].arrival_us, shown[-1].arrival_us)


def listed(texts: Sequence[str], most: int = 4) -> str:
    """Return the first few of some texts."""
    return ", ".join(texts[:most]) + (", …" if len(texts) > most else "")


def of_track(text: str, track: Track, mask: npt.ArrayLike) -> Sighting:
    """Return what some messages of a track show, by a mask of N; there must be one at least."""
    chosen = np.flatnonzero(mask)
    text = f"{track.sender}: {share(len(chosen), len(track))} messages {text}"
    arrivals = track.arrival_us[chosen]
    return Sighting(text, track.numbers[chosen].tolist(), int(arrivals[0]), int(arrivals[-1]))


def of_whole(text: str, track: Track, fix: str | None = None) -> Sighting:
    """Return what all messages of a track show together."""
    return Sighting(text, track.numbers.tolist(), int(track.arrival_us[0]), int(track.arrival_us[-1]), fix)
