# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a test observes of the autopilot: verdicts on messages, outcomes of samples, records of the log, texts."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from ap_core.log_field import LogValue
from ap_core.verdict import VerdictKind
from mav_handlers.wire.messages import Message
from viso.vehicle.outcomes import HandedSample, OutcomeKind, outcome_kind


class StatusText(NamedTuple):
    """A text for the ground station: time in us since boot, MAV_SEVERITY (0 emergency .. 7 debug), text."""

    time_us: int
    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Record:
    """A record of the DataFlash log: ``record["PX"]`` is a field's value, float32 where the log has that.

    Integers are raw, floats in the unit of the field.
    """

    time_us: int
    name: str
    fields: Mapping[str, LogValue]

    def __getitem__(self, label: str) -> LogValue:
        """Return a field's value; KeyError if the record has no such field."""
        return self.fields[label]

    def __contains__(self, label: object) -> bool:
        """Return whether the record has a field."""
        return label in self.fields


class SampleOutcome(NamedTuple):
    """What the filter, a model of EKF3, did with a sample that a message brought.

    Attributes:
        kind: pose, height, yaw, velocity or odometry.
        outcome: its outcome; fused and reset are the good ones.
        rule: code of the rule that decided.
        reason: that rule in words.
    """

    kind: str
    outcome: OutcomeKind
    rule: str
    reason: str


@dataclass(frozen=True, slots=True)
class MessageVerdict:
    """The verdict on a message, or on bytes that are none.

    Attributes:
        time_us: when it was handled, us since boot.
        name: of the message; BAD_DATA for bytes that are no frame, UNKNOWN for an id outside the dialect.
        system_id, component_id: of the sender; None for BAD_DATA.
        message: its content; None for BAD_DATA, and for a message of which the autopilot knows only the name.
        kind: accepted, ignored, dropped or handled (it carries no external navigation).
        rule: code of the firmware's rule that decided.
        reason: that rule in words.
        source: where in the firmware it stands.
        records: those of external navigation (VISO, VISP, VISV) that it made.
    """

    time_us: int
    name: str
    system_id: int | None
    component_id: int | None
    message: Message | None
    kind: VerdictKind
    rule: str
    reason: str
    source: str
    records: tuple[Record, ...]
    _samples: tuple[HandedSample, ...] = field(default=(), repr=False, compare=False)

    @property
    def outcomes(self) -> tuple[SampleOutcome, ...]:
        """What the filter did with its samples, as far as that is decided: some 60 to 250 ms after it came."""
        rules = [(test.outcome.kind, test.outcome.rule) for sample in self._samples for test in sample.outcomes]
        return tuple(SampleOutcome(kind, outcome_kind(rule), rule.code, rule.text) for kind, rule in rules)

    @property
    def is_settled(self) -> bool:
        """Return whether the filter has decided about all its samples."""
        return all(sample.is_settled for sample in self._samples)
