# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a filter takes the place of the smoother, and for how long."""

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("gtsam")

from tests.flights import hover
from tests.unit.viso.companion.msckf.point_world import B_T_C, NOISE, SIGMA, PointWorld, filter_at
from viso.companion.msckf.multi_state import Below
from viso.companion.smoother.estimator import Node, NodeFacts, SmootherEstimator
from viso.companion.world.motion import FlightPath, nadir_survey


class Flight:
    """A flight over points, with a node each 0.2 s, from a velocity that is 0.1 m/s off."""

    def __init__(self, trajectory: FlightPath) -> None:
        self.world = PointWorld(trajectory=trajectory, period_ms=200)
        pose, velocity_w = self.world.start()
        self.estimator = SmootherEstimator(
            filter_at(pose, velocity_w + np.array([0.1, -0.1, 0.0])), NOISE, B_T_C, 2 * SIGMA
        )

    def go(self, nodes: int, plane_from: int | None = None) -> tuple[list[NodeFacts], float]:
        """Fly so many nodes; from one of them on, what is below is known. Return their facts, and the error in m."""
        facts = []
        for moment in self.world.moments(nodes):
            if moment.number > 1:
                self.estimator.propagate(moment.window)
            knows = plane_from is not None and moment.number >= plane_from
            below = Below(float(moment.pose.t[2]), 0.4) if knows else None
            t_ns = moment.window.end_t_ns
            node = Node(moment.number, t_ns, moment.sighting, plane=below, depth_m=20.0)
            facts.append(self.estimator.add_node(node))
            if facts[-1].begins:
                self.estimator.set_keyframe(moment.number)
        return facts, float(np.linalg.norm(self.estimator.state.p - moment.pose.t))


@pytest.mark.slow
def test_body_that_hovers_high_is_held_by_a_filter_and_hardly_drifts() -> None:
    facts, error_m = Flight(hover()).go(60)
    assert all(one.is_filtered for one in facts[5:])
    assert error_m < 1.0


def test_body_that_moves_needs_no_filter() -> None:
    facts, _ = Flight(nadir_survey(8.0, 40.0)).go(6)
    assert not any(one.is_filtered for one in facts)


def test_ground_that_is_no_plane_is_the_filters_for_good() -> None:
    facts, error_m = Flight(nadir_survey(8.0, 40.0)).go(8, plane_from=5)
    assert [one.is_filtered for one in facts] == [False] * 4 + [True] * 4
    assert error_m < 1.0
