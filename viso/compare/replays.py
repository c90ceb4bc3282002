# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What other parameters would have changed: two replays of one stream, compared message by message."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Final, NamedTuple, TypeVar

from rich.table import Column, Table

from mav_handlers.wire.messages import VISION_POSITION_DELTA
from viso.replay.feed import ReplayedMessage
from viso.replay.run import ReplayOutcome, SaidText
from viso.terminal.console import reason_of
from viso.terminal.filter_report import aiding_rows
from viso.vehicle.outcomes.labels import RULES_BY_CODE, basis, fate_of, final_counts, is_model, why
from viso.vehicle.outcomes.watch import AidingSpan

K = TypeVar("K", bound=tuple[str, ...])

SHOWN: Final = 10
"""How many messages are told one by one."""
ROWS: Final = 20
"""How many texts and spans a table for people has."""
_VERDICT: Final = "verdict"
_NOTHING: Final = "-"
_NAMED: Final = 4
_TYPE_MAV: Final = 1
_PASSED_ON: Final = ", without effect: VISO_TYPE 1 passes poses on as they come"


class MessageChange(NamedTuple):
    """Something about a message that came out otherwise.

    ``number`` counts the stream's messages from 1, ``what`` is ``verdict`` or, where that is the same, the kind of a
    sample in the filter; ``before`` and ``after`` are codes of rules, None where there was no such sample.
    """

    number: int
    arrival_us: int | None
    type: str
    what: str
    before: str | None
    after: str | None


class CountChange(NamedTuple):
    """How often something (a message or a sample) met a rule, before and after."""

    name: str
    outcome: str
    rule: str
    before: int
    after: int


class TextChange(NamedTuple):
    """A text, and when it was said in us since boot; None where it was not said."""

    severity: int
    text: str
    before_us: int | None
    after_us: int | None


@dataclass(frozen=True)
class ReplayComparison:
    """What differs between two replays: in counts, about single messages, in their log records, in what was said.

    Attributes:
        first_record: number of the first message whose log records differ; None if there is none.
        records: of how many messages the log records differ.
        aiding_before, aiding_after: how the filter navigated in one of the two only.
    """

    verdicts: Sequence[CountChange]
    samples: Sequence[CountChange]
    messages: Sequence[MessageChange]
    first_record: int | None
    records: int
    texts: Sequence[TextChange]
    aiding_before: Sequence[AidingSpan]
    aiding_after: Sequence[AidingSpan]

    @property
    def changed_messages(self) -> int:
        """Of how many messages the verdict or the fate of a sample differs."""
        return len({change.number for change in self.messages})


def compare(before: ReplayOutcome, after: ReplayOutcome) -> ReplayComparison:
    """Compare two replays of one stream that have kept their messages."""
    pairs = list(enumerate(zip(before.messages, after.messages, strict=False), 1))
    records = [number for number, (first, second) in pairs if repr(first.records) != repr(second.records)]
    spans_before, spans_after = before.aiding or (), after.aiding or ()
    return ReplayComparison(
        _verdict_changes(before, after),
        _sample_changes(before, after),
        [change for number, pair in pairs for change in _message_changes(number, *pair)],
        records[0] if records else None,
        len(records),
        _text_changes(before.texts, after.texts),
        [span for span in spans_before if span not in spans_after],
        [span for span in spans_after if span not in spans_before],
    )


def _differing(before: Mapping[K, int], after: Mapping[K, int]) -> list[tuple[K, int, int]]:
    counts = ((key, before.get(key, 0), after.get(key, 0)) for key in sorted({*before, *after}))
    return [(key, first, second) for key, first, second in counts if first != second]


def _verdict_changes(before: ReplayOutcome, after: ReplayOutcome) -> list[CountChange]:
    changes = _differing(before.verdicts, after.verdicts)
    return [CountChange(name, outcome.value, code, *counts) for (name, outcome, code), *counts in changes]


