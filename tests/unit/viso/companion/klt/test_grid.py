# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid: shares, distances, coverage, and where points crowd."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.companion.klt.pictures import texture
from viso.companion.klt.grid import COLUMNS, MIN_DISTANCE_PX, ROWS, FeatureGrid, Points

WIDTH, HEIGHT = 640, 480
CELL_PX = 80
MOST = 180
SHARE = 4  # the next whole number above 180 / 48
IMAGE = texture(1, WIDTH, HEIGHT, blur_px=3.0)
NONE: Points = np.zeros((0, 2), np.float32)


def grid(max_features: int = MOST) -> FeatureGrid:
    return FeatureGrid(WIDTH, HEIGHT, max_features)


def in_cell(row: int, column: int, count: int) -> Points:
    """Return points in a cell, 14 px apart, in rows of five."""
    index = np.arange(count)
    x, y = CELL_PX * column + 10 + 14 * (index % 5), CELL_PX * row + 10 + 14 * (index // 5)
    return np.stack([x, y], axis=1).astype(np.float32)


def counts(pixels: Points) -> list[int]:
    result = [0] * (ROWS * COLUMNS)
    for x, y in pixels.tolist():
        result[int(y // CELL_PX) * COLUMNS + int(x // CELL_PX)] += 1
    return result


def distances(one: Points, other: Points) -> Points:
    return np.asarray(np.linalg.norm(one[:, None] - other[None], axis=2), np.float32)


def test_no_points_cover_nothing() -> None:
    assert grid().coverage(NONE) == 0


def test_coverage_is_the_share_of_cells_with_a_point() -> None:
    points = np.concatenate([in_cell(0, 0, 5), in_cell(3, 7, 1), in_cell(5, 2, 2)])
    assert grid().coverage(points) == pytest.approx(3 / 48)


@pytest.mark.parametrize("point", [(0, 0), (WIDTH - 1, HEIGHT - 1), (WIDTH, HEIGHT), (-3, -3)])
def test_points_on_the_border_and_beyond_count_in_the_outer_cells(point: tuple[float, float]) -> None:
    assert grid().coverage(np.array([point], np.float32)) == pytest.approx(1 / 48)


def test_texture_fills_all_cells_up_to_the_most_features() -> None:
    found = grid().detect(IMAGE, NONE)
    assert len(found) == MOST
    assert max(counts(found)) == SHARE
    assert grid().coverage(found) == 1.0


def test_new_points_keep_their_distance_from_each_other() -> None:
    found = grid(1000).detect(IMAGE, NONE)
    apart = distances(found, found) + np.where(np.eye(len(found)), np.inf, 0)
    assert apart.min() >= MIN_DISTANCE_PX - 1  # discs are drawn about rounded points


def test_new_points_keep_their_distance_from_those_there_are() -> None:
    there = grid().detect(IMAGE, NONE)[::3]
    found = grid().detect(IMAGE, there)
    assert len(found) > 0
    assert distances(found, there).min() >= MIN_DISTANCE_PX - 1


def test_nothing_is_looked_for_in_cells_that_have_their_share() -> None:
    full = in_cell(2, 3, SHARE)
    found = grid().detect(IMAGE, full)
    assert counts(found)[2 * COLUMNS + 3] == 0
    assert len(found) + len(full) == MOST


def test_cell_gets_no_more_than_it_lacks() -> None:
    found = grid().detect(IMAGE, in_cell(2, 3, SHARE - 1))
    assert counts(found)[2 * COLUMNS + 3] <= 1


def test_emptiest_cells_come_first_when_there_is_no_room_for_all() -> None:
    there = np.concatenate([in_cell(row, column, 3) for row in range(ROWS) for column in range(COLUMNS)][1:])
    found = FeatureGrid(WIDTH, HEIGHT, len(there) + 4).detect(IMAGE, there)
    assert counts(found)[0] == len(found) == 4


def test_there_is_no_room_beyond_the_most_features() -> None:
    there = np.concatenate([in_cell(row, column, 5) for row in range(ROWS) for column in range(5)])
    assert len(there) < MOST
    assert len(grid().detect(IMAGE, there)) + len(there) == MOST


def test_nothing_is_found_where_there_is_nothing() -> None:
    assert grid().detect(np.full((HEIGHT, WIDTH), 90, np.uint8), NONE).shape == (0, 2)


def test_points_that_do_not_crowd_all_stay() -> None:
    assert grid().uncrowded(grid().detect(IMAGE, NONE)).all()


def test_first_points_stay_where_points_crowd() -> None:
    crowd, other = in_cell(1, 1, 20), in_cell(4, 4, 2)
    points = np.concatenate([crowd[:10], other, crowd[10:]])
    stays = grid().uncrowded(points)
    assert np.flatnonzero(~stays).tolist() == list(range(14, 22))


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(-20, 660, width=32), st.floats(-20, 500, width=32)), max_size=120))
def test_cells_are_never_crowded_after_thinning(points: list[tuple[float, float]]) -> None:
    pixels = np.array(points, np.float32).reshape(-1, 2)
    kept = pixels[grid(48).uncrowded(pixels)]  # a share of 1
    inside = np.clip(kept, 0, [WIDTH - 1, HEIGHT - 1]).astype(np.float32)
    assert max(counts(inside), default=0) <= 3
    assert grid(48).coverage(kept) == grid(48).coverage(pixels)


def test_no_points_are_no_crowd() -> None:
    assert grid().uncrowded(NONE).shape == (0,)
