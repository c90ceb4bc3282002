# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What innovations amount to: their number, mean, median and spread, all together and for each id."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
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
    mean_u, mean_v = values.mean(axis=0).tolist()
    spread_u, spread_v = values.std(axis=0).tolist()
    robust_u, robust_v = (_SIGMA_OF_MAD * mad).tolist()
    return InnovationStatistics(
        len(innovations), (mean_u, mean_v), tuple(median.tolist()), (spread_u, spread_v), (robust_u, robust_v)
    )


def summarise(pictures: Iterable[Residuals]) -> Summary:
    count, everything = 0, list[Innovation]()
    per_id: defaultdict[str, list[Innovation]] = defaultdict(list)
    unmatched, not_projected, duplicates = Counter[str](), Counter[str](), Counter[str]()
    for picture in pictures:
        count += 1
        everything.extend(picture.innovations)
        for innovation in picture.innovations:
            per_id[innovation.id].append(innovation)
        unmatched.update(picture.unmatched)
        not_projected.update(picture.not_projected)
        duplicates.update(picture.duplicates)
    return Summary(
        count,
        innovation_statistics(everything),
        MappingProxyType({name: innovation_statistics(its) for name, its in per_id.items()}),
        MappingProxyType(unmatched),
        MappingProxyType(not_projected),
        MappingProxyType(duplicates),
    )
