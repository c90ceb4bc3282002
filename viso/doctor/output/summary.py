# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the autopilot would do with a stream, in a few figures."""

import itertools
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from ap_core.verdict import VerdictKind
from ekf_stub.ahrs.sources import EXTNAV
from ekf_stub.reports import AidingMode
from viso.doctor.checks import limits
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.lags import lateness_ms, shows_lags
from viso.doctor.evidence.own_filter import CHANNELS, HEIGHT, NOT_KNOWN, VELOCITY, Witness, source_name
from viso.streams.stream_kinds import Aspect
from viso.vehicle.outcomes import OutcomeKind, outcome_kind

LAG_EDGES_MS: Final = (5, 10, 20, 50, 100, 200, 500)


@dataclass(frozen=True, slots=True)
class Lags:
    """How late messages of one type arrive by their stamps, compared with the quickest messages around them.

    Attributes:
        sender: who sends what.
        median_ms, p99_ms, worst_ms: of all.
        counts: below 5, 10, 20, 50, 100, 200, 500 ms, and above.
    """

    sender: str
    median_ms: float
    p99_ms: float
    worst_ms: float
    counts: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class OwnFilterSummary:
    """What the recorded vehicle's own filter reported.

    Attributes:
        witness: a log or telemetry.
        record: such as XKF4.
        running_s: for how long it had an attitude.
        positioned_s: the part of it with a position, or a velocity, by external navigation.
        worst: the largest square root of a test ratio by channel, while the filter could use its source.
        sources: the last source of those channels, as far as it is known.
    """

    witness: Witness
    record: str
    running_s: float
    positioned_s: float
    worst: Mapping[str, float]
    sources: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Summary:
    """What the autopilot would do.

    Attributes:
        outcomes: messages by type and outcome, external navigation only.
        rate_hz: of messages by type.
        samples: in the filter by kind and outcome; a model's opinion, except for refused ones.
        healthy_from_us: when the first message was accepted or ignored; None if none was.
        unhealthy: how often the sensor turned unhealthy before the end.
        aiding_from_us: when the filter would navigate by it first, a model's opinion; None if never.
        aiding_until_us: when it would stop for good; None if it never starts or goes on to the end.
        lags: of each sender's messages of each type; none if the recording has no times of arrival, or the sender's
            clock does not run as the autopilot's.
        own: what the vehicle's own filter reported; None if nothing is recorded of it.
    """

    outcomes: Mapping[tuple[str, VerdictKind], int]
    rate_hz: Mapping[str, float]
    samples: Mapping[tuple[str, OutcomeKind], int]
    healthy_from_us: int | None
    unhealthy: int
    aiding_from_us: int | None
    aiding_until_us: int | None
    lags: tuple[Lags, ...]
    own: OwnFilterSummary | None = None

    def as_dict(self) -> dict[str, object]:
        """Return the summary for machine-readable output."""
        return {
            "messages": [
                {"message": name, "outcome": outcome.value, "count": count}
                for (name, outcome), count in sorted(self.outcomes.items())
            ],
            "rate_hz": {name: round(rate, 2) for name, rate in sorted(self.rate_hz.items())},
            "samples": [
                {"kind": kind, "outcome": outcome.value, "count": count, "model": outcome is not OutcomeKind.REFUSED}
                for (kind, outcome), count in sorted(self.samples.items())
            ],
            "healthy_from_us": self.healthy_from_us,
            "unhealthy": self.unhealthy,
            "aiding_from_us": self.aiding_from_us,
            "aiding_until_us": self.aiding_until_us,
            "lags": [
                {
                    "sender": lag.sender,
                    "median_ms": round(lag.median_ms, 1),
                    "p99_ms": round(lag.p99_ms, 1),
                    "worst_ms": round(lag.worst_ms, 1),
                    "edges_ms": list(LAG_EDGES_MS),
                    "counts": list(lag.counts),
                }
                for lag in self.lags
            ],
            "own_filter": None if self.own is None else asdict(self.own),
        }


def _own_filter_summary(evidence: Evidence) -> OwnFilterSummary | None:
    own = evidence.vehicle.own_filter
    if own is None or not own.record:
        return None
    step_s, usable = own.step_s, own.usable
    worst = np.nanmax(np.where(usable & np.isfinite(own.ratios), own.ratios, -1.0), axis=0, initial=-1.0)
    largest = {name: round(value, 2) for name, value in zip(CHANNELS, worst.tolist(), strict=True) if value >= 0}
    by = {name: own.source(number) for number, name in enumerate(CHANNELS) if name in largest}
    sources = {name: source_name(CHANNELS.index(name), source) for name, source in by.items() if source != NOT_KNOWN}
    height = evidence.height_by_extnav
    if height is not None and height.is_rare and own.source(HEIGHT) == EXTNAV and CHANNELS[HEIGHT] in sources:
        sources[CHANNELS[HEIGHT]] = "barometer, by the model, as no fresh ExtNav came"
    if evidence.velocities_of_other_sets and CHANNELS[VELOCITY] in sources:
        sources[CHANNELS[VELOCITY]] += " and ExtNav, by EK3_SRC_OPTIONS"
    running_s, positioned_s = (float(step_s[mask].sum()) for mask in (own.running, own.uses_extnav))
    return OwnFilterSummary(own.witness, own.record, running_s, positioned_s, largest, sources)


def _lags(evidence: Evidence) -> tuple[Lags, ...]:
    found = []
    for track in evidence.stream.tracks:
        if shows_lags(track):
            lag = lateness_ms(track)
            counts = np.bincount(np.searchsorted(LAG_EDGES_MS, lag, side="right"), minlength=len(LAG_EDGES_MS) + 1)
            median, high = (float(value) for value in np.quantile(lag, [0.5, 0.99]))
            found.append(Lags(str(track.sender), median, high, float(lag.max()), tuple(counts.tolist())))
    return tuple(found)


def _rates(evidence: Evidence) -> dict[str, float]:
    spans: dict[str, list[int]] = {}
    for message in evidence.stream.vision:
        spans.setdefault(message.name, []).append(message.arrival_us)
    return {name: 1e6 * (len(at) - 1) / (at[-1] - at[0]) for name, at in spans.items() if at[-1] > at[0]}


def _samples(evidence: Evidence) -> Counter[tuple[str, OutcomeKind]]:
    counts: Counter[tuple[str, OutcomeKind]] = Counter()
    for message in evidence.stream.vision:
        for sample in message.samples:
            counts.update((test.outcome.kind, outcome_kind(test.outcome.rule)) for test in sample.outcomes)
    return counts


def summarise(evidence: Evidence) -> Summary:
    """Return what the autopilot would do with the stream."""
    taken = [message.arrival_us for message in evidence.stream.vision if message.is_taken]
    aided = [span for span in evidence.trial.aiding if span.mode is not AidingMode.NONE]
    goes_on = bool(aided) and aided[-1] == evidence.trial.aiding[-1]
    return Summary(
        outcomes=Counter((message.name, message.verdict.kind) for message in evidence.stream.vision),
        rate_hz=_rates(evidence),
        samples=_samples(evidence),
        healthy_from_us=taken[0] if taken else None,
        unhealthy=sum(later - earlier >= limits.HEALTHY_US for earlier, later in itertools.pairwise(taken)),
        aiding_from_us=aided[0].start_us if aided else None,
        aiding_until_us=aided[-1].end_us if aided and not goes_on else None,
        lags=() if Aspect.ARRIVAL in evidence.stream.lacks else _lags(evidence),
        own=_own_filter_summary(evidence),
    )
