# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two replays of one stream, with other parameters or as other firmware, compared message by message."""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Final, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM, VISP
from ekf_stub.inputs.measurements import FlowMeasurement
from viso.compare.differences import ABSENT, Difference, Row, row_differences
from viso.replay.feed import ReplayedMessage
from viso.replay.run import ReplayOutcome, SaidText
from viso.terminal.console import reason_of
from viso.terminal.filter_report import aiding_rows
from viso.vehicle.outcomes import RULES_BY_CODE, UNITS, AidingSpan, Innovations, final_counts, is_model, outcome_kind

K = TypeVar("K", bound=tuple[str, ...])
V = TypeVar("V")

SHOWN: Final = 10
"""The most messages that are listed one by one."""

VERDICT: Final = "verdict"
_LABELS: Final = {structure.name: structure.fields for structure in LOG_STRUCTURE_FROM_VISUALODOM}


class MessageChange(NamedTuple):
    """A verdict on a message, or the result of a sample of it, that differs.

    ``number`` counts the stream's messages from 1. ``what`` is ``verdict`` or, if the verdict is the same, the kind of
    the sample. ``before`` and ``after`` are codes of rules, None without such a sample.
    """

    number: int
    arrival_us: int | None
    type: str
    what: str
    before: str | None
    after: str | None

    def reasons(self) -> tuple[str | None, str | None]:
        """Return the sentences of both rules."""

        def sentence(code: str) -> str:
            return reason_of(code) if self.what == VERDICT else RULES_BY_CODE[code].text

        return self.before and sentence(self.before), self.after and sentence(self.after)


class CountChange(NamedTuple):
    """The number of messages or samples of a name that a rule decided, before and after."""

    name: str
    outcome: str
    rule: str
    before: int
    after: int


class TextChange(NamedTuple):
    """A text, and its times in us since boot; None where it was not sent."""

    severity: int
    text: str
    before_us: int | None
    after_us: int | None


Errors = tuple[float, float]
"""The position error in m and the attitude error in rad that came with a pose."""


class ErrorChange(NamedTuple):
    """Poses of one type of message whose errors differ.

    ``messages`` counts them, ``first`` is the number of the first of them, from 1; ``before`` and ``after`` are its
    errors.
    """

    type: str
    messages: int
    first: int
    before: Errors
    after: Errors


class InnovationChange(NamedTuple):
    """Innovations of a kind of sample that differ, from the filter's model."""

    kind: str
    before: Innovations
    after: Innovations

    def as_dict(self) -> dict[str, object]:
        """Return them for machines: rms in the unit of the kind, and the worst ratio, of which 1 is at the gate."""
        sides = {"before": self.before, "after": self.after}
        return {
            "kind": self.kind,
            **{f"rejected_{side}": innovation.rejected for side, innovation in sides.items()},
            **{f"rms_{side}": innovation.rms for side, innovation in sides.items()},
            **{f"ratio_{side}": innovation.worst_ratio for side, innovation in sides.items()},
            "unit": UNITS[self.kind],
            "model": True,
        }


class FlowChange(NamedTuple):
    """Measurements of the flow sensor that differ.

    ``measurements`` counts them, of ``total``. The others are root mean squares of all rates, rad/s.
    """

    measurements: int
    total: int
    rms_before: float
    rms_after: float


@dataclass(frozen=True)
class ReplayComparison:
    """What differs between two replays.

    Attributes:
        verdicts, samples: counts of verdicts on messages, and of results of samples in the filter.
        messages: the messages of which a verdict or a sample differs.
        first_record: the number of the first message whose log records differ; None if there is none.
        records: the number of messages whose log records differ.
        aiding_before, aiding_after: the filter's aiding that only one of the two had.
        errors: errors of poses.
        innovations: innovations of samples; empty without a filter.
        flow: of OPTICAL_FLOW; None if there is none, or all of it is the same.
    """

    verdicts: Sequence[CountChange]
    samples: Sequence[CountChange]
    messages: Sequence[MessageChange]
    first_record: int | None
    records: int
    texts: Sequence[TextChange]
    aiding_before: Sequence[AidingSpan]
    aiding_after: Sequence[AidingSpan]
    errors: Sequence[ErrorChange]
    innovations: Sequence[InnovationChange]
    flow: FlowChange | None = None

    @property
    def changed_messages(self) -> int:
        """The number of messages of which the verdict or a sample differs."""
        return len({change.number for change in self.messages})

    def as_dict(self) -> dict[str, object]:
        """Return the comparison for machines, without errors and innovations; of messages the first few."""
        messages = []
        for change in self.messages[:SHOWN]:
            before, after = change.reasons()
            messages.append({**change._asdict(), "before_reason": before, "after_reason": after})
        samples = []
        for sample in self.samples:
            rule = RULES_BY_CODE[sample.rule]
            samples.append({**sample._asdict(), "reason": rule.text, "model": is_model(rule)})
        return {
            "verdicts": [verdict._asdict() | {"reason": reason_of(verdict.rule)} for verdict in self.verdicts],
            "filter": samples,
            "changed_messages": self.changed_messages,
            "first_messages": messages,
            "changed_records": self.records,
            "first_changed_record": self.first_record,
            "texts": [change._asdict() for change in self.texts],
            "flow": None if self.flow is None else self.flow._asdict(),
            "aiding": {"before": aiding_rows(self.aiding_before), "after": aiding_rows(self.aiding_after)},
        }


