# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an objective is best along one axis: the lowest point, and the vertex of the parabola through it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from viso.compare.merit import surplus
from viso.replay.figures import LOWER_IS_BETTER

RESOLUTIONS: Final[Mapping[str, float]] = {"VISO_DELAY_MS": 12.5}
"""A difference that the filter cannot resolve whatever the samples are: a step of it, in ms."""

GROUPED_BY: Final = ("stream", "firmware", "faults", "seed")

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Best:
    """The best point along an axis, others being the same.

    Attributes:
        at: the value of the axis at the best point; of points that are as good as each other the first.
        same_until: the last value up to which nothing changes; ``at`` itself if the next one is worse.
        value: the objective there.
        vertex: where the parabola through it and its neighbours has its vertex; None at the edge, or where it is flat.
        at_edge: whether the best point is the first or the last.
        alike: from which value to which others may be as good, the difference being chance; None if that is unknown.
        stands_out: whether any value is worse by more than chance; None if that is unknown.
    """

    at: float
    same_until: float
    value: float
    vertex: float | None
    at_edge: bool
    is_first: bool
    alike: tuple[float, float] | None
    stands_out: bool | None
    row: Row


def best_rows(rows: Iterable[Row], objective: str, count: int) -> list[Row]:
    """Return the best rows, at most so many, the best first; of equal ones the first."""
    known = [row for row in rows if row[objective] is not None]
    sign = 1.0 if objective in LOWER_IS_BETTER else -1.0
    return sorted(known, key=lambda row: (sign * row[objective], row["point"]))[:count]


def best_along(rows: Iterable[Row], axis: str, objective: str) -> list[Best]:
    """Return the best point of each group along an axis."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row[objective] is not None:
            groups.setdefault(tuple(row[name] for name in GROUPED_BY), []).append(row)
    for members in groups.values():
        members.sort(key=lambda row: float(row[axis]))
    return [_best_of(members, axis, objective) for members in groups.values()]


def _best_of(members: Sequence[Row], axis: str, objective: str) -> Best:
    best = best_rows(members, objective, 1)[0]
    index = members.index(best)
    worse = (number for number in range(index, len(members)) if members[number][objective] != best[objective])
    same = members[next(worse, len(members)) - 1][axis]
    at_edge = index in (0, len(members) - 1)
    around = [] if at_edge else [(row[axis], row[objective]) for row in members[index - 1 : index + 2]]
    vertex = _vertex(*around) if around else None
    alike, stands_out = _alike(members, index, axis, objective)
    return Best(best[axis], same, best[objective], vertex, at_edge, index == 0, alike, stands_out, best)


def _alike(
    members: Sequence[Row], index: int, axis: str, objective: str
) -> tuple[tuple[float, float] | None, bool | None]:
    """Return between which values about the best point the objective is as good, and whether any value is worse."""
    found = [surplus(row, members[index], objective) for row in members]
    near = [abs(row[axis] - members[index][axis]) <= RESOLUTIONS.get(axis, 0.0) for row in members]
    worse = [
        difference is not None and difference.value > 0 and not difference.is_chance and not close
        for difference, close in zip(found, near, strict=True)
    ]
    if len(members) < 2 or None in found:
        return None, None
    first = next((number + 1 for number in range(index, -1, -1) if worse[number]), 0)
    last = next((number - 1 for number in range(index, len(members)) if worse[number]), len(members) - 1)
    return (members[first][axis], members[last][axis]), any(worse)


def _vertex(left: tuple[float, float], middle: tuple[float, float], right: tuple[float, float]) -> float | None:
    """Return where the parabola through three points has its vertex; None if they are on a line."""
    (x0, y0), (x1, y1), (x2, y2) = left, middle, right
    before, after = (y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)
    if before == after:
        return None
    curve = (after - before) / (x2 - x0)
    return 0.5 * (x0 + x1 - before / curve)
