# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of samples in the filter: the words for it, how far off they were, and which message brought them.

A message that is accepted hands samples to the filter: a pose, a yaw, a velocity or an odometry. Whether the filter
takes a sample is exact. What it does with the sample later is the opinion of a model, and is marked so everywhere.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Final, NamedTuple

from ap_core.verdict import Rule
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ingest_rules import FilterOutcome
from ekf_stub.reports import AidingMode
from viso.vehicle.vehicle import Vehicle


class OutcomeKind(StrEnum):
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


_KINDS: Final[Mapping[str, OutcomeKind]] = MappingProxyType(
    {
        rules.FUSED.code: OutcomeKind.FUSED,
        rules.RESET_TO.code: OutcomeKind.RESET,
        rules.ALIGNED_TO.code: OutcomeKind.RESET,
        rules.UNUSED.code: OutcomeKind.UNUSED,
        rules.NOT_FINITE.code: OutcomeKind.REJECTED,
        rules.GATE_POSITION.code: OutcomeKind.REJECTED,
        rules.GATE_VELOCITY.code: OutcomeKind.REJECTED,
        rules.GATE_HEIGHT.code: OutcomeKind.REJECTED,
        rules.GATE_YAW.code: OutcomeKind.REJECTED,
        rules.GATE_ODOMETRY.code: OutcomeKind.REJECTED,
        rules.OVERWRITTEN.code: OutcomeKind.LOST,
        rules.SUPERSEDED.code: OutcomeKind.LOST,
        rules.TOO_OLD.code: OutcomeKind.LOST,
    }
)
RULES_BY_CODE: Final[Mapping[str, Rule]] = MappingProxyType({rule.code: rule for rule in rules.RULES})

FilterCounts = Mapping[tuple[str, str], int]
"""How many samples by kind and code of the rule, as in ``AhrsBase.ext_nav_counts``."""


def is_final(rule: Rule) -> bool:
    """Return whether a rule decides about a sample for good; one that was only let in has its outcome before it."""
    return rule is not rules.TAKEN


def is_model(rule: Rule) -> bool:
    """Return whether a rule's decision is a model's opinion, not the firmware's own."""
    return rule.code.startswith("model_")


def outcome_kind(rule: Rule) -> OutcomeKind:
    """Return what a rule that is final means for a sample."""
    return _KINDS.get(rule.code, OutcomeKind.REFUSED)


def why(rule: Rule) -> str:
    """Return the reason of an outcome, where the outcome itself stands beside it."""
    return rule.text.removeprefix(f"{outcome_kind(rule).value}: ")


def what_became(rule: Rule) -> str:
    """Return outcome and reason in words."""
    outcome = outcome_kind(rule).value
    return rule.text if rule.text.startswith(outcome) else f"{outcome}: {rule.text}"


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
        "outcome": outcome_kind(rule).value,
        "rule": rule.code,
        "reason": rule.text,
        "ratio": None if ratio is None or not math.isfinite(ratio) else round(ratio, 4),
        "model": is_model(rule),
    }


def final_counts(counts: FilterCounts) -> list[tuple[str, Rule, int]]:
    """Return kind, rule and count of every final decision, in order of kind and code."""
    rows = ((kind, RULES_BY_CODE[code], count) for (kind, code), count in sorted(counts.items()))
    return [(kind, rule, count) for kind, rule, count in rows if is_final(rule) and count]


UNITS: Final = {"pose": "m", "height": "m", "yaw": "deg", "velocity": "m/s", "odometry": "m/s"}
"""Of innovations, by kind of sample."""
_REJECTED: Final = OutcomeKind.REJECTED  # in Python 3.11 it takes 0.1 us to look up a member of an enumeration


class SampleTest(NamedTuple):
    """A sample that the filter decided about, and when, us since boot."""

    time_us: int
    outcome: FilterOutcome


class AidingSpan(NamedTuple):
    """How the filter navigated from a time in us since boot on, to another."""

    start_us: int
    end_us: int
    mode: AidingMode


@dataclass(slots=True)
class Innovations:
    """The innovations of a kind of sample: how many were tested and rejected, and how large they were."""

    tested: int = 0
    rejected: int = 0
    worst: float = 0.0
    worst_ratio: float = 0.0
    _squares: float = 0.0

    def add(self, innovation: float, ratio: float, *, is_rejected: bool) -> None:
        """Count a sample that was tested."""
        self.tested += 1
        self.rejected += is_rejected
        if innovation > self.worst:
            self.worst = innovation
        if ratio > self.worst_ratio:
            self.worst_ratio = ratio
        self._squares += innovation**2

    @property
    def rms(self) -> float:
        """The root of the mean square."""
        return math.sqrt(self._squares / self.tested) if self.tested else 0.0


