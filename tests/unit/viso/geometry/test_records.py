# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is left out of a recording, and that it is counted."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.geometry import records
from viso.geometry.records import LARGEST, Records, TrajectoryError, usable
from viso.geometry.trajectory import RecordedTrajectory

COUNT = 4
NAN = float("nan")


def make(**changes: Any) -> RecordedTrajectory:
    """Make a trajectory of four good records, but for the changes: field and record to value."""
    values: dict[str, Any] = {
        "times_ns": np.arange(COUNT),
        "positions": np.outer(np.arange(COUNT), [1.0, 1.0, 1.0]),
        "quats_wxyz": np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)),
    }
    return usable(Records("flight.tum", **{**values, **changes}))


def rows(row: int, value: list[float], other: list[float]) -> list[list[float]]:
    return [value if number == row else other for number in range(COUNT)]


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("positions", rows(1, [0, NAN, 0], [1, 2, 3]), records.NOT_FINITE),
        ("positions", rows(1, [0, float("inf"), 0], [1, 2, 3]), records.NOT_FINITE),
        ("positions", rows(1, [0, 0, 2 * LARGEST], [1, 2, 3]), records.OUT_OF_RANGE),
        ("quats_wxyz", rows(1, [0, 0, 0, 0], [0, 1, 0, 0]), records.NO_ROTATION),
        ("quats_wxyz", rows(1, [1e300, 1e300, 0, 0], [0, 1, 0, 0]), records.NO_ROTATION),
        ("quats_wxyz", rows(1, [1, 1, 0, 0], [0, 1, 0, 0]), records.NO_ROTATION),
        ("velocities", rows(1, [0, NAN, 0], [1, 2, 3]), records.NOT_FINITE),
        ("times_ns", [0, 0, 1, 2], records.NOT_LATER),
        ("times_ns", [5, 3, 6, 7], records.NOT_LATER),
        ("times_ns", [0, 10**18, 10**18 + 1, 10**18 + 2], records.FAR_OFF),
        ("times_ns", [0, 10**18, 1, 2], records.FAR_OFF),
    ],
)
def test_record_that_cannot_be_used_is_counted(field: str, value: Any, reason: str) -> None:
    trajectory = make(**{field: value})
    assert len(trajectory) == COUNT - 1
    assert trajectory.left_out == {reason: 1}


def test_positions_of_utm_can_be_used_from_anywhere() -> None:
    """About 430 km east and 5400 km north; one of them is damaged."""
    utm = np.array([430_000.0, 5_400_000.0, 300.0]) + np.arange(COUNT)[:, None]
    utm[2] = [1e30, 0, 0]
    told = Records("utm.tum", np.arange(COUNT).tolist(), utm, np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)))
    with pytest.raises(TrajectoryError, match=records.OUT_OF_RANGE):
        usable(told)
    trajectory = usable(told, from_anywhere=True)
    assert trajectory.positions.tolist() == utm[[0, 1, 3]].tolist()
    assert trajectory.left_out == {records.OUT_OF_RANGE: 1}


def test_record_left_out_for_another_reason_sets_no_time() -> None:
    trajectory = make(times_ns=[0, 99, 1, 2], positions=rows(1, [NAN, 0, 0], [1, 2, 3]))
    assert trajectory.times_ns.tolist() == [0, 1, 2]


def test_too_few_usable_records_are_one_line_with_the_reasons() -> None:
    with pytest.raises(TrajectoryError) as raised:
        make(times_ns=[3, 2, 1, 0])
    line = "flight.tum: 1 usable records, and a trajectory needs 2; 3 with a time not after the one before"
    assert str(raised.value) == line


@pytest.mark.parametrize("nothing", [0.0, NAN])
def test_velocities_that_say_nothing_are_unknown(nothing: float) -> None:
    assert make(velocities=np.full((COUNT, 3), nothing)).velocities is None


def test_sound_covariance_is_kept_and_zeros_are_unknown() -> None:
    trajectory = make(covariances=[np.eye(6), np.zeros((6, 6)), np.eye(6), np.eye(6)])
    assert trajectory.pose(0).covariance is not None
    assert trajectory.pose(1).covariance is None
    assert trajectory.left_out == {}


@pytest.mark.parametrize("bad", [-np.eye(6), np.full((6, 6), np.inf), np.triu(np.ones((6, 6))), np.eye(6) * 1e300])
def test_covariance_that_is_none_is_counted_and_its_pose_kept(bad: Any) -> None:
    trajectory = make(covariances=[np.eye(6), bad, np.eye(6), np.eye(6)])
    assert len(trajectory) == COUNT
    assert trajectory.pose(1).covariance is None
    assert trajectory.left_out == {records.BAD_COVARIANCE: 1}


def test_covariances_that_are_all_unknown_are_none() -> None:
    assert make(covariances=np.zeros((COUNT, 6, 6))).covariances is None


def test_error_is_one_line() -> None:
    assert str(TrajectoryError("a\nb  c\r\n")) == "a b c"


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(0, 50), st.lists(st.floats(width=32), min_size=10, max_size=10)), max_size=8))
def test_every_record_is_kept_or_counted(given_records: list[tuple[int, list[float]]]) -> None:
    table = np.array([numbers for _, numbers in given_records]).reshape(-1, 10)
    try:
        times_ns = [time for time, _ in given_records]
        trajectory = usable(Records("x", times_ns, table[:, :3], table[:, 3:7], table[:, 7:]))
    except TrajectoryError:
        return
    assert len(trajectory) + sum(trajectory.left_out.values()) == len(given_records)
