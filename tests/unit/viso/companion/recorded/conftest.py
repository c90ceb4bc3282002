# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Short trajectories for the tests of recorded engines."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from viso.companion.recorded.recorded_trajectory import RecordedTrajectory
from viso.companion.recorded.records import TrajectoryError

MakeTrajectory = Callable[..., RecordedTrajectory]


def outcome_of(read: Callable[[], RecordedTrajectory]) -> RecordedTrajectory | str:
    """Return what was read, or the text of the one error that reading may end with."""
    try:
        return read()
    except TrajectoryError as error:
        return str(error)


@pytest.fixture
def make_trajectory() -> MakeTrajectory:
    """Return a function that makes a level trajectory at 10 Hz along x at 1 m/s; keywords replace fields."""

    def make(count: int = 5, **fields: Any) -> RecordedTrajectory:
        times_ns = np.arange(count) * 100_000_000 + 1_000_000_000
        positions = np.outer(np.arange(count) * 0.1, [1.0, 0.0, 0.0])
        values = {
            "times_ns": times_ns,
            "positions": positions,
            "quats_wxyz": np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        }
        return RecordedTrajectory(**{**values, **fields})

    return make
