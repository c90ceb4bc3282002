# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The covariance of a pose that is composed of poses relative to keyframes."""

import numpy as np
import pytest

from tests.unit.viso.companion.msckf.point_world import PointWorld, filter_at
from viso.companion.msckf.chain import Chain
from viso.companion.msckf.window_filter import CLONE, MOTION, POS, VEL, WindowFilter

STEPS = 10


def flown() -> WindowFilter:
    """Return a filter that knows a past pose, where it began, and whose velocity is wrong by 0.1 m/s or so."""
    state = filter_at(*PointWorld(0).start(), sigmas=(1e-6, 1e-6, 0.1, 1e-6, 1e-6))
    state.clone(0)
    return state


def coast(state: WindowFilter, dt_s: float) -> None:
    """Let a body go on at its velocity, without any noise."""
    transition = np.eye(len(state.cov))
    transition[POS, VEL] = dt_s * np.eye(3)
    state.p = state.p + dt_s * state.v
    state.cov = transition @ state.cov @ transition.T


def test_velocity_that_is_wrong_all_the_way_counts_all_the_way() -> None:
    """Links that were added up as if independent would make a third of it."""
    state = flown()
    chain, independent = Chain(state, 0, 0), 0.0
    for number in range(1, STEPS + 1):
        coast(state, 0.1)
        independent += state.relative_to(number - 1)[1][3, 3]
        covariance = chain.covariance(state, number - 1, number)
        state.clone(number)
    assert np.sqrt(covariance.diagonal()[3:]) == pytest.approx([0.1] * 3, rel=0.02)
    assert np.sqrt(independent) == pytest.approx(0.1 / np.sqrt(STEPS), rel=0.05)


def test_what_is_learnt_about_a_keyframe_after_it_was_told_is_not_in_the_chain() -> None:
    state = flown()
    chain = Chain(state, 0, 0)
    coast(state, 1.0)
    told = chain.covariance(state, 0, 1)
    state.clone(1)
    jacobian = np.zeros((3, len(state.cov)))
    first, second = (slice(MOTION + CLONE * index + 3, MOTION + CLONE * (index + 1)) for index in range(2))
    jacobian[:, second], jacobian[:, first] = np.eye(3), -np.eye(3)
    state.update(jacobian, np.zeros(3), 1e-3)
    after = chain.covariance(state, 1)
    assert after[3:, 3:].trace() == pytest.approx(told[3:, 3:].trace(), rel=0.05)
    assert state.relative_to(0)[1][3:, 3:].trace() < 0.1 * told[3:, 3:].trace()
