# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of an odometry's flight."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.unit.viso.vio_results import SECOND_NS, Flight, flown
from viso.companion.run.log import VioLog
from viso.companion.run.plot import save_plot
from viso.companion.vio.config import VioConfig
from viso.companion.vio.types import VioState
from viso.errors import InputError
from viso.geometry.trajectory import Trajectory

MIXED = Flight().init().fly(4).fly(3, VioState.DEGRADED).fly(2).lose()


def truth() -> Trajectory:
    """Return the path of the flight, turned by 90 degrees and shifted."""
    count = 30
    times = (np.arange(count) - 10) * SECOND_NS
    positions = np.column_stack([np.full(count, 5.0), np.arange(count) - 10.0, np.full(count, 1.0)])
    return Trajectory(times, positions, np.tile([1.0, 0, 0, 0], (count, 1)))


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Return the list that every figure goes to instead of being written."""
    saved: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_args, **_kwargs: saved.append(figure))
    return saved


def lines(figure: Figure, panel: int) -> list[Any]:
    """Return the points [2, N] of the lines of a panel: 0 to 3 are on the right, 4 is the plan."""
    return [np.array(line.get_data()) for line in figure.axes[panel].get_lines()]


@pytest.mark.slow
def test_picture_is_written(tmp_path: Path) -> None:
    path = tmp_path / "flight.png"
    save_plot(flown(MIXED), truth(), "a flight", path, aligned=True)
    picture = cv2.imread(str(path))
    assert picture is not None
    assert picture.shape == (880, 1430, 3)
    assert picture.std() > 10


@pytest.mark.slow
def test_picture_of_nothing_is_written(tmp_path: Path) -> None:
    save_plot(VioLog(VioConfig()), None, "nothing", tmp_path / "none.png", aligned=False)
    assert (tmp_path / "none.png").stat().st_size > 0


def test_truth_is_that_of_the_flight(tmp_path: Path, figures: list[Figure]) -> None:
    save_plot(flown(MIXED), truth(), "a flight", tmp_path / "flight.png", aligned=False)
    true_path, path = lines(figures[0], 4)[:2]
    assert true_path[1].tolist() == [float(second) for second in range(11)]
    assert path[0].tolist() == [float(metre) for metre in range(1, 10)]


def test_estimate_is_laid_onto_a_truth_in_another_world(tmp_path: Path, figures: list[Figure]) -> None:
    save_plot(flown(MIXED), truth(), "a flight", tmp_path / "flight.png", aligned=True)
    path = lines(figures[0], 4)[1]
    np.testing.assert_allclose(path.T, [[5.0, metre] for metre in range(1, 10)], atol=1e-9)
    height = lines(figures[0], 0)[1]
    np.testing.assert_allclose(height[1], 1.0)


def test_states_are_shaded_and_named(tmp_path: Path, figures: list[Figure]) -> None:
    save_plot(flown(MIXED), None, "a flight", tmp_path / "flight.png", aligned=False)
    spans = [patch.get_x() for patch in figures[0].axes[0].patches]  # type: ignore[attr-defined]
    assert spans == [0.0, 5.0, 10.0]
    labels = [text.get_text() for text in figures[0].legends[0].get_texts()]
    assert labels == ["estimate", "features that agree", "INIT", "DEGRADED", "LOST"]


def test_features_have_gaps_where_there_is_no_output(tmp_path: Path, figures: list[Figure]) -> None:
    save_plot(flown(MIXED), None, "a flight", tmp_path / "flight.png", aligned=False)
    tracked, inliers = lines(figures[0], 2)
    assert np.isnan(tracked[1]).tolist() == [True, *[False] * 9, True]
    assert inliers[1][1] == 90


@pytest.mark.slow
def test_place_that_cannot_be_written_to_raises(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        save_plot(flown(MIXED), None, "a flight", tmp_path / "none" / "a.png", aligned=False)
