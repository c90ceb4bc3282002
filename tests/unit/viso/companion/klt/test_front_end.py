# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The front end: names that stay, points that come and go, and what it says about them."""

from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.klt.pictures import (
    FOCAL,
    HEIGHT,
    WIDTH,
    calibration,
    noise,
    shifted,
    texture,
    turned,
    zoomed_out,
)
from viso.companion.klt.front_end import FrontEnd, Sighting, common_points
from viso.companion.klt.grid import FeatureGrid
from viso.companion.klt.outliers import Model
from viso.companion.vio.config import Scene, VioConfig
from viso.companion.vio.health import MIN_COVERAGE
from viso.companion.vio.types import DistortionModel, Pixels
from viso.companion.vio.undistortion import undistort
from viso.geometry.rotation import so3_exp

MOST = 100
IMAGE = texture()
STILL = np.eye(3)
DARK: Pixels = np.zeros_like(IMAGE)


def front_end(**changed: Any) -> FrontEnd:
    return FrontEnd(calibration(**changed), VioConfig(max_features=MOST, scene=Scene.PLANAR))


def seen(*images: Pixels) -> list[Sighting]:
    """Return what a camera that does not turn sees in pictures, one after the other."""
    front = front_end()
    return [front.track(image, STILL) for image in images]


def test_first_picture_has_new_points_only() -> None:
    (first,) = seen(IMAGE)
    assert (first.tracked, first.lost, first.inliers, first.model, first.coverage) == (0, 0, 0, None, 0.0)
    assert first.new == len(first.ids) == MOST


def test_names_stay_with_their_points() -> None:
    shift = np.array([4.0, -3.0])
    first, second = seen(IMAGE, shifted(IMAGE, *shift.tolist()))
    then, now = common_points(first, second)
    assert len(then) > 0.8 * MOST
    assert np.median(np.abs((now - then) * FOCAL - shift)) < 0.1
    assert np.abs((now - then) * FOCAL - shift).max() < 1.5


def test_points_are_found_again_over_many_pictures() -> None:
    first, *_, last = seen(*(shifted(IMAGE, 1.5 * step, step) for step in range(9)))
    then, now = common_points(first, last)
    assert len(then) > 0.6 * MOST
    assert np.abs((now - then) * FOCAL - [12, 8]).max() < 1.0


def test_names_are_never_used_again() -> None:
    first, _, third = seen(IMAGE, DARK, IMAGE)
    assert max(first.ids) < min(third.ids)


def test_arrays_belong_together() -> None:
    for sighting in seen(IMAGE, shifted(IMAGE, 20, 10), shifted(IMAGE, 40, 20)):
        assert sighting.normalised.shape == (len(sighting.ids), 2)
        assert len(set(sighting.ids.tolist())) == len(sighting.ids)
        assert np.isfinite(sighting.normalised).all()


def test_numbers_add_up() -> None:
    first, second = seen(IMAGE, shifted(IMAGE, 30, 0))
    assert second.tracked + second.lost == len(first.ids)
    assert second.inliers <= second.tracked
    assert len(second.ids) == second.inliers + second.new


def test_points_are_not_replenished_while_there_are_enough() -> None:
    _, second = seen(IMAGE, shifted(IMAGE, 2, 1))
    assert second.inliers >= 0.85 * MOST
    assert second.new == 0


def test_points_are_replenished_when_there_are_too_few() -> None:
    _, second = seen(IMAGE, shifted(IMAGE, 70, 0))
    assert second.inliers < 0.85 * MOST
    assert second.new > 0
    assert len(second.ids) > 0.9 * MOST


@pytest.mark.parametrize("other", [DARK, noise()])
def test_all_is_lost_when_the_lens_is_covered(other: Pixels) -> None:
    _, second = seen(IMAGE, other)
    assert second.inliers < 8
    assert second.lost > 0.9 * MOST
    assert second.coverage < 0.2


def test_covered_lens_shows_nothing_for_as_long_as_it_is_covered() -> None:
    for sighting in seen(IMAGE, noise(1), noise(2), noise(3))[1:]:
        assert sighting.inliers < 8


def test_points_come_back_after_a_picture_of_nothing() -> None:
    _, dark, light, after = seen(IMAGE, DARK, IMAGE, shifted(IMAGE, 3, 0))
    assert (dark.inliers, dark.new, dark.model) == (0, 0, None)
    assert (light.inliers, light.new) == (0, MOST)
    assert after.inliers > 0.8 * MOST


