# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict on a message: what kind it is, and the firmware rule that decided it.

The firmware reports few of its decisions; here each verdict has a rule with a code, a sentence and the deciding place
in the firmware.
"""

from dataclasses import dataclass
from enum import StrEnum


class VerdictKind(StrEnum):
    """What the autopilot did with a message.

    ACCEPTED: its data went to the estimator. IGNORED: it was handled (logged, counted for health) but its data
        was not passed on. DROPPED: it had no effect on external navigation at all. HANDLED: it carries no external
    navigation data and was processed.
    """

    ACCEPTED = "accepted"
    IGNORED = "ignored"
    DROPPED = "dropped"
    HANDLED = "handled"

    __hash__ = str.__hash__  # hashed millions of times, and an enum's own hash takes a call


@dataclass(frozen=True, slots=True)
class Rule:
    """A firmware rule: a stable code, its text, and its place in the firmware (file, function)."""

    code: str
    text: str
    source: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the autopilot did with a message, and the rule that decided it."""

    kind: VerdictKind
    rule: Rule

    def as_dict(self) -> dict[str, str]:
        """Return the verdict for machine-readable output."""
        return {
            "outcome": self.kind.value,
            "rule": self.rule.code,
            "reason": self.rule.text,
            "source": self.rule.source,
        }


def dropped(code: str, text: str, source: str) -> Verdict:
    """Return the DROPPED verdict of a rule with this code, text and source."""
    return Verdict(VerdictKind.DROPPED, Rule(code, text, source))