def _sample_changes(before: ReplayOutcome, after: ReplayOutcome) -> list[CountChange]:
    first, second = (
        {(kind, rule.code): count for kind, rule, count in final_counts(outcome.filter_counts)}
        for outcome in (before, after)
    )
    changes = _differing(first, second)
    return [CountChange(kind, fate_of(RULES_BY_CODE[code]).value, code, *counts) for (kind, code), *counts in changes]


def _message_changes(number: int, before: ReplayedMessage, after: ReplayedMessage) -> Iterator[MessageChange]:
    first, second = _fates(before), _fates(after)
    if first[_VERDICT] != second[_VERDICT]:
        # Its samples follow from that.
        yield MessageChange(number, before.arrival_us, before.type, _VERDICT, first[_VERDICT], second[_VERDICT])
        return
    for what in {**first, **second}:
        codes = first.get(what), second.get(what)
        if codes[0] != codes[1]:
            yield MessageChange(number, before.arrival_us, before.type, what, *codes)


def _fates(message: ReplayedMessage) -> dict[str, str]:
    """Return the codes of the rules that decided about a message and about each of its samples."""
    fates = {_VERDICT: message.verdict.rule.code}
    for sample in message.samples or ():
        for fate in sample.fates:
            fates.setdefault(fate.outcome.kind, fate.outcome.rule.code)
    return fates


def _text_changes(before: Sequence[SaidText], after: Sequence[SaidText]) -> list[TextChange]:
    """Pair equal texts in their order; a pair of one time is no change."""
    times: defaultdict[tuple[int, str], tuple[list[int], list[int]]] = defaultdict(lambda: ([], []))
    for index, texts in enumerate((before, after)):
        for said in texts:
            times[said.severity, said.text][index].append(said.time_us)
    changes = [
        TextChange(severity, text, *pair)
        for (severity, text), both in times.items()
        for pair in zip_longest(*both)
        if pair[0] != pair[1]
    ]
    return sorted(changes, key=lambda one: min(time for time in (one.before_us, one.after_us) if time is not None))


# For machines


def comparison_rows(comparison: ReplayComparison) -> dict[str, object]:
    """Return a comparison for machine-readable output; of messages the first few."""
    rows = [change._asdict() | _rule_words(change) for change in comparison.messages]
    return {
        "verdicts": [change._asdict() | {"reason": reason_of(change.rule)} for change in comparison.verdicts],
        "filter": [
            change._asdict()
            | {"reason": RULES_BY_CODE[change.rule].text, "model": is_model(RULES_BY_CODE[change.rule])}
            for change in comparison.samples
        ],
        "changed_messages": comparison.changed_messages,
        "first_messages": rows[:SHOWN],
        "changed_records": comparison.records,
        "first_changed_record": comparison.first_record,
        "texts": [change._asdict() for change in comparison.texts],
        "aiding": {
            "before": aiding_rows(comparison.aiding_before),
            "after": aiding_rows(comparison.aiding_after),
        },
    }


def _rule_words(change: MessageChange) -> dict[str, str | None]:
    return {
        f"{side}_reason": None if code is None else _words(change.what, code)
        for side, code in (("before", change.before), ("after", change.after))
    }


def _words(what: str, code: str) -> str:
    return reason_of(code) if what == _VERDICT else RULES_BY_CODE[code].text


# For people


def setting_lines(settings: Mapping[str, float], before: ReplayOutcome) -> Iterator[str]:
    """Yield what each setting changes, a line each."""
    for name, value in settings.items():
        told = f"{name}: {before.params[name]:g} -> {value:g}" if name in before.params else f"{name}: {value:g}"
        yield told + (_PASSED_ON if name == "VISO_ORIENT" and _is_passed_on(settings, before) else "")


def _is_passed_on(settings: Mapping[str, float], before: ReplayOutcome) -> bool:
    viso_type = settings.get("VISO_TYPE", before.params.get("VISO_TYPE"))
    has_deltas = any(name == VISION_POSITION_DELTA.__name__ for name, _, _ in before.verdicts)
    return viso_type == _TYPE_MAV and not has_deltas