class FilterWatch:
    """Follows a vehicle's filter, which is a model.

    Args:
        vehicle: fresh, and with a filter.

    Attributes:
        listeners: called with each sample and its outcome.
        lookers: called at each ``look``.
        innovations: by kind, of the samples that were tested.

    Raises:
        ValueError: the vehicle follows a log in place of a filter.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        if not isinstance(vehicle.ahrs, Ekf3Ahrs):
            raise ValueError("a vehicle without a filter")
        self._clock = vehicle.clock
        self._ahrs = vehicle.ahrs
        self._ahrs.on_filter_outcome = self._take
        self._modes = [(0, AidingMode.NONE)]
        self._end_us: int | None = None
        self.listeners: list[Callable[[SampleTest], None]] = []
        self.lookers: list[Callable[[], None]] = []
        self.innovations: dict[str, Innovations] = {}

    def _take(self, outcome: FilterOutcome) -> None:
        kind, rule, _, ratio, innovation = outcome
        if ratio is not None and innovation is not None:
            of_kind = self.innovations.get(kind) or self.innovations.setdefault(kind, Innovations())
            of_kind.add(innovation, ratio, is_rejected=outcome_kind(rule) is _REJECTED)
        test = SampleTest(self._clock.micros64(), outcome)
        for listener in self.listeners:
            listener(test)

    def look(self) -> None:
        """Note how the filter navigates; called after each pass of the main loop."""
        mode = self.mode()
        if mode is not self._modes[-1][1]:
            self._modes.append((self._clock.micros64(), mode))
        for look in self.lookers:
            look()

    def end(self) -> None:
        """Stop the filter, and the watch."""
        self._ahrs.stop()
        self._end_us = self._clock.micros64()

    def mode(self) -> AidingMode:
        """Return how the filter navigates."""
        return self._ahrs.aiding_mode()

    def aiding(self) -> list[AidingSpan]:
        """Return how the filter has navigated, from boot until now, or until it ended."""
        end_us = self._clock.micros64() if self._end_us is None else self._end_us
        ends = [*(time_us for time_us, _ in self._modes[1:]), end_us]
        return [AidingSpan(start_us, end_us, mode) for (start_us, mode), end_us in zip(self._modes, ends, strict=True)]


OUTCOME_WAIT_US: Final = 500_000
"""How long a message waits for the outcomes of its samples in the filter; that takes some 60 to 250 ms."""


@dataclass(eq=False, slots=True)
class HandedSample:
    """A sample that a message handed to the filter, and its outcome so far.

    A pose has two outcomes where height comes from it as well: ``pose``, of its north and east, and ``height``.
    """

    kind: str
    observed_ms: int
    outcomes: list[SampleTest] = field(default_factory=list)

    @property
    def is_settled(self) -> bool:
        """Return whether the filter has decided about it."""
        return any(test.outcome.kind == self.kind for test in self.outcomes)

    def outcomes_as_dicts(self) -> list[dict[str, object]]:
        """Return its outcomes for machines, each with its time in us since boot."""
        return [{"time_us": test.time_us, **as_dict(test.outcome)} for test in self.outcomes]


class SampleOutcomes:
    """Brings samples and their outcomes together; a listener of ``FilterWatch``.

    Samples leave the filter in the order in which they came, so those of one kind and time are told apart by that.
    """

    def __init__(self) -> None:
        self._handed: list[HandedSample] = []
        self._waiting: defaultdict[tuple[str, int], list[HandedSample]] = defaultdict(list)

    def take(self, test: SampleTest) -> None:
        """Take an outcome of the filter."""
        kind, rule, observed_ms, *_ = test.outcome
        if not is_final(rule):
            sample = HandedSample(kind, observed_ms)
            self._handed.append(sample)
            self._waiting[kind, observed_ms].append(sample)
        elif outcome_kind(rule) is OutcomeKind.REFUSED:
            self._handed.append(HandedSample(kind, observed_ms, [test]))
        elif kind == "height":
            # Of several poses of one time only the last is used.
            for sample in self._waiting.get(("pose", observed_ms), [])[-1:]:
                sample.outcomes.append(test)
        else:
            for sample in self._waiting.get((kind, observed_ms), ()):
                if not sample.is_settled:
                    sample.outcomes.append(test)
                    break

    def take_handed(self) -> tuple[HandedSample, ...]:
        """Return, once, the samples handed in since the last call: those of the message just handled."""
        handed, self._handed = tuple(self._handed), []
        return handed

    def forget(self, samples: Iterable[HandedSample]) -> None:
        """Stop waiting for the outcomes of samples."""
        for sample in samples:
            waiting = self._waiting.get((sample.kind, sample.observed_ms), [])
            if sample in waiting:
                waiting.remove(sample)
            if not waiting:
                self._waiting.pop((sample.kind, sample.observed_ms), None)
