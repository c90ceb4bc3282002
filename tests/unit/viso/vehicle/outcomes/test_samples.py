# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which message's sample an outcome belongs to."""

from ap_core.verdict import Rule
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ingest_rules import FilterOutcome
from viso.vehicle.outcomes import HandedSample, SampleOutcomes, SampleTest


class Rig:
    """Fates, and a short way to tell them of one."""

    def __init__(self) -> None:
        self.outcomes = SampleOutcomes()
        self.now_us = 0

    def tell(self, kind: str, rule: Rule, observed_ms: int = 1000, ratio: float | None = None) -> None:
        self.now_us += 1
        self.outcomes.take(SampleTest(self.now_us, FilterOutcome(kind, rule, observed_ms, ratio)))

    def handed(self) -> tuple[HandedSample, ...]:
        return self.outcomes.take_handed()


def codes(sample: HandedSample) -> list[tuple[str, str]]:
    return [(test.outcome.kind, test.outcome.rule.code) for test in sample.outcomes]


def test_samples_of_a_message_are_those_since_the_one_before() -> None:
    rig = Rig()
    for kind in ("pose", "yaw"):
        rig.tell(kind, rules.TAKEN)
    assert [sample.kind for sample in rig.handed()] == ["pose", "yaw"]
    rig.tell("velocity", rules.TAKEN)
    assert [sample.kind for sample in rig.handed()] == ["velocity"]
    assert rig.handed() == ()


def test_outcome_comes_to_its_sample_later() -> None:
    rig = Rig()
    rig.tell("pose", rules.TAKEN, 1000)
    (first,) = rig.handed()
    rig.tell("pose", rules.TAKEN, 1033)
    (second,) = rig.handed()
    assert not first.is_settled
    rig.tell("pose", rules.FUSED, 1000, 0.5)
    assert (first.is_settled, second.is_settled) == (True, False)
    rig.tell("pose", rules.GATE_POSITION, 1033, 3.0)
    assert [codes(first), codes(second)] == [[("pose", "model_fused")], [("pose", "model_gate_position")]]


def test_outcomes_are_those_of_the_kind() -> None:
    rig = Rig()
    for kind in ("pose", "yaw", "velocity"):
        rig.tell(kind, rules.TAKEN)
    pose, yaw, velocity = rig.handed()
    rig.tell("velocity", rules.GATE_VELOCITY)
    rig.tell("yaw", rules.UNUSED)
    assert [codes(sample) for sample in (pose, yaw, velocity)] == [
        [],
        [("yaw", "model_unused")],
        [("velocity", "model_gate_velocity")],
    ]


def test_height_is_a_outcome_of_the_pose_and_does_not_settle_it() -> None:
    rig = Rig()
    rig.tell("pose", rules.TAKEN)
    (pose,) = rig.handed()
    rig.tell("height", rules.FUSED)
    assert not pose.is_settled
    rig.tell("pose", rules.UNUSED)
    assert pose.is_settled
    assert codes(pose) == [("height", "model_fused"), ("pose", "model_unused")]


def test_refusal_is_settled_at_once() -> None:
    rig = Rig()
    rig.tell("pose", rules.TOO_SOON)
    (pose,) = rig.handed()
    assert pose.is_settled


def test_sample_that_gives_way_while_another_is_handed_in_is_the_older_one() -> None:
    rig = Rig()
    rig.tell("pose", rules.TAKEN, 1000)
    (older,) = rig.handed()
    rig.tell("pose", rules.OVERWRITTEN, 1000)
    rig.tell("pose", rules.TAKEN, 1033)
    (newer,) = rig.handed()
    assert codes(older) == [("pose", "model_overwritten")]
    assert codes(newer) == []


def test_late_samples_of_one_time_are_told_apart_by_their_order() -> None:
    rig = Rig()
    for _ in range(2):
        rig.tell("pose", rules.TAKEN)
    first, second = rig.handed()
    rig.tell("pose", rules.SUPERSEDED)
    rig.tell("pose", rules.FUSED)
    rig.tell("height", rules.GATE_HEIGHT)
    assert codes(first) == [("pose", "model_superseded")]
    assert codes(second) == [("pose", "model_fused"), ("height", "model_gate_height")]


def test_what_was_forgotten_gets_no_outcome() -> None:
    rig = Rig()
    rig.tell("pose", rules.TAKEN)
    handed = rig.handed()
    rig.outcomes.forget(handed)
    rig.outcomes.forget(handed)
    rig.tell("height", rules.FUSED)
    rig.tell("pose", rules.FUSED)
    assert handed[0].outcomes == []


def test_outcome_of_a_sample_from_before_is_passed_over() -> None:
    rig = Rig()
    rig.tell("velocity", rules.FUSED)
    assert rig.handed() == ()


def test_outcomes_for_machines_have_their_time() -> None:
    rig = Rig()
    rig.tell("velocity", rules.TAKEN)
    (sample,) = rig.handed()
    rig.tell("velocity", rules.FUSED, ratio=0.25)
    assert sample.outcomes_as_dicts() == [
        {
            "time_us": 2,
            "kind": "velocity",
            "observed_ms": 1000,
            "outcome": "fused",
            "rule": "model_fused",
            "reason": "used by the estimator",
            "ratio": 0.25,
            "model": True,
        }
    ]
