# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the doctor can find, and what it has found."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from viso.doctor.measures.own_filter import Witness
from viso.streams.stream_kinds import Aspect

if TYPE_CHECKING:
    from viso.doctor.evidence import Evidence

NUMBERS_SHOWN: Final = 5

Check = Callable[["Evidence"], Iterable["Sighting"]]


class Severity(StrEnum):
    """How bad a finding is.

    ERROR: external navigation cannot work, or what it says is wrong. WARNING: it works worse than it could, or at times
    only. NOTE: good to know.
    """

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"

    @property
    def rank(self) -> int:
        """0 is the worst."""
        return list(Severity).index(self)

    def at_least(self, other: "Severity") -> bool:
        """Return whether it is as bad as another, or worse."""
        return self.rank <= other.rank


@dataclass(frozen=True, slots=True)
class Sighting:
    """A rule's evidence.

    Attributes:
        text: what was seen, in a sentence without its full stop.
        numbers: of the messages that show it, from 1; all of them.
        start_us, end_us: when it was seen, us since the autopilot's boot; None where time says nothing.
        fix: what to do in this very case, in place of the rule's general advice.
        severity: if it is less than the rule's.
    """

    text: str
    numbers: Sequence[int] = ()
    start_us: int | None = None
    end_us: int | None = None
    fix: str | None = None
    severity: Severity | None = None


@dataclass(frozen=True, slots=True)
class Rule:
    """Something that can be wrong.

    Attributes:
        severity: at its worst.
        code: stable, such as XN3-02; family, then number.
        title: what is wrong, in a few words.
        firmware: what the autopilot does about it, in a sentence or two.
        source: where in the firmware that is decided: file and function.
        fix: what to change.
        check: finds it; must not raise whatever the stream.
        witness: what it rests on; LOG stands for telemetry as well, where that is what the vehicle left.
        needs: what a recording must hold; of one that lacks it the rule says nothing.
    """

    severity: Severity
    code: str
    title: str
    firmware: str
    source: str
    fix: str
    check: Check
    witness: Witness = Witness.STREAM
    needs: frozenset[Aspect] = frozenset()

    @property
    def family(self) -> str:
        """The code without its number."""
        return self.code.partition("-")[0]


def _of(severity: Severity) -> Callable[..., Callable[[Check], Rule]]:
    def rule(
        *texts: str, witness: Witness = Witness.STREAM, needs: frozenset[Aspect] = frozenset()
    ) -> Callable[[Check], Rule]:
        """Make a function the check of a rule: code, title, firmware, source and fix stand above it."""
        code, title, firmware, source, fix = texts
        return lambda check: Rule(severity, code, title, firmware, source, fix, check, witness, needs)

    return rule


error, warning, note = map(_of, Severity)
vehicle_error, vehicle_warning, vehicle_note = (partial(_of(one), witness=Witness.LOG) for one in Severity)
"""Likewise for rules that rest on what the vehicle left: its log, or its telemetry."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A rule that applies, and why; fields as those of ``Rule`` and ``Sighting``."""

    code: str
    severity: Severity
    title: str
    evidence: str
    firmware: str
    source: str
    fix: str
    witness: Witness
    message_numbers: tuple[int, ...]
    start_us: int | None
    end_us: int | None

    def as_dict(self) -> dict[str, object]:
        """Return the finding for machine-readable output."""
        told = asdict(self)
        numbers = list(told.pop("message_numbers"))
        is_model = self.witness is Witness.MODEL
        plain = {"severity": self.severity.value, "witness": self.witness.value}
        return {**told, **plain, "model": is_model, "messages": numbers}


def make_finding(rule: Rule, sighting: Sighting, vehicle: Witness = Witness.LOG) -> Finding:
    """Return what a rule has found; ``vehicle`` is what the vehicle left: its log, or telemetry."""
    return Finding(
        rule.code,
        sighting.severity or rule.severity,
        rule.title,
        sighting.text,
        rule.firmware,
        rule.source,
        sighting.fix or rule.fix,
        vehicle if rule.witness is Witness.LOG else rule.witness,
        tuple(int(number) for number in sighting.numbers),
        None if sighting.start_us is None else int(sighting.start_us),
        None if sighting.end_us is None else int(sighting.end_us),
    )


def diagnose(evidence: "Evidence", rules: Iterable[Rule]) -> list[Finding]:
    """Return what rules find, worst first, then by code."""
    with np.errstate(all="ignore"):  # streams hold NaN and infinity
        fitting = [rule for rule in rules if rule.needs.isdisjoint(evidence.lacks)]
        findings = [
            make_finding(rule, sighting, evidence.vehicle_witness)
            for rule in fitting
            for sighting in rule.check(evidence)
        ]
    return sorted(findings, key=lambda finding: (finding.severity.rank, finding.code))


def numbers_text(numbers: Sequence[int]) -> str:
    """Return message numbers in words: the first few, and how many there are."""
    if not numbers:
        return ""
    shown = ", ".join(str(number) for number in numbers[:NUMBERS_SHOWN])
    noun = "message" if len(numbers) == 1 else "messages"
    more = f", … ({len(numbers)} in all)" if len(numbers) > NUMBERS_SHOWN else ""
    return f"{noun} {shown}{more}"
