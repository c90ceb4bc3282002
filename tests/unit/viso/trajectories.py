# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Short trajectories, and what comes of reading one."""

from collections.abc import Callable
from typing import Any

import numpy as np

from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import TrajectoryError


def outcome_of(read: Callable[[], Trajectory]) -> Trajectory | str:
    """Return what was read, or the text of the one error that reading may end with."""
    try:
        return read()
    except TrajectoryError as error:
        return str(error)


def make_trajectory(count: int = 5, **fields: Any) -> Trajectory:
    """Return a level trajectory at 10 Hz along x at 1 m/s; keywords replace fields."""
    times_ns = np.arange(count) * 100_000_000 + 1_000_000_000
    positions = np.outer(np.arange(count) * 0.1, [1.0, 0.0, 0.0])
    values = {
        "times_ns": times_ns,
        "positions": positions,
        "quats_wxyz": np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
    }
    return Trajectory(**{**values, **fields})