def comparison_tables(comparison: ReplayComparison, *, with_filter: bool) -> Iterator[Table | str]:
    """Yield the tables of what differs, and a line where nothing does."""
    if comparison.verdicts:
        yield _verdict_table(comparison.verdicts)
    if comparison.samples:
        yield _sample_table(comparison.samples)
    if comparison.messages:
        yield _message_table(comparison)
    if comparison.texts:
        yield _text_table(comparison.texts)
    if comparison.aiding_before or comparison.aiding_after:
        yield _aiding_table(comparison)
    if not (comparison.verdicts or comparison.samples or comparison.messages):
        where = "" if with_filter else "; --ekf tells what the filter makes of it"
        yield f"no verdict differs{where}"
    if comparison.records:
        yield f"log records of {comparison.records} messages differ, first of message {comparison.first_record}"


def _count_columns(title: str, *names: str) -> Table:
    counts = (Column(name, justify="right") for name in ("before", "after"))
    return Table(*names, *counts, title=title)


def _verdict_table(changes: Sequence[CountChange]) -> Table:
    table = _count_columns("Verdicts of messages that differ in number", "message", "verdict", "why")
    for change in changes:
        table.add_row(change.name, change.outcome, reason_of(change.rule), str(change.before), str(change.after))
    return table


def _sample_table(changes: Sequence[CountChange]) -> Table:
    table = _count_columns("Fates of samples in the filter that differ in number", "sample", "fate", "why", "basis")
    for change in changes:
        rule = RULES_BY_CODE[change.rule]
        table.add_row(change.name, change.outcome, why(rule), basis(rule), str(change.before), str(change.after))
    return table


def _message_table(comparison: ReplayComparison) -> Table:
    changes = comparison.messages
    title = f"Of {comparison.changed_messages} messages that fared otherwise, the first"
    right = Column("number", justify="right"), Column("time", justify="right")
    table = Table(*right, "message", "what", "before", "after", title=title)
    for change in changes[:SHOWN]:
        words = (_NOTHING if code is None else _words(change.what, code) for code in (change.before, change.after))
        table.add_row(str(change.number), _seconds(change.arrival_us), change.type, change.what, *words)
    return table


def _text_table(changes: Sequence[TextChange]) -> Table:
    right = Column("before", justify="right"), Column("after", justify="right")
    table = Table(
        *right, "text", title="Texts that differ", caption=_more([f'"{change.text}"' for change in changes[ROWS:]])
    )
    for change in changes[:ROWS]:
        text = f"({change.severity}) {change.text}"
        table.add_row(_seconds(change.before_us), _seconds(change.after_us), text)
    return table


def _aiding_table(comparison: ReplayComparison) -> Table:
    right = Column("from", justify="right"), Column("to", justify="right")
    before, after = (
        [(span, when) for span in spans]
        for when, spans in (("before", comparison.aiding_before), ("after", comparison.aiding_after))
    )
    spans = sorted(before + after, key=lambda row: row[0].start_us)
    title = "By what the filter navigated in one of the two only (a model's)"
    caption = _more([f"by {span.mode.value} {when}" for span, when in spans[ROWS:]])
    table = Table(*right, "by", "when", title=title, caption=caption)
    for span, when in spans[:ROWS]:
        table.add_row(_seconds(span.start_us), _seconds(span.end_us), span.mode.value, when)
    return table


def _more(left_out: Sequence[str]) -> str | None:
    """Return how many rows are left out, and of what most of them are."""
    if not left_out:
        return None
    kinds = Counter(left_out).most_common()
    named = ", ".join(f"{count} {what}" for what, count in kinds[:_NAMED])
    others = sum(count for _, count in kinds[_NAMED:])
    return f"and {len(left_out)} more: {named}{f', {others} others' if others else ''}"


def _seconds(time_us: int | None) -> str:
    return _NOTHING if time_us is None else f"{time_us / 1e6:.3f} s"
