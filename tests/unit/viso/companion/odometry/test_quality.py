# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quality that a message carries."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.odometry.source import quality_of
from viso.companion.vio.types import FeatureQuality, VioState


def features(inliers: int = 100, coverage: float = 0.6) -> FeatureQuality:
    return FeatureQuality(inliers, 0, 0, inliers, 10.0, 0.3, coverage)


@pytest.mark.parametrize(
    ("inliers", "coverage", "ratio", "tracking", "degraded"),
    [
        (100, 0.6, 1.0, 100, 49),
        (300, 1.0, 0.2, 100, 49),  # no factor exceeds 1
        (50, 0.6, 1.0, 75, 25),
        (100, 0.3, 1.0, 75, 25),
        (100, 0.6, 4.0, 62, 13),
        (80, 0.45, 2.0, 65, 15),
        (0, 0.6, 1.0, 50, 1),
        (100, 0.6, math.inf, 50, 1),
        (100, 0.6, math.nan, 50, 1),
    ],
)
def test_quality_is_the_product_of_three_shares(
    inliers: int, coverage: float, ratio: float, tracking: int, degraded: int
) -> None:
    found = [quality_of(s, features(inliers, coverage), ratio) for s in (VioState.TRACKING, VioState.DEGRADED)]
    assert found == [tracking, degraded]


def test_nothing_is_sent_while_initialising() -> None:
    assert quality_of(VioState.INIT, features(), 1.0) is None


def test_lost_is_minus_one() -> None:
    assert quality_of(VioState.LOST, features(), 1.0) == -1


@given(st.integers(0, 500), st.floats(0, 1), st.floats())
def test_tracking_and_degraded_keep_to_their_ranges(inliers: int, coverage: float, ratio: float) -> None:
    tracking = quality_of(VioState.TRACKING, features(inliers, coverage), ratio)
    degraded = quality_of(VioState.DEGRADED, features(inliers, coverage), ratio)
    assert tracking in range(50, 101)
    assert degraded in range(1, 50)
