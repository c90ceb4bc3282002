# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Verdicts: an outcome with its rule, for people and for machines."""

import dataclasses
import json

import pytest

from ap_core.verdict import Rule, Verdict, VerdictKind

RULE = Rule("too_old", "the sample is too old", "File.cpp, function")


def test_verdict_is_written_with_the_fields_of_its_rule() -> None:
    assert Verdict(VerdictKind.IGNORED, RULE).as_dict() == {
        "outcome": "ignored",
        "rule": "too_old",
        "reason": "the sample is too old",
        "source": "File.cpp, function",
    }


@pytest.mark.parametrize("outcome", VerdictKind)
def test_outcome_is_json(outcome: VerdictKind) -> None:
    assert json.loads(json.dumps(Verdict(outcome, RULE).as_dict()))["outcome"] == str(outcome)


def test_outcomes() -> None:
    assert set(VerdictKind) == {"accepted", "ignored", "dropped", "handled"}


def test_verdict_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Verdict(VerdictKind.ACCEPTED, RULE).kind = VerdictKind.DROPPED  # type: ignore[misc]  # what is tested


def test_equal_verdicts_are_equal() -> None:
    assert Verdict(VerdictKind.ACCEPTED, RULE) == Verdict(VerdictKind.ACCEPTED, dataclasses.replace(RULE))
