# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is remembered of an odometry, and what comes out of it."""

import numpy as np
import pytest

from tests.unit.viso.vio_results import SECOND_NS, Flight, flown
from viso.companion.run.log import VioLog, tum_lines
from viso.companion.vio.config import AglSource, VioConfig
from viso.companion.vio.types import VioState
from viso.geometry.trajectory import Trajectory


def test_poses_are_those_of_the_outputs() -> None:
    log = flown(Flight().init().fly(3).lose())
    assert [frame.state.value for frame in log.frames] == ["INIT", "TRACKING", "TRACKING", "TRACKING", "LOST"]
    trajectory = log.trajectory()
    assert trajectory.times_ns.tolist() == [SECOND_NS, 2 * SECOND_NS, 3 * SECOND_NS]
    np.testing.assert_allclose(trajectory.positions, [[1, 0, 2], [2, 0, 2], [3, 0, 2]])


def test_shift_is_taken_off_the_stamps() -> None:
    log = VioLog(VioConfig())
    log.shift_ns = 5
    for result in Flight().init().results:
        log.take(result)
    assert log.frames[0].t_ns == -5


def test_sigma_grows_with_the_keyframes() -> None:
    sigmas = [frame.sigma_m for frame in flown(Flight().init().fly(3)).frames]
    assert sigmas[0] is None
    assert sigmas[1:] == pytest.approx([0.1, 0.1 * np.sqrt(2), 0.1 * np.sqrt(3)], rel=1e-3)


def test_scale_counts_where_a_height_gives_it() -> None:
    with_height = flown(Flight().init().fly(10), VioConfig(agl_source=AglSource.RANGEFINDER, agl_scale_sigma=0.5))
    without = flown(Flight().init().fly(10))
    assert with_height.frames[-1].sigma_m is not None
    assert without.frames[-1].sigma_m is not None
    assert with_height.frames[-1].sigma_m > 5 * without.frames[-1].sigma_m


def test_summary_tells_how_it_went() -> None:
    told = flown(Flight().init().fly(5).lose()).summary(None)
    assert told["frames"] == 7
    assert told["seconds"] == 6.0
    assert told["states"] == {"INIT": 1, "TRACKING": 5, "LOST": 1}
    assert (told["ended"], told["reason"]) == ("LOST", "too_few_inliers")
    assert (told["poses"], told["path_m"]) == (5, pytest.approx(4.0))
    assert (told["ms_median"], told["ms_95"]) == (20.0, 20.0)
    assert (told["dropped"], told["resets"], told["tracked_median"]) == (2, 1, 100)
    assert (told["ate_m"], told["true_path_m"], told["scale_error"]) == (None, None, None)


def test_summary_of_nothing_is_one() -> None:
    told = VioLog(VioConfig()).summary(None)
    assert (told["frames"], told["ended"], told["path_m"], told["ms_median"]) == (0, None, 0.0, None)


def truth(scale: float = 1.0) -> Trajectory:
    times = np.arange(8) * SECOND_NS
    positions = np.column_stack([np.arange(8) * scale, np.full(8, 5.0), np.zeros(8)])
    return Trajectory(times, positions, np.tile([1.0, 0, 0, 0], (8, 1)))


def test_error_is_what_is_left_after_alignment() -> None:
    told = flown(Flight().init().fly(5)).summary(truth())
    assert told["ate_m"] == pytest.approx(0.0, abs=1e-9)
    assert told["scale_error"] == pytest.approx(0.0, abs=1e-9)


def test_scale_error_is_that_of_the_estimate() -> None:
    told = flown(Flight().init().fly(5)).summary(truth(scale=0.5))
    assert told["scale_error"] == pytest.approx(1.0)
    assert told["true_path_m"] == pytest.approx(2.0)


def test_error_is_unknown_where_the_truth_is() -> None:
    log = flown(Flight().init().fly(5))
    late = Trajectory(truth().times_ns + 100 * SECOND_NS, truth().positions, truth().quats_wxyz)
    assert log.error(late) is None
    assert log.error(None) is None


def test_lines_hold_time_position_and_attitude() -> None:
    poses = Trajectory(
        np.array([-15_000_000, 1_403_636_580_838_555_648]),
        np.array([[1.5, -2, 0.25]] * 2),
        np.array([[0.6, 0.8, 0.0, 0.0]] * 2),
    )
    assert tum_lines(poses) == [
        "-0.015000000 1.5 -2 0.25 0.8 0 0 0.6",
        "1403636580.838555648 1.5 -2 0.25 0.8 0 0 0.6",
    ]


def test_last_frame_is_known() -> None:
    log = VioLog(VioConfig())
    assert log.last is None
    log = flown(Flight().init())
    assert log.last is not None
    assert (log.last.state, log.last.pose, log.last.total_ms) == (VioState.INIT, None, 20.0)
