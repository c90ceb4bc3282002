# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which reader a file gets, and recordings of other programs."""

from pathlib import Path

import numpy as np
import pytest

from tests.places import ROOT
from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import TrajectoryError
from viso.streams.readers import FORMATS, Source, format_of, load_trajectory

DATA = ROOT.parent / "shared" / "data"
FLIGHT = ROOT / "tests" / "data" / "trajectories" / "flight.tum"
TUM_TEXT = "0.5 1 2 3 0 0 0 1\n0.6 1 2 3 0 0 0 1\n"


@pytest.mark.parametrize(
    ("name", "found"), [("a.bag", "ros1"), ("a.BAG", "ros1"), ("a.mcap", "ros2"), ("a.db3", "ros2"), (".", "ros2")]
)
def test_bag_is_told_by_its_name(tmp_path: Path, name: str, found: str) -> None:
    assert format_of(tmp_path / name) == found


def test_text_is_told_by_its_content(tmp_path: Path) -> None:
    path = tmp_path / "flight"
    path.write_text(TUM_TEXT)
    assert format_of(path) == "tum"
    assert len(load_trajectory(Source(path))) == 2


def test_unknown_content_is_one_line_with_the_formats(tmp_path: Path) -> None:
    path = tmp_path / "flight.txt"
    path.write_text("hello\n")
    with pytest.raises(TrajectoryError) as raised:
        load_trajectory(Source(path))
    assert str(raised.value) == f"{path}: none of the formats {', '.join(FORMATS)}"


def test_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="No such file or directory"):
        load_trajectory(Source(tmp_path / "none.txt"))


def test_unknown_format_is_one_line_with_the_formats(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match=f"no format 'x'; there are {', '.join(FORMATS)}"):
        load_trajectory(Source(tmp_path), "x")


@pytest.mark.parametrize("name", [name for name in FORMATS if not name.startswith("ros")])
def test_named_format_wins_over_the_content(tmp_path: Path, name: str) -> None:
    path = tmp_path / "flight.txt"
    path.write_text("hello\n")
    with pytest.raises(TrajectoryError, match="no records"):
        load_trajectory(Source(path, times=path), name)


@pytest.mark.parametrize("name", ["ros1", "ros2"])
def test_bag_may_have_any_ending(tmp_path: Path, name: str) -> None:
    path = tmp_path / "flight.txt"
    path.write_text(TUM_TEXT)
    with pytest.raises(TrajectoryError, match="not a readable bag"):
        load_trajectory(Source(path), name)


def test_flight_of_the_examples_is_whole() -> None:
    trajectory = load_trajectory(Source(FLIGHT))
    assert (len(trajectory), trajectory.duration_s, dict(trajectory.left_out)) == (161, 16.0, {})
    assert trajectory.positions[:, 2].max() == 2.0


@pytest.fixture(scope="module")
def states() -> Trajectory:
    """Return the true states of a recording of EuRoC's."""
    return load_trajectory(Source(DATA / "euroc_v102_imu" / "gt0.csv"))


@pytest.mark.skipif(not DATA.exists(), reason="the recorded data are not there")
def test_ground_truth_of_euroc_is_read_in_both_its_forms(states: Trajectory) -> None:
    clip = load_trajectory(Source(DATA / "euroc_mh01_clip" / "groundtruth.tum"))
    assert (len(clip), len(states)) == (4020, 3340)
    assert clip.left_out == states.left_out == {}


@pytest.mark.skipif(not DATA.exists(), reason="the recorded data are not there")
def test_velocities_from_positions_are_those_of_the_recording(states: Trajectory) -> None:
    difference = states.world_velocities - states.without_velocities().world_velocities
    assert np.sqrt(np.mean(difference**2)) < 0.005
