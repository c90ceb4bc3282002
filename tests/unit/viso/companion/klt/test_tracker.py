# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking: known shifts, what is not found, and what must not be."""

import numpy as np
import pytest

from tests.unit.viso.companion.klt.pictures import HEIGHT, WIDTH, moved, noise, shifted, texture
from viso.companion.klt.grid import FeatureGrid, Points
from viso.companion.klt.tracker import BORDER_PX, KltTracker
from viso.companion.vio.types import Pixels
from viso.geometry.rotation import Array

IMAGE = texture()
BLACK: Pixels = np.zeros_like(IMAGE)


def corners(image: Pixels = IMAGE) -> Points:
    """Return points at least 40 px from the border."""
    found = FeatureGrid(WIDTH, HEIGHT, 150).detect(image, np.zeros((0, 2), np.float32))
    inner = (np.abs(found - [WIDTH / 2, HEIGHT / 2]) < [WIDTH / 2 - 40, HEIGHT / 2 - 40]).all(axis=1)
    return found[inner]


def tracker(width: int = WIDTH, height: int = HEIGHT, fb_threshold_px: float = 0.7) -> KltTracker:
    return KltTracker(width, height, fb_threshold_px)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.4, -0.3), (3.25, -2.5), (-9.0, 7.5)])
def test_known_shift_is_found_to_a_tenth_of_a_pixel(shift: tuple[float, float]) -> None:
    points = corners()
    there, found = tracker().track(IMAGE, shifted(IMAGE, *shift), points, points)
    assert found.mean() > 0.95
    assert np.abs(there - points - shift)[found].max() < 0.1


def test_guess_brings_points_home_from_afar() -> None:
    points, shift = corners(), np.array([31.0, -24.0], np.float32)
    after = shifted(IMAGE, *shift.tolist())
    _, blind = tracker().track(IMAGE, after, points, points)
    there, found = tracker().track(IMAGE, after, points, points + shift + 1.5)
    assert found.mean() > 0.95 > 0.8 > blind.mean()
    assert np.abs(there - points - shift)[found].max() < 0.1


def test_guess_is_left_as_it_was() -> None:
    points = corners()
    guess = points + 1
    before = guess.copy()
    tracker().track(IMAGE, shifted(IMAGE, 2, 0), points, guess)
    assert (guess == before).all()


def test_points_that_come_near_the_border_are_not_found() -> None:
    shift = np.array([-30.0, 0.0], np.float32)
    left = np.array([[x, y] for x in (31.0, 34.5, 40.0, 60.0) for y in (60.0, 120.0, 180.0)], np.float32)
    there, found = tracker().track(IMAGE, shifted(IMAGE, -30, 0), left, left + shift)
    assert not found[left[:, 0] + shift[0] < BORDER_PX].any()
    assert found[left[:, 0] + shift[0] >= BORDER_PX + 3].any()
    assert (there[found][:, 0] >= BORDER_PX).all()


def test_strictness_is_the_threshold(monkeypatch: pytest.MonkeyPatch) -> None:
    # Which would refuse them as well. A test of missing extras may have had the module imported again meanwhile.
    monkeypatch.setitem(KltTracker.track.__globals__, "MIN_CORRELATION", -2.0)
    points, after = corners(), texture(seed=9)
    strict, lax = (tracker(fb_threshold_px=px).track(IMAGE, after, points, points)[1].mean() for px in (0.1, 50.0))
    assert strict < 0.5 * lax


@pytest.mark.parametrize("sigma", [1.0, 3.0, 6.0])
def test_noise_is_not_tracked_however_well_it_fits_the_guess(sigma: float) -> None:
    dark, other = noise(1, sigma), noise(2, sigma)
    points = corners(dark)
    assert len(points) > 40
    _, found = tracker().track(dark, other, points, points)
    assert found.mean() < 0.05


def test_points_vanish_when_the_lens_is_covered() -> None:
    points = corners()
    for dark in (BLACK, noise()):
        assert not tracker().track(IMAGE, dark, points, points)[1].any()


@pytest.mark.parametrize(("gain", "offset"), [(0.7, 0), (1.2, 5)])
def test_points_are_found_when_the_exposure_changes_a_little(gain: float, offset: float) -> None:
    points = corners()
    after = np.clip(shifted(IMAGE, 0.6, 0.8) * gain + offset, 0, 255).astype(np.uint8)
    there, found = tracker().track(IMAGE, after, points, points)
    assert found.mean() > 0.7
    assert np.median(np.abs(there - points - [0.6, 0.8])[found]) < 0.3