def test_forgetting_begins_anew() -> None:
    front = front_end()
    front.track(IMAGE, STILL)
    front.forget()
    again = front.track(shifted(IMAGE, 3, 0), STILL)
    assert (again.tracked, again.lost, again.new) == (0, 0, MOST)


def test_turn_is_taken_out_of_the_disparity() -> None:
    turn = so3_exp(np.array([0.01, -0.02, 0.1]))
    front = front_end()
    front.track(IMAGE, STILL)
    second = front.track(turned(IMAGE, turn), turn)
    assert second.model is Model.ROTATION
    assert second.disparity_px < 0.5
    assert second.inliers > 0.6 * MOST


def test_turn_is_where_points_are_expected() -> None:
    """A turn by 40 px is too much for a search that begins where points were."""
    turn = so3_exp(np.array([0.0, 0.16, 0.0]))
    told, untold = front_end(), front_end()
    for front in (told, untold):
        front.track(IMAGE, STILL)
    after = turned(IMAGE, turn)
    assert told.track(after, turn).inliers > 0.5 * MOST > 2 * untold.track(after, STILL).inliers


def test_prior_beats_the_rotation_as_the_place_to_look() -> None:
    prior = np.eye(3)
    prior[:2, 2] = 40 / FOCAL, -30 / FOCAL
    front = front_end()
    front.track(IMAGE, STILL)
    second = front.track(shifted(IMAGE, 40, -30), STILL, prior)
    assert second.inliers > 0.5 * MOST
    assert second.disparity_px == pytest.approx(50, abs=0.5)


def test_prior_that_puts_points_behind_the_camera_is_passed_over() -> None:
    front = front_end()
    front.track(IMAGE, STILL)
    assert front.track(IMAGE, STILL, -np.eye(3)).inliers > 0.8 * MOST


def test_points_that_move_otherwise_are_given_up() -> None:
    after = shifted(IMAGE, 5, 0)
    after[90:150, 120:200] = shifted(IMAGE, -6, 5)[90:150, 120:200]
    first, second = seen(IMAGE, after)
    assert second.tracked > second.inliers
    then, now = common_points(first, second)
    assert np.abs((now - then) * FOCAL - [5, 0]).max() < 1.5


def test_normalised_coordinates_are_without_the_distortion() -> None:
    lens: dict[str, Any] = {"distortion_model": DistortionModel.RADTAN, "distortion": np.array([-0.2, 0.05, 0.0, 0.0])}
    bent, straight = front_end(**lens).track(IMAGE, STILL), front_end().track(IMAGE, STILL)
    pixels = straight.normalised @ np.diag([FOCAL, FOCAL]) + [0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1)]
    assert np.allclose(bent.normalised, undistort(calibration(**lens), pixels))


def test_points_that_the_lens_model_does_not_reach_are_left_out() -> None:
    lens: dict[str, Any] = {"distortion_model": DistortionModel.RADTAN, "distortion": np.array([-1.2, 0.0, 0.0, 0.0])}
    front = front_end(**lens)
    for image in (IMAGE, shifted(IMAGE, 3, 2), shifted(IMAGE, 6, 4)):
        sighting = front.track(image, STILL)
        assert np.isfinite(sighting.normalised).all()
    assert 0 < len(sighting.ids) < MOST
    assert sighting.inliers > 8


def coverages_while_receding() -> list[float]:
    """Return the coverage in pictures of ground that shrinks to less than a quarter, all but the first."""
    front, large = front_end(), texture(4, 4 * WIDTH, 4 * HEIGHT)
    return [front.track(zoomed_out(large, 0.94**step), STILL).coverage for step in range(25)][1:]


@pytest.mark.slow
def test_points_do_not_all_flow_together_when_the_camera_recedes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert min(coverages_while_receding()) > MIN_COVERAGE
    monkeypatch.setattr(FeatureGrid, "uncrowded", lambda self, pixels: np.ones(len(pixels), np.bool_))
    assert coverages_while_receding()[-1] < 0.5 * MIN_COVERAGE


def test_focal_length_is_the_mean_of_both() -> None:
    assert front_end(fx=240.0, fy=260.0).focal_px == 250.0
