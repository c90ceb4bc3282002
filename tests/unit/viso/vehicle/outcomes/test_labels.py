# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The words for the outcome of samples in the filter."""

import json

import pytest

from ap_core.verdict import Rule
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ingest_rules import FilterOutcome
from viso.vehicle.outcomes import (
    OutcomeKind,
    as_dict,
    basis,
    final_counts,
    is_final,
    is_model,
    outcome_kind,
    sentence,
    why,
)

GATES = (rules.GATE_POSITION, rules.GATE_VELOCITY, rules.GATE_HEIGHT, rules.GATE_YAW, rules.GATE_ODOMETRY)
DOOR = (
    *(rules.NOT_STARTED, rules.NOT_A_NUMBER, rules.YAW_NOT_A_NUMBER, rules.TOO_SOON, rules.TOO_SHORT),
    *(rules.NOT_INITIALISED, rules.NO_BUFFER),
)


def outcome(rule: Rule, ratio: float | None = None) -> FilterOutcome:
    return FilterOutcome("pose", rule, 12_290, ratio)


@pytest.mark.parametrize(("members", "outcome"), [
    ((rules.FUSED,), OutcomeKind.FUSED),
    ((rules.RESET_TO, rules.ALIGNED_TO), OutcomeKind.RESET),
    ((rules.UNUSED,), OutcomeKind.UNUSED),
    ((*GATES, rules.NOT_FINITE), OutcomeKind.REJECTED),
    ((rules.OVERWRITTEN, rules.SUPERSEDED, rules.TOO_OLD), OutcomeKind.LOST),
    (DOOR, OutcomeKind.REFUSED),
])  # fmt: skip
def test_outcomes(members: tuple[Rule, ...], outcome: OutcomeKind) -> None:
    assert [outcome_kind(rule) for rule in members] == [outcome] * len(members)


def test_only_being_let_in_is_not_final() -> None:
    assert [rule for rule in rules.RULES if not is_final(rule)] == [rules.TAKEN]


@pytest.mark.parametrize("rule", [rule for rule in rules.RULES if is_final(rule)], ids=lambda rule: rule.code)
def test_the_door_is_exact_and_all_behind_it_a_models(rule: Rule) -> None:
    assert is_model(rule) is (outcome_kind(rule) is not OutcomeKind.REFUSED)
    assert basis(rule) == ("exact" if rule in DOOR else "a model's")


@pytest.mark.parametrize(("rule", "ratio", "words"), [
    (rules.GATE_POSITION, 3.21, "rejected: horizontal position gate, ratio 3.2"),
    (rules.GATE_ODOMETRY, 1.5, "rejected: body odometry gate, on an axis, ratio 1.5"),
    (rules.FUSED, 0.3, "fused: used by the estimator"),
    (rules.TOO_OLD, None, "lost: 100 ms or more behind the horizon"),
    (rules.TOO_SOON, None, "refused: less than 20 ms, odometry 50 ms, after the last"),
    (rules.RESET_TO, None, "reset: the estimator was reset to it"),
])  # fmt: skip
def test_sentence_says_outcome_reason_and_ratio(rule: Rule, ratio: float | None, words: str) -> None:
    assert sentence(outcome(rule, ratio)) == words


def test_reason_stands_beside_its_outcome_without_repeating_it() -> None:
    assert [why(rule) for rule in (rules.GATE_HEIGHT, rules.UNUSED)] == ["height gate", rules.UNUSED.text]


def test_outcome_for_machines() -> None:
    assert as_dict(outcome(rules.GATE_POSITION, 3.212345)) == {
        "kind": "pose",
        "observed_ms": 12_290,
        "outcome": "rejected",
        "rule": "model_gate_position",
        "reason": "rejected: horizontal position gate",
        "ratio": 3.2123,
        "model": True,
    }


@pytest.mark.parametrize("ratio", [None, float("nan"), float("inf")])
def test_ratio_for_machines_is_a_number_or_null(ratio: float | None) -> None:
    assert '"ratio": null' in json.dumps(as_dict(outcome(rules.GATE_POSITION, ratio)))


def test_counts_of_what_is_final_are_in_order() -> None:
    counts = {
        ("yaw", "model_fused"): 3,
        ("pose", "taken"): 9,
        ("pose", "too_soon"): 1,
        ("pose", "model_fused"): 8,
        ("pose", "nan"): 0,
    }
    assert final_counts(counts) == [
        ("pose", rules.FUSED, 8),
        ("pose", rules.TOO_SOON, 1),
        ("yaw", rules.FUSED, 3),
    ]
