# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of merit of two replays of one stream, and whether innovations differ by more than chance.

Both replays have the same samples, so they are compared by spans of time: a difference throughout the flight is not
chance, one from a single moment may be.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from viso.replay.figures import BY_TIME, OBJECTIVES, Row
from viso.vehicle.outcomes import UNITS

SIGMAS: Final = 2.0
"""A difference of more standard deviations is more than chance."""

_COMPARED: Final = (
    *(f"rms_{kind}" for kind in UNITS),
    *("nis", "worst_ratio", "rejected", "resets", "time_to_aiding_s", "aiding_share", "aiding_losses"),
    *("log_m", "ate_m"),
)

_FEWEST_SPANS: Final = 8
_COLUMNS: Final = {"nis": 2, "rms": 3}  # of a row of BY_TIME


class Surplus(NamedTuple):
    """The difference of two mean squares of innovations, and its standard deviation."""

    value: float
    sigma: float

    @property
    def is_chance(self) -> bool:
        """Whether it may be chance alone."""
        return abs(self.value) <= SIGMAS * self.sigma


def surplus(row: Row, other: Row, objective: str = "nis") -> Surplus | None:
    """Return the excess of a row's innovations over those of another row of the same stream.

    None where the objective (nis, nis_... or rms_..., squared) is not made of innovations, or there are too few.
    """
    if not (row.get(BY_TIME) and other.get(BY_TIME)):
        return None
    span_s = max(replay[BY_TIME]["span_s"] for replay in (row, other))
    (counts, sums), (other_counts, other_sums) = (_spans(replay, objective, span_s) for replay in (row, other))
    count, other_count = sum(counts.values()), sum(other_counts.values())
    numbers = sorted({*counts, *other_counts})
    if len(numbers) < _FEWEST_SPANS or not (count and other_count):
        return None
    parts = [sums.get(number, 0.0) / count - other_sums.get(number, 0.0) / other_count for number in numbers]
    return Surplus(math.fsum(parts), float(np.std(parts, ddof=1)) * math.sqrt(len(parts)))


def _spans(row: Row, objective: str, span_s: int) -> tuple[dict[int, float], dict[int, float]]:
    """Return the number of samples in each span, and the sum of their squares."""
    what, _, kind = objective.partition("_")
    counts: dict[int, float] = {}
    sums: dict[int, float] = {}
    for of_kind, spans in row[BY_TIME]["sums"].items():
        for span in spans if what in _COLUMNS and kind in ("", of_kind) else ():
            number = int(span[0]) * row[BY_TIME]["span_s"] // span_s
            counts[number] = counts.get(number, 0.0) + span[1]
            sums[number] = sums.get(number, 0.0) + span[_COLUMNS[what]]
    return counts, sums


class Merit(NamedTuple):
    """A figure of both replays; None where one has none."""

    name: str
    before: float | None
    after: float | None


def merits(before: Row, after: Row) -> list[Merit]:
    """Return the figures that either of the two has."""
    found = (Merit(name, before[name], after[name]) for name in _COMPARED)
    return [merit for merit in found if (merit.before, merit.after) != (None, None)]


def merit_rows(before: Row, after: Row) -> list[dict[str, Any]]:
    """Return the same for machines; figures of innovations with their surplus and its deviation."""
    rows = []
    for merit in merits(before, after):
        found = surplus(after, before, merit.name)
        rows.append({**merit._asdict(), "unit": OBJECTIVES[merit.name].unit})
        if found is not None:
            rows[-1] |= {"surplus_of_squares": found.value, "sigma": found.sigma, "chance": found.is_chance}
    return rows
