# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outcome of a message, and the firmware rule that decided it.

The firmware says nothing about most of these outcomes; here each has a rule with a code, a sentence and the place
in the firmware where it is decided.
"""

from dataclasses import dataclass
from enum import StrEnum


class Outcome(StrEnum):
    """Outcome of a message.

    ACCEPTED: its data was handed to the estimator. IGNORED: it was handled (logged, counted for health) but its data
    was withheld. DROPPED: it had no effect on external navigation at all. HANDLED: it carries no external
    navigation data and was processed.
    """

    ACCEPTED = "accepted"
    IGNORED = "ignored"
    DROPPED = "dropped"
    HANDLED = "handled"

    __hash__ = str.__hash__  # they are counted by the million, and an enum's own takes a call


@dataclass(frozen=True, slots=True)
class Rule:
    """A firmware rule: a stable code, its text, and its place in the firmware (file, function)."""

    code: str
    text: str
    source: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """The outcome of one message with the rule that decided it."""

    outcome: Outcome
    rule: Rule

    def as_dict(self) -> dict[str, str]:
        """Return the verdict for machine-readable output."""
        return {
            "outcome": self.outcome.value,
            "rule": self.rule.code,
            "reason": self.rule.text,
            "source": self.rule.source,
        }


def dropped(code: str, text: str, source: str) -> Verdict:
    """Return the verdict on a message that has no effect, from what its rule holds."""
    return Verdict(Outcome.DROPPED, Rule(code, text, source))
