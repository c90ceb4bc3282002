# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outcome of samples in the filter: the words for it, for people and for machines.

A message that is accepted hands samples to the filter: a pose, a yaw, a velocity or an odometry. Refusal at its door is
exact; what happens behind it is a model's opinion, and is marked so everywhere.
"""

import math
from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from ap_core.verdict import Rule
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ingest_rules import FilterOutcome


class Fate(StrEnum):
    """What the filter did with a sample in the end.

    FUSED: it was used. RESET: the filter was set to it. UNUSED: its source is not in use. REJECTED: a gate held it
    back. LOST: its turn never came. REFUSED: it was not let in.
    """

    FUSED = "fused"
    RESET = "reset"
    UNUSED = "unused"
    REJECTED = "rejected"
    LOST = "lost"
    REFUSED = "refused"


_FATES: Final[Mapping[str, Fate]] = MappingProxyType(
    {
        rules.FUSED.code: Fate.FUSED,
        rules.RESET_TO.code: Fate.RESET,
        rules.ALIGNED_TO.code: Fate.RESET,
        rules.UNUSED.code: Fate.UNUSED,
        rules.NOT_FINITE.code: Fate.REJECTED,
        rules.GATE_POSITION.code: Fate.REJECTED,
        rules.GATE_VELOCITY.code: Fate.REJECTED,
        rules.GATE_HEIGHT.code: Fate.REJECTED,
        rules.GATE_YAW.code: Fate.REJECTED,
        rules.GATE_ODOMETRY.code: Fate.REJECTED,
        rules.OVERWRITTEN.code: Fate.LOST,
        rules.SUPERSEDED.code: Fate.LOST,
        rules.TOO_OLD.code: Fate.LOST,
    }
)
RULES_BY_CODE: Final[Mapping[str, Rule]] = MappingProxyType({rule.code: rule for rule in rules.RULES})

FilterCounts = Mapping[tuple[str, str], int]
"""How many samples by kind and code of the rule, as in ``AhrsBase.ext_nav_counts``."""


def is_final(rule: Rule) -> bool:
    """Return whether a rule decides about a sample for good; one that was only let in has its fate before it."""
    return rule is not rules.TAKEN


def is_model(rule: Rule) -> bool:
    """Return whether a rule's decision is a model's opinion, not the firmware's own."""
    return rule.code.startswith("model_")


def fate_of(rule: Rule) -> Fate:
    """Return what a rule that is final means for a sample."""
    return _FATES.get(rule.code, Fate.REFUSED)


def why(rule: Rule) -> str:
    """Return the reason of a fate, where the fate itself stands beside it."""
    return rule.text.removeprefix(f"{fate_of(rule).value}: ")


def what_became(rule: Rule) -> str:
    """Return fate and reason in words."""
    fate = fate_of(rule).value
    return rule.text if rule.text.startswith(fate) else f"{fate}: {rule.text}"


def sentence(outcome: FilterOutcome) -> str:
    """Return the outcome of a sample in words, with its ratio where it was tested and did not pass."""
    tested = "" if outcome.ratio is None or outcome.ratio < 1 else f", ratio {outcome.ratio:.1f}"
    return what_became(outcome.rule) + tested


def basis(rule: Rule) -> str:
    """Return, for people, whose opinion a rule's decision is."""
    return "a model's" if is_model(rule) else "exact"


def as_dict(outcome: FilterOutcome) -> dict[str, object]:
    """Return an outcome that is final for machines."""
    rule, ratio = outcome.rule, outcome.ratio
    return {
        "kind": outcome.kind,
        "observed_ms": outcome.time_ms,
        "outcome": fate_of(rule).value,
        "rule": rule.code,
        "reason": rule.text,
        "ratio": None if ratio is None or not math.isfinite(ratio) else round(ratio, 4),
        "model": is_model(rule),
    }


def final_counts(counts: FilterCounts) -> list[tuple[str, Rule, int]]:
    """Return kind, rule and count of every final decision, in order of kind and code."""
    known = ((kind, RULES_BY_CODE[code], count) for (kind, code), count in sorted(counts.items()))
    return [(kind, rule, count) for kind, rule, count in known if is_final(rule) and count]
