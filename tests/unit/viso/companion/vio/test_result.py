# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The four results of a frame."""

import pytest

from tests.unit.viso.companion.vio.strategy_rig import make_frame, make_output, make_result
from viso.companion.vio.types import VioState


@pytest.mark.parametrize("state", list(VioState))
def test_class_tells_the_state_and_whether_there_is_an_output(state: VioState) -> None:
    result = make_result(state, make_output(make_frame(1)))
    assert result.state is state
    assert (result.output is not None) == (state in (VioState.TRACKING, VioState.DEGRADED))


@pytest.mark.parametrize("state", list(VioState))
def test_loss_after_a_frame_keeps_what_is_known_of_it(state: VioState) -> None:
    lost = make_result(state, make_output(make_frame(1)), sequence=5, resets=2, reason="good").lost("camera failed")
    assert (lost.state, lost.output, lost.reason) == (VioState.LOST, None, "camera failed")
    assert (lost.sequence, lost.resets) == (5, 2)
