# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What cannot be judged, by what moves the vehicle."""

import pytest

from viso.replay.observability import OF_THE_STREAM, caution, doubts, unobservable
from viso.vehicle.sensors.flight import Basis


@pytest.mark.parametrize("name", OF_THE_STREAM)
def test_vehicle_that_moves_as_the_stream_says_cannot_contradict_it(name: str) -> None:
    assert "moves as the stream says" in (unobservable(name, "follow") or "")
    assert "stands still" in (unobservable(name, "bench") or "")
    assert unobservable(name, "log:flight.BIN") is None
    assert unobservable(name, "script:square") is None


def test_what_does_not_describe_the_stream_can_be_judged_with_any_motion() -> None:
    assert unobservable("EK3_POS_I_GATE", "follow") is None
    assert caution("EK3_POS_I_GATE", Basis.ESTIMATE) is None


def test_motion_of_the_filters_own_estimate_leans_to_what_it_flew_with() -> None:
    assert "leans to the value of that flight" in (caution("VISO_DELAY_MS", Basis.ESTIMATE) or "")
    assert caution("VISO_DELAY_MS", Basis.IMU) is None
    assert caution("VISO_DELAY_MS", None) is None
    assert "positions, not velocities" in (caution("VISO_SCALE", Basis.REPLAY) or "")


def test_each_parameter_has_its_line() -> None:
    lines = list(doubts(["VISO_SCALE", "VISO_TYPE", "VISO_POS_X"], "follow", None))
    assert [line.split()[0] for line in lines] == ["VISO_SCALE", "VISO_POS_X"]
    (line,) = doubts(["VISO_DELAY_MS"], "log:a.BIN", Basis.ESTIMATE)
    assert line.startswith("VISO_DELAY_MS: the motion is")