@pytest.mark.parametrize(("gain", "offset"), [(0.5, 0), (1.6, 0), (0.7, 50)])
def test_points_are_where_they_are_when_the_exposure_jumps(gain: float, offset: float) -> None:
    points = corners()
    faint = IMAGE // 2
    after = np.clip(shifted(faint, 3.6, 2.8) * gain + offset, 0, 255).astype(np.uint8)
    there, found = tracker().track(faint, after, points, points)
    same_there, same = tracker().track(faint, shifted(faint, 3.6, 2.8), points, points)
    assert found.mean() > 0.9 * same.mean()
    assert np.median(np.abs(there - same_there)[found & same]) < 0.05


def test_one_thing_that_moves_differently_is_where_it_is() -> None:
    after = shifted(IMAGE, 2, 0)
    after[80:160, 100:220] = shifted(IMAGE, -3, 4)[80:160, 100:220]
    points = corners()
    there, found = tracker().track(IMAGE, after, points, points)
    inner = (points > [120, 100]).all(axis=1) & (points < [200, 140]).all(axis=1)
    assert np.abs(there - points - [-3, 4])[found & inner].max() < 0.2


def test_zoom_is_followed() -> None:
    middle = np.array([WIDTH / 2, HEIGHT / 2])
    zoom = np.array([[1.05, 0, -0.05 * middle[0]], [0, 1.05, -0.05 * middle[1]], [0, 0, 1]])
    points = corners()
    there, found = tracker().track(IMAGE, moved(IMAGE, zoom), points, points)
    assert found.mean() > 0.9
    assert np.abs(there - (middle + 1.05 * (points - middle)))[found].max() < 0.3


def mapped(points: Points, matrix: Array) -> Points:
    there: Points = (points @ matrix[:2, :2].T + matrix[:2, 2]).astype(np.float32)
    return there


def about_the_middle(turn_rad: float, zoom: float = 1.0) -> Array:
    """Return a map [3, 3] of pixels that turns and zooms a picture."""
    linear = zoom * np.array([[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]])
    middle = np.array([WIDTH / 2, HEIGHT / 2])
    return np.vstack([np.column_stack([linear, middle - linear @ middle + [2.0, -3.0]]), [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(("turn_rad", "zoom"), [(0.3, 1.0), (-1.0, 1.0), (3.0, 1.0), (0.0, 1.3), (0.2, 0.8)])
def test_points_that_turn_as_expected_are_where_they_are(turn_rad: float, zoom: float) -> None:
    motion = about_the_middle(turn_rad, zoom)
    inner = corners()[np.hypot(*(corners() - [WIDTH / 2, HEIGHT / 2]).T) < 80]
    truth = mapped(inner, motion)
    there, found = tracker().track(IMAGE, moved(IMAGE, motion), inner, truth + np.float32(1.5))
    assert found.mean() > 0.95
    assert np.abs(there - truth)[found].max() < 0.15


def test_points_that_turn_out_of_the_picture_are_not_found() -> None:
    motion = about_the_middle(0.5 * np.pi)
    points = FeatureGrid(WIDTH, HEIGHT, 150).detect(IMAGE, np.zeros((0, 2), np.float32))
    truth = mapped(points, motion)
    _, found = tracker().track(IMAGE, moved(IMAGE, motion), points, truth)
    inside = ((truth >= BORDER_PX) & (truth < np.array([WIDTH, HEIGHT]) - BORDER_PX)).all(axis=1)
    assert 0.4 < inside.mean() < 0.9
    assert not found[~inside].any()
    assert found[inside].mean() > 0.95


@pytest.mark.parametrize("guess", ["mirrored", "one line", "one place", "far apart"])
def test_expectation_that_no_camera_has_is_no_trouble(guess: str) -> None:
    points = corners()
    guesses: dict[str, Array] = {
        "mirrored": points * [-1, 1] + [WIDTH, 0],
        "one line": points * [1, 0] + [0, 100],
        "one place": np.full(points.shape, 100.0),
        "far apart": 5.0 * points.astype(np.float64),
    }
    there, _ = tracker().track(IMAGE, IMAGE, points, guesses[guess].astype(np.float32))
    assert np.isfinite(there).all()


def test_wide_pictures_get_another_level() -> None:
    """So that motion is found that is as large beside the picture."""
    wide = texture(3, 800, 480, blur_px=6.0)
    points = np.array([[x, 240] for x in range(150, 500, 10)], np.float32)
    after = shifted(wide, 60, 0)
    shares = [
        KltTracker(width, 480, 0.7).track(wide[:, :width].copy(), after[:, :width].copy(), points, points)[1].mean()
        for width in (800, 600)
    ]
    assert shares[0] > 0.9
    assert shares[1] < 0.3


def test_no_points_are_no_trouble() -> None:
    there, found = tracker().track(IMAGE, IMAGE, np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32))
    assert (there.shape, found.shape) == ((0, 2), (0,))