def compare_replays(before: ReplayOutcome, after: ReplayOutcome) -> ReplayComparison:
    """Compare two replays of one stream that have kept their messages."""
    pairs = list(enumerate(zip(before.messages, after.messages, strict=False), 1))
    records = [number for number, pair in pairs if any(_differences(number, *map(_record_rows, pair)))]
    spans_before, spans_after = before.aiding or (), after.aiding or ()
    first, second = (
        {(kind,): innovation for kind, innovation in (run.innovations or {}).items()} for run in (before, after)
    )
    return ReplayComparison(
        [
            CountChange(name, outcome.value, code, *counts)
            for (name, outcome, code), *counts in _differing(before.verdicts, after.verdicts, 0)
        ],
        _sample_changes(before, after),
        [change for number, pair in pairs for change in _message_changes(number, *pair)],
        records[0] if records else None,
        len(records),
        _text_changes(before.texts, after.texts),
        [span for span in spans_before if span not in spans_after],
        [span for span in spans_after if span not in spans_before],
        _error_changes(pairs),
        [InnovationChange(kind, *sides) for (kind,), *sides in _differing(first, second, Innovations())],
        _flow_change(before.flow, after.flow),
    )


def _differing(before: Mapping[K, V], after: Mapping[K, V], nothing: V) -> list[tuple[K, V, V]]:
    values = ((key, before.get(key, nothing), after.get(key, nothing)) for key in sorted({*before, *after}))
    return [(key, first, second) for key, first, second in values if first != second]


def _sample_changes(before: ReplayOutcome, after: ReplayOutcome) -> list[CountChange]:
    first, second = (
        {(kind, rule.code): count for kind, rule, count in final_counts(outcome.filter_counts)}
        for outcome in (before, after)
    )
    changes = _differing(first, second, 0)
    return [
        CountChange(kind, outcome_kind(RULES_BY_CODE[code]).value, code, *counts) for (kind, code), *counts in changes
    ]


def _flow_change(before: Sequence[FlowMeasurement], after: Sequence[FlowMeasurement]) -> FlowChange | None:
    tables = [np.array([(*one.flow, *one.gyro) for one in side]).reshape(-1, 4) for side in (before, after)]
    total, common = max(map(len, tables)), min(map(len, tables))
    first, second = (table[:common] for table in tables)
    same = (first == second) | (np.isnan(first) & np.isnan(second))
    differing = total - int(same.all(axis=1).sum())
    return FlowChange(differing, total, *(_rms(table[:, :2]) for table in tables)) if differing else None


def _rms(rates: npt.NDArray[np.float64]) -> float:
    """Return the root mean square of the lengths of finite rates (N x 2); 0 without any."""
    finite = rates[np.isfinite(rates).all(axis=1)]
    return math.sqrt(float((finite**2).sum()) / len(finite)) if len(finite) else 0.0


# Messages


def _record_rows(message: ReplayedMessage) -> list[Row]:
    """Return the log records that a message made."""
    return [Row(name, dict(zip(_LABELS[name], values, strict=True))) for name, values in message.records]


def _rule_rows(message: ReplayedMessage) -> list[Row]:
    """Return the codes of the rules that decided about a message, and about each kind of its samples."""
    codes = {VERDICT: message.verdict.rule.code}
    for sample in message.samples or ():
        for test in sample.outcomes:
            codes.setdefault(test.outcome.kind, test.outcome.rule.code)
    return [Row("", codes)]


def _differences(number: int, before: Sequence[Row], after: Sequence[Row]) -> Iterator[Difference]:
    return row_differences(f"message {number}", before, after, {}, units={})


def _message_changes(number: int, before: ReplayedMessage, after: ReplayedMessage) -> Iterator[MessageChange]:
    for difference in _differences(number, _rule_rows(before), _rule_rows(after)):
        codes = (None if code == ABSENT else code for code in (difference.recorded, difference.ours))
        yield MessageChange(number, before.arrival_us, before.type, difference.field, *codes)
        if difference.field == VERDICT:  # its samples follow from that
            return


def _error_changes(pairs: Sequence[tuple[int, tuple[ReplayedMessage, ReplayedMessage]]]) -> list[ErrorChange]:
    found: dict[str, ErrorChange] = {}
    for number, (before, after) in pairs:
        for first, second in zip(_error_rows(before), _error_rows(after), strict=False):
            if any(_differences(number, [first], [second])):
                errors = ((float(row.values["PErr"]), float(row.values["AErr"])) for row in (first, second))
                known = found.get(before.type, ErrorChange(before.type, 0, number, *errors))
                found[before.type] = known._replace(messages=known.messages + 1)
                break
    return [found[name] for name in sorted(found)]


def _error_rows(message: ReplayedMessage) -> list[Row]:
    return [
        Row(row.record, {label: row.values[label] for label in ("PErr", "AErr")})
        for row in _record_rows(message)
        if row.record == VISP.name
    ]


def _text_changes(before: Sequence[SaidText], after: Sequence[SaidText]) -> list[TextChange]:
    """Pair equal texts, regardless of texts in between: parameters change times, and with them the order."""
    times: defaultdict[tuple[int, str], tuple[list[int], list[int]]] = defaultdict(lambda: ([], []))
    for index, texts in enumerate((before, after)):
        for item in texts:
            times[item.severity, item.text][index].append(item.time_us)
    changes = [
        TextChange(severity, text, *pair)
        for (severity, text), both in times.items()
        for pair in zip_longest(*both)
        if pair[0] != pair[1]
    ]
    return sorted(changes, key=lambda item: min(time for time in (item.before_us, item.after_us) if time is not None))
