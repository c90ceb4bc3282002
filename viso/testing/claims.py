# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a test may claim about messages, samples and texts, and the error where that is wrong."""

import difflib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from ap_core.verdict import VerdictKind
from mav_handlers.endpoint import UNKNOWN_NAME
from mav_handlers.handlers import VISION_NAMES
from mav_handlers.verdicts import ALL_VERDICTS
from mav_handlers.wire.codec import message_id
from mav_handlers.wire.messages import Message
from viso.testing.observations import MessageVerdict, StatusText
from viso.vehicle.outcomes import UNITS, OutcomeKind

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is

MESSAGE_ROWS: Final = 8
TEXT_ROWS: Final = 8
KINDS: Final = tuple(UNITS)
"""Of samples, as the filter tells them apart."""

_NO_FRAME: Final = "BAD_DATA"
# Whoever sends what cannot be read has lost a message of some kind.
_NAVIGATION: Final = VISION_NAMES | {_NO_FRAME, UNKNOWN_NAME}
_KIND_OF_RULE: Final = {verdict.rule.code: verdict.kind for verdict in ALL_VERDICTS}


@dataclass(frozen=True, slots=True)
class Claim:
    """That ``count`` messages got a kind of verdict, all of one name and for one reason if these are given.

    Without a count there is at least one.
    """

    kind: VerdictKind
    message: str | None
    reason: str | None
    count: int | None

    def fits(self, verdict: MessageVerdict) -> bool:
        """Return whether a message is one of those."""
        return (
            verdict.kind is self.kind and self.message in (None, verdict.name) and self.reason in (None, verdict.rule)
        )

    def holds(self, found: int) -> bool:
        """Return whether a number of messages is the right one."""
        return found > 0 if self.count is None else found == self.count

    def __str__(self) -> str:
        """Return the claim in words."""
        count = "at least one" if self.count is None else str(self.count)
        why = "" if self.reason is None else f" by the rule {self.reason}"
        what = self.message or ("message" if self.count in (None, 1) else "messages")
        return f"{count} {what} {self.kind.value}{why}"


def make_claim(kind: VerdictKind, message: str | type[Message] | None, reason: str | None, count: int | None) -> Claim:
    """Return a claim. Raises ValueError for an unknown message or rule, one of another kind, or a negative count."""
    name = message if message is None or isinstance(message, str) else message.__name__
    if name is not None and name not in (_NO_FRAME, UNKNOWN_NAME):
        _check_message_name(name)
    if reason is not None:
        _check_reason(reason, kind)
    check_count(count)
    return Claim(kind, name, reason, count)


def _check_message_name(name: str) -> None:
    try:
        message_id(name)
    except KeyError:
        raise ValueError(f"message {name!r}: MAVLink has no such message") from None


def _check_reason(reason: str, kind: VerdictKind) -> None:
    codes = [code for code, its_kind in _KIND_OF_RULE.items() if its_kind is kind]
    if reason in codes:
        return
    if reason in _KIND_OF_RULE:
        raise ValueError(f"reason {reason!r}: by that rule messages are {_KIND_OF_RULE[reason]}, not {kind}")
    near = difflib.get_close_matches(reason, codes, 1)
    hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(codes)}"
    raise ValueError(f"reason {reason!r}: no such rule; {hint}")


def check_count(count: int | None) -> None:
    """Raise ValueError unless it is a number of things, or None."""
    if count is not None and (isinstance(count, bool) or not isinstance(count, int) or count < 0):
        raise ValueError(f"count {count!r}: not a number of messages")


def check_claim(claim: Claim, verdicts: Sequence[MessageVerdict]) -> None:
    """Raise AssertionError, with what did happen, unless the claim holds."""
    found = sum(map(claim.fits, verdicts))
    if not claim.holds(found):
        raise AssertionError(f"expected {claim}, found {found}{what_became(verdicts)}")


def check_nothing_lost(verdicts: Sequence[MessageVerdict], message: str | None) -> None:
    """Raise AssertionError if navigation was dropped or withheld: of one message by its name, or any."""
    lost = [
        verdict
        for verdict in verdicts
        if verdict.kind in (VerdictKind.DROPPED, VerdictKind.IGNORED)
        and (verdict.name in _NAVIGATION if message is None else verdict.name == message)
    ]
    if lost:
        what = message or "message with navigation"
        raise AssertionError(f"expected every {what} accepted, but not {len(lost)}{what_became(verdicts)}")


def what_became(verdicts: Sequence[MessageVerdict]) -> str:
    """Return the outcome of messages, a line for each kind and rule, with the time of the first in s since boot."""
    if not verdicts:
        return "; nothing has come"
    first: dict[tuple[str, ...], int] = {}
    counts: Counter[tuple[str, ...]] = Counter()
    for verdict in verdicts:
        key = verdict.name, verdict.kind.value, verdict.rule, verdict.reason
        first.setdefault(key, verdict.time_us)
        counts[key] += 1
    rows = [
        f"{count:5d} {name} {outcome}, {rule}: {reason} (first at {first[name, outcome, rule, reason] * 1e-6:.3f} s)"
        for (name, outcome, rule, reason), count in counts.most_common()
    ]
    return f"; what came:\n{shortened(rows, MESSAGE_ROWS)}"


def check_fused(verdicts: Sequence[MessageVerdict], kind: str, count: int | None) -> None:
    """Raise AssertionError, with the outcome of samples, unless the filter fused so many of a kind.

    Raises ValueError if there is no such kind, or the count is negative.
    """
    if kind not in KINDS:
        raise ValueError(f"kind {kind!r}: no such kind of sample; there are {', '.join(KINDS)}")
    check_count(count)
    outcomes = [outcome for verdict in verdicts for outcome in verdict.outcomes]
    found = sum(outcome.kind == kind and outcome.outcome is OutcomeKind.FUSED for outcome in outcomes)
    if found > 0 if count is None else found == count:
        return
    expected = "at least one" if count is None else str(count)
    rows = Counter(f"{outcome.kind} {outcome.outcome.value}, {outcome.rule}: {outcome.reason}" for outcome in outcomes)
    lines = [f"{number:5d} {row}" for row, number in rows.most_common()]
    waiting = sum(not verdict.is_settled for verdict in verdicts)
    if waiting:
        lines.append(f"{waiting:5d} waiting for the filter's decision, which takes some 250 ms: advance the time")
    shown = f"; the outcome of samples:\n{shortened(lines, MESSAGE_ROWS)}" if lines else what_became(verdicts)
    raise AssertionError(f"expected {expected} {kind} fused, found {found}{shown}")


def check_text(part: str, texts: Sequence[StatusText]) -> None:
    """Raise AssertionError, with the last texts, unless a text contains a part."""
    if any(part in text.text for text in texts):
        return
    rows = [f"{text.time_us * 1e-6:9.3f} s  ({text.severity}) {text.text}" for text in texts]
    last = f"; it said:\n{shortened(rows, TEXT_ROWS, newest=True)}" if rows else "; it has said nothing"
    raise AssertionError(f"expected a text with {part!r}{last}")


def shortened(rows: Sequence[str], limit: int, *, newest: bool = False) -> str:
    """Return rows as lines: the first ones, or the newest, and how many there are besides."""
    more = len(rows) - limit
    if more <= 0:
        return "\n".join(rows)
    left_out = f"  ... and {more} more"
    return "\n".join([left_out, *rows[-limit:]] if newest else [*rows[:limit], left_out])
