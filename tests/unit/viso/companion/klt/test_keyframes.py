# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a keyframe is outdated."""

import uuid

import numpy as np
import pytest

from viso.companion.klt.front_end import MAX_AGE_NS, MIN_COMMON, MIN_DISPARITY_PX, Keyframe, Sighting
from viso.companion.klt.outliers import Model, rotated
from viso.geometry.rotation import Array, so3_exp

FOCAL = 500.0
POINTS = np.random.default_rng(0).uniform(-0.4, 0.4, (60, 2))
IDS = np.arange(60)
SOON_NS = 100_000_000
AHEAD = so3_exp(np.array([0.3, -0.2, 0.5]))


def sighting(ids: object = IDS, normalised: Array = POINTS) -> Sighting:
    ids = np.asarray(ids)
    return Sighting(ids, normalised, len(ids), 0, 0, len(ids), Model.HOMOGRAPHY, 1.0, 1.0)


def keyframe() -> Keyframe:
    return Keyframe(uuid.UUID(int=7), 3, 0, AHEAD, sighting())


def test_same_view_is_not_outdated() -> None:
    assert not keyframe().is_outdated(SOON_NS, AHEAD, sighting(), FOCAL)


@pytest.mark.parametrize(("px", "outdated"), [(MIN_DISPARITY_PX - 0.1, False), (MIN_DISPARITY_PX + 0.1, True)])
def test_view_that_has_moved_far_enough_is_outdated(px: float, outdated: bool) -> None:
    moved = POINTS + np.array([0.6, -0.8]) * px / FOCAL
    assert keyframe().is_outdated(SOON_NS, AHEAD, sighting(normalised=moved), FOCAL) is outdated


@pytest.mark.parametrize(("common", "outdated"), [(MIN_COMMON, False), (MIN_COMMON - 1, True)])
def test_view_with_too_few_common_points_is_outdated(common: int, outdated: bool) -> None:
    ids = np.concatenate([np.arange(common), np.arange(1000, 1060 - common)])
    assert keyframe().is_outdated(SOON_NS, AHEAD, sighting(ids), FOCAL) is outdated


@pytest.mark.parametrize(("t_ns", "outdated"), [(MAX_AGE_NS - 1, False), (MAX_AGE_NS, True)])
def test_keyframe_lasts_a_second(t_ns: int, outdated: bool) -> None:
    assert keyframe().is_outdated(t_ns, AHEAD, sighting(), FOCAL) is outdated


def test_turn_alone_does_not_outdate() -> None:
    turn = so3_exp(np.array([0.05, 0.1, -0.2]))  # of the camera's axes
    turned = sighting(normalised=rotated(turn, POINTS))
    assert np.median(np.hypot(*(turned.normalised - POINTS).T)) * FOCAL > MIN_DISPARITY_PX
    assert not keyframe().is_outdated(SOON_NS, AHEAD @ turn.T, turned, FOCAL)


def test_order_of_the_points_does_not_matter() -> None:
    order = np.random.default_rng(1).permutation(60)
    assert not keyframe().is_outdated(SOON_NS, AHEAD, sighting(IDS[order], POINTS[order]), FOCAL)


def test_view_to_the_other_side_is_outdated() -> None:
    assert keyframe().is_outdated(SOON_NS, AHEAD @ so3_exp(np.array([3.0, 0.0, 0.0])), sighting(), FOCAL)
