# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What innovations amount to: their number, mean, median and spread, all together and for each id."""

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.landmarks.residuals import Innovation, Residuals

_SIGMA_OF_MAD: Final = 1.4826
"""For normal noise."""

Pixels = tuple[float, float]
"""To the right, and down."""


@dataclass(frozen=True, slots=True)
class InnovationStatistics:
    """Of some innovations, in px.

    Attributes:
        count: how many; with none the rest is NaN.
        mean, median: of them.
        spread: standard deviation.
        robust_spread: the same, judged by the median distance from the median: wrong matches hardly count.
    """

    count: int
    mean: Pixels
    median: Pixels
    spread: Pixels
    robust_spread: Pixels


@dataclass(frozen=True, slots=True)
class Summary:
    """Of many pictures.

    Attributes:
        pictures: how many.
        per_id: of each landmark's or aircraft's, in the order of appearance.
        unmatched, not_projected, duplicates: how often each id was one.
    """

    pictures: int
    overall: InnovationStatistics
    per_id: Mapping[str, InnovationStatistics]
    unmatched: Mapping[str, int]
    not_projected: Mapping[str, int]
    duplicates: Mapping[str, int]


def innovation_statistics(innovations: Sequence[Innovation]) -> InnovationStatistics:
    if not innovations:
        none = (float("nan"), float("nan"))
        return InnovationStatistics(0, none, none, none, none)
    values = np.array([(one.du_px, one.dv_px) for one in innovations])
    median = np.median(values, axis=0)
    mad = np.median(np.abs(values - median), axis=0)
    figures = values.mean(axis=0), median, values.std(axis=0), _SIGMA_OF_MAD * mad
    return InnovationStatistics(len(innovations), *((float(u), float(v)) for u, v in figures))


def summarise(pictures: Collection[Residuals]) -> Summary:
    per_id: defaultdict[str, list[Innovation]] = defaultdict(list)
    everything = [one for picture in pictures for one in picture.innovations]
    for innovation in everything:
        per_id[innovation.id].append(innovation)
    return Summary(
        len(pictures),
        innovation_statistics(everything),
        {name: innovation_statistics(its) for name, its in per_id.items()},
        Counter(name for picture in pictures for name in picture.unmatched),
        Counter(name for picture in pictures for name in picture.not_projected),
        Counter(name for picture in pictures for name in picture.duplicates),
    )
