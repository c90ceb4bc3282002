# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the baseline must achieve in scenes that are hard in their own ways."""

import functools

import pytest

from tests.acceptance.scenes import SCENES
from tests.acceptance.trial import Trial

pytestmark = pytest.mark.slow

SEEDS = range(2)
MOST_M = {"hover": 1.0, "hills": 0.5, "low contrast": 0.5, "high": 0.45, "spin": 0.18}


@functools.cache
def flown(name: str, seed: int) -> Trial:
    (scene,) = (scene for scene in SCENES if scene.name == name)
    return scene.fly("klt_ransac", seed)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", MOST_M)
def test_error_is_small(name: str, seed: int) -> None:
    assert flown(name, seed).absolute_error().rmse_m < MOST_M[name]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", ["survey", "high", "spin", "hills", "hover"])
def test_error_in_tracking_is_admitted(name: str, seed: int) -> None:
    claims = flown(name, seed).claims()
    assert claims.frames > 0
    assert claims.refuted <= 0.05 * claims.frames
    assert claims.unsaid_m < 1.0
