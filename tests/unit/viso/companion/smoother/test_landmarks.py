# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When tracked points become landmarks, where, and for how long they are."""

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("gtsam")

from tests.unit.viso.companion.smoother.scene import B_T_C, SIGMA, WALL, sight, sighting_of
from viso.companion.smoother.lag_smoother import LandmarkSighting
from viso.companion.smoother.landmarks import (
    FEWEST_LEFT,
    FEWEST_SIGHTINGS,
    MOST_LANDMARKS,
    MOST_SIGHTINGS,
    LandmarkBook,
    NewLandmark,
)
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

STEP_M = 0.3
AHEAD = WALL[(np.abs(WALL[:, 1:]) < 2).all(axis=1)][:40]  # seen all the way


def pose_of(number: int, step_m: float = STEP_M) -> SE3:
    """Return the pose at a node of a walk to the left."""
    return SE3(np.eye(3), np.array([0.0, number * step_m, 0.0]))


class Walk:
    """A book and the poses that its nodes were taken from."""

    def __init__(self, points: Array = AHEAD) -> None:
        self.book = LandmarkBook(B_T_C, SIGMA)
        self.points = points
        self.poses: dict[int, SE3] = {}
        self.seen: list[LandmarkSighting] = []
        self.new: list[NewLandmark] = []

    def go(self, nodes: int, step_m: float = STEP_M) -> None:
        """Take in nodes."""
        for _ in range(nodes):
            number = len(self.poses)
            self.poses[number] = pose_of(number, step_m)
            self.seen = self.book.note(number, sight(self.poses[number], number, self.points))
            self.new = self.book.discover(self.poses)

    def landmarks(self) -> set[int]:
        """Return what was told last."""
        return {one.landmark for one in self.new}


def test_point_seen_twice_is_no_landmark() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS - 1)
    assert walk.new == []


def test_point_seen_often_enough_is_one_with_all_its_sightings() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS)
    assert len(walk.new) == walk.book.count == len(AHEAD)
    for one in walk.new:
        assert [seen.number for seen in one.sightings] == list(range(FEWEST_SIGHTINGS))
        assert {seen.landmark for seen in one.sightings} == {one.landmark}


def test_landmark_is_where_its_point_is() -> None:
    walk = Walk(AHEAD[:1])
    walk.go(FEWEST_SIGHTINGS)
    assert np.allclose(walk.new[0].position, AHEAD[0], atol=0.5)


def test_sightings_of_landmarks_are_told() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS)
    landmarks = walk.landmarks()
    walk.go(1)
    assert {seen.landmark for seen in walk.seen} == landmarks
    assert {seen.number for seen in walk.seen} == {FEWEST_SIGHTINGS}


def test_without_parallax_there_is_no_landmark() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS + 2, step_m=0.01)
    assert walk.book.count == 0


def test_sightings_from_forgotten_nodes_do_not_count() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS - 1)
    last = FEWEST_SIGHTINGS - 1
    walk.book.note(last, sight(pose_of(last), points=AHEAD))
    assert walk.book.discover({1: pose_of(1), last: pose_of(last)}) == []


def test_point_that_does_not_fit_is_no_landmark() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS - 1)
    last = FEWEST_SIGHTINGS - 1
    walk.poses[last] = pose_of(last)
    there = sight(pose_of(last), points=AHEAD)
    walk.book.note(last, sighting_of(there.ids, there.normalised + np.array([0.0, 0.1])))
    assert walk.book.discover(walk.poses) == []


def test_there_are_no_more_landmarks_than_allowed() -> None:
    walk = Walk(WALL)
    walk.go(FEWEST_SIGHTINGS)
    assert walk.book.count == len(walk.new) == MOST_LANDMARKS
    walk.go(1)
    assert walk.book.count <= MOST_LANDMARKS


def test_lost_point_is_no_landmark_any_more() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS)
    nothing = sighting_of(np.zeros(0, np.int64), np.zeros((0, 2)))
    assert walk.book.note(9, nothing) == []
    assert walk.book.count == 0


def test_old_landmarks_become_others_from_other_sightings() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS)
    first = walk.landmarks()
    walk.go(MOST_SIGHTINGS - FEWEST_SIGHTINGS)
    given_up = len(AHEAD) - walk.book.count
    assert given_up > 0
    walk.go(FEWEST_SIGHTINGS)
    assert len(walk.new) == given_up
    assert not first & walk.landmarks()
    for one in walk.new:
        assert [seen.number for seen in one.sightings] == [MOST_SIGHTINGS + i for i in range(FEWEST_SIGHTINGS)]


def test_not_all_old_landmarks_are_given_up_at_once() -> None:
    walk = Walk()
    walk.go(MOST_SIGHTINGS)
    assert walk.book.count == FEWEST_LEFT


def test_no_landmark_is_given_up_when_the_body_has_stopped() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS)
    here = pose_of(FEWEST_SIGHTINGS - 1)
    for number in range(FEWEST_SIGHTINGS, 3 * MOST_SIGHTINGS):
        walk.poses[number] = here
        seen = walk.book.note(number, sight(here, number, AHEAD))
        assert walk.book.discover(walk.poses) == []
    assert len(seen) == len(AHEAD)


def test_no_landmark_is_given_up_when_other_nodes_are_forgotten() -> None:
    walk = Walk()
    walk.go(MOST_SIGHTINGS - 1)
    last = MOST_SIGHTINGS - 1
    walk.book.note(last, sight(pose_of(last), points=AHEAD))
    assert walk.book.discover({last: pose_of(last)}) == []
    assert walk.book.count == len(AHEAD)


def test_dropped_landmark_may_become_another() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS)
    walk.book.drop(walk.landmarks())
    assert walk.book.count == 0
    walk.go(FEWEST_SIGHTINGS)
    assert walk.book.count == len(AHEAD)


def test_forgetting_forgets_all() -> None:
    walk = Walk()
    walk.go(FEWEST_SIGHTINGS)
    walk.book.forget()
    assert walk.book.count == 0
    walk.go(FEWEST_SIGHTINGS - 1)
    assert walk.new == []
