# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The smoother in flight: what it finds out, what it refuses, and how it gets over what goes wrong."""

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("gtsam")

from tests.unit.viso.companion.smoother.scene import (
    B_T_C,
    NOISE,
    PERIOD_NS,
    SIGMA,
    pose_at,
    sight,
    sighting_of,
    start,
    still_window,
    velocity_at,
    window,
)
from viso.companion.klt.front_end import Sighting
from viso.companion.smoother.estimator import Node, NodeFacts, SmootherEstimator
from viso.companion.smoother.lag_smoother import LAG_S, LagSmoother, SmootherError
from viso.companion.vio.imu import steps_of
from viso.companion.vio.types import ImuWindow
from viso.geometry.rotation import Array

WRONG_VELOCITY = np.array([0.2, -0.2, 0.2])
NOTHING = sighting_of(np.zeros(0, np.int64), np.zeros((0, 2)))


class Flight:
    """An estimator and the time that passes for it."""

    def __init__(self, velocity_error: Array | None = None) -> None:
        self.estimator = SmootherEstimator(start(velocity_error), NOISE, B_T_C, SIGMA)
        self.number = 0
        self.t_ns = 0
        self.facts = [self.estimator.add_node(Node(0, 0, sight(pose_at(0))))]

    def go(self, nodes: int = 1, sighting: Sighting | None = None, period_ns: int = PERIOD_NS) -> NodeFacts:
        """Fly on; what is seen is what there is to see, unless given. Where the smoother begins is the keyframe."""
        for _ in range(nodes):
            self.estimator.propagate(window(self.t_ns, self.t_ns + period_ns))
            self.number += 1
            self.t_ns += period_ns
            seen = sighting or sight(pose_at(self.t_ns), self.number)
            self.facts.append(self.estimator.add_node(Node(self.number, self.t_ns, seen)))
            if self.facts[-1].begins:
                self.estimator.set_keyframe(self.number)
        return self.facts[-1]

    def place_error_m(self) -> float:
        return float(np.linalg.norm(self.estimator.state.p - pose_at(self.t_ns).t))

    def velocity_error_m_s(self) -> float:
        return float(np.linalg.norm(self.estimator.state.v - velocity_at(self.t_ns)))


def fail(*_: object, **__: object) -> None:
    raise SmootherError("indeterminate")


def test_first_node_begins() -> None:
    flight = Flight()
    assert flight.facts == [NodeFacts(begins=True)]
    assert [clone.number for clone in flight.estimator.state.clones] == [0]


@pytest.mark.slow
def test_wrong_velocity_is_found_out() -> None:
    flight = Flight(WRONG_VELOCITY)
    flight.go(10)
    assert flight.velocity_error_m_s() < 0.05
    assert flight.place_error_m() < 0.05


@pytest.mark.slow
def test_landmarks_are_where_they_were_expected() -> None:
    flight = Flight(WRONG_VELOCITY)
    facts = flight.go(10)
    assert facts.agreeing == facts.landmarks > 15
    assert 0.1 < facts.mre_sigmas < 1.5
    assert 0.1 < flight.estimator.innovation_ratio < 2


@pytest.mark.slow
def test_same_input_same_state() -> None:
    one, other = Flight(WRONG_VELOCITY), Flight(WRONG_VELOCITY)
    one.go(8)
    other.go(8)
    assert one.estimator.state.p.tolist() == other.estimator.state.p.tolist()
    assert one.estimator.state.cov.tolist() == other.estimator.state.cov.tolist()


