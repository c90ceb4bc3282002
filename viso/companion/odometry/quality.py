# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quality of an ODOMETRY message, from the health of the strategy that made it."""

from typing import Final

from viso.companion.vio.types import FeatureQuality, VioState

QUALITY_LOST: Final = -1
FULL_INLIERS: Final = 100
FULL_COVERAGE: Final = 0.6


def quality_of(state: VioState, features: FeatureQuality, innovation_ratio: float) -> int | None:
    """Return what goes into the message: 50..100 tracking, 1..49 degraded, -1 lost; None if none may be sent.

    Never 0, which the message defines as unknown.

    Args:
        state: the strategy's.
        features: of its last output.
        innovation_ratio: running mean of NIS per degree of freedom; anything but a number from 0 counts as the worst.
    """
    if state is VioState.INIT:
        return None
    if state is VioState.LOST:
        return QUALITY_LOST
    share = _share(features, innovation_ratio)
    return 50 + round(50 * share) if state is VioState.TRACKING else 1 + round(48 * share)


def _share(features: FeatureQuality, innovation_ratio: float) -> float:
    if not innovation_ratio >= 0:
        return 0.0
    consistency = 1.0 / max(innovation_ratio, 1.0)
    return min(1.0, features.inliers / FULL_INLIERS) * min(1.0, features.coverage / FULL_COVERAGE) * consistency