def test_between_nodes_the_filter_carries_on() -> None:
    flight = Flight()
    flight.go(8)
    state = flight.estimator.state
    flight.estimator.propagate(window(flight.t_ns, flight.t_ns + PERIOD_NS // 2))
    assert np.allclose(state.p, pose_at(flight.t_ns + PERIOD_NS // 2).t, atol=0.05)


@pytest.mark.slow
def test_relative_pose_is_that_to_the_keyframe_and_so_are_its_errors() -> None:
    flight = Flight()
    flight.go(8)
    flight.estimator.set_keyframe(flight.number)
    assert [clone.number for clone in flight.estimator.state.clones] == [0, 8]
    then = pose_at(flight.t_ns)
    flight.go(3)
    assert [clone.number for clone in flight.estimator.state.clones] == [8]
    pose, cov = flight.estimator.state.relative_to(8)
    error = ((then.inverse() @ pose_at(flight.t_ns)).inverse() @ pose).log()
    assert np.abs(error[3:]).max() < 0.03
    assert float(error @ np.linalg.solve(cov, error)) / 6 < 4


@pytest.mark.slow
def test_keyframe_outlives_the_lag() -> None:
    flight = Flight()
    flight.go(round(LAG_S * 1e9 / PERIOD_NS) + 3)
    assert not any(facts.begins for facts in flight.facts[1:])
    pose, _ = flight.estimator.state.relative_to(0)
    assert np.allclose(pose.t, (pose_at(0).inverse() @ pose_at(flight.t_ns)).t, atol=0.3)


@pytest.mark.slow
def test_nodes_further_apart_than_the_lag_are_no_obstacle() -> None:
    flight = Flight()
    flight.go(6)
    assert not flight.go(period_ns=round(1.5 * LAG_S * 1e9)).failed
    assert not flight.go(5).failed
    assert flight.facts[-1].landmarks > 15


@pytest.mark.slow
def test_landmarks_that_are_elsewhere_are_dropped() -> None:
    flight = Flight()
    flight.go(8)
    true = sight(pose_at(flight.t_ns + PERIOD_NS))
    elsewhere = true.normalised + np.random.default_rng(3).uniform(-0.3, 0.3, true.normalised.shape)
    facts = flight.go(sighting=sighting_of(true.ids, elsewhere))
    assert facts.landmarks > 15
    assert facts.agreeing < facts.landmarks / 3
    assert flight.place_error_m() < 0.2


@pytest.mark.slow
def test_body_at_rest_stays_where_it_is() -> None:
    state = start()
    state.v = np.zeros(3)
    place = state.p.copy()
    estimator = SmootherEstimator(state, NOISE, B_T_C, SIGMA)
    for number in range(30):
        t_ns = number * PERIOD_NS
        if number:
            estimator.propagate(still_window(t_ns - PERIOD_NS, t_ns))
        facts = estimator.add_node(Node(number, t_ns, sight(pose_at(0), number), is_still=True))
        assert not facts.failed
    assert np.linalg.norm(state.p - place) < 0.02
    assert np.linalg.norm(state.v) < 0.01
    assert estimator.innovation_ratio == 1.0


def test_height_is_taken_in() -> None:
    flight = Flight()
    state = flight.estimator.state
    flight.go(2)
    flight.estimator.propagate(window(flight.t_ns, flight.t_ns + PERIOD_NS))
    before_m = state.p[2]
    flight.estimator.add_node(
        Node(3, flight.t_ns + PERIOD_NS, sight(pose_at(flight.t_ns + PERIOD_NS)), height=(before_m + 0.05, 0.001))
    )
    assert state.p[2] == pytest.approx(before_m + 0.05, abs=0.02)


def test_unsolvable_node_leaves_the_inertial_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = Flight()
    flight.go(8)
    with monkeypatch.context() as patch:
        patch.setattr(LagSmoother, "solve", fail)
        assert flight.go() == NodeFacts(failed=True)
    assert flight.estimator.state.is_finite()
    assert flight.place_error_m() < 0.1
    _, cov = flight.estimator.state.relative_to(0)
    assert np.linalg.eigvalsh(cov)[0] > 0


@pytest.mark.slow
def test_node_after_an_unsolvable_one_begins_anew_from_there(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = Flight()
    flight.go(8)
    with monkeypatch.context() as patch:
        patch.setattr(LagSmoother, "joint_cov", fail)
        assert flight.go().failed
    assert flight.go().begins
    facts = flight.go(8)
    assert facts.landmarks > 15
    assert flight.place_error_m() < 0.1


def test_gtsam_itself_may_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = Flight()
    flight.go(6)
    nonsense = sighting_of(np.arange(100), np.full((100, 2), np.nan))
    assert flight.go(sighting=nonsense).failed
    assert flight.estimator.state.is_finite()
    assert flight.go().begins


@pytest.mark.parametrize("last_ns", [-1, 30_000_000], ids=["none", "gap"])
def test_missing_inertial_data_make_the_smoother_begin_anew(last_ns: int) -> None:
    flight = Flight()
    flight.go(6)
    state, t_ns = flight.estimator.state, flight.t_ns
    whole = window(t_ns, t_ns + PERIOD_NS)
    kept = [one for one in whole.samples[:-1] if one.t_ns <= t_ns + last_ns]
    samples = (*kept, whole.samples[-1]) if kept else ()
    sigma = np.sqrt(state.cov[6, 6])
    flight.estimator.propagate(ImuWindow(t_ns, t_ns + PERIOD_NS, samples))
    assert np.sqrt(state.cov[6, 6]) > sigma + 0.3
    facts = flight.estimator.add_node(Node(7, t_ns + PERIOD_NS, sight(pose_at(t_ns + PERIOD_NS))))
    assert facts.begins


@pytest.mark.slow
def test_covered_lens_is_flown_through_by_inertial_data() -> None:
    flight = Flight()
    flight.go(10)
    facts = flight.go(3, NOTHING)
    assert facts == NodeFacts()
    assert flight.place_error_m() < 0.1
    flight.go(8)
    assert flight.facts[-1].landmarks > 15
    assert not any(facts.begins or facts.failed for facts in flight.facts[1:])


def test_inertial_motion_is_that_of_the_filter_until_something_is_seen() -> None:
    flight, reference = Flight(), start()
    for _ in range(3):
        reference.propagate(steps_of(window(flight.t_ns, flight.t_ns + PERIOD_NS)))
        flight.go(1, NOTHING)
    assert np.allclose(flight.estimator.state.p, reference.p, atol=1e-3)
    assert np.allclose(flight.estimator.state.cov.diagonal()[6:15], reference.cov.diagonal()[6:15], rtol=0.02)
