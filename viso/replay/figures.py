# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a replay: share of samples used, innovations, and times of aiding."""

import math
import statistics
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ap_core.verdict import VerdictKind
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.core.odometry import GATE_SIGMAS
from ekf_stub.inputs.measurements import Array
from ekf_stub.reports import AidingMode
from mav_handlers.handlers import VISION_NAMES
from viso.geometry.errors import EvaluationError, absolute_error
from viso.geometry.trajectory import Trajectory
from viso.replay.agreement import Agreement, agreement_of
from viso.replay.feed import ReplayedMessage
from viso.replay.run import ReplayOutcome
from viso.vehicle.outcomes import (
    UNITS,
    AidingSpan,
    FilterCounts,
    FilterWatch,
    OutcomeKind,
    SampleTest,
    final_counts,
    outcome_kind,
)
from viso.vehicle.sensors.flight import Basis
from viso.vehicle.vehicle import Vehicle

Figure = float | int | None
Row = dict[str, Any]
"""Figures by column, and under ``BY_TIME`` their sums over time."""

BY_TIME: Final = "by_time"
"""Sums of innovations over equal spans of time: the length of a span in s, and by kind rows of the number of the span,
the count of samples, and their sums of squares, normalised and not."""

MOST_SPANS: Final = 64

_GATES: Final[Mapping[str, str]] = {
    "pose": "EK3_POS_I_GATE",
    "height": "EK3_HGT_I_GATE",
    "velocity": "EK3_VEL_I_GATE",
    "yaw": "EK3_YAW_I_GATE",
}
_TIME, _CORRECTED = 0, 2  # of VISP and VISV: TimeUS, CTimeMS
_STAMPED: Final = ("VISP", "VISV")
_WARNING: Final = 4  # MAV_SEVERITY


@dataclass(frozen=True, slots=True)
class Objective:
    """A column of figures: its unit, empty for none, and its meaning."""

    unit: str
    what: str


OBJECTIVES: Final[Mapping[str, Objective]] = {
    "fused_share": Objective(
        "", "what the filter used of what arrived: of messages whose data it got, of samples it has a use for"
    ),
    "nis": Objective("", "mean normalised innovation squared of all samples tested; 1 if the noises fit"),
    **{f"nis_{kind}": Objective("", f"the same, of {kind} alone") for kind in UNITS},
    **{f"rms_{kind}": Objective(unit, f"innovations of {kind}, rms") for kind, unit in UNITS.items()},
    "worst_ratio": Objective("", "the largest innovation of all, in gates"),
    "tested": Objective("", "samples tested"),
    "rejected": Objective("", "samples that a gate held back"),
    "lost": Objective("", "samples whose turn never came"),
    "refused": Objective("", "samples that were not let in"),
    "resets": Objective("", "how often the filter was set to a sample"),
    "time_to_aiding_s": Objective("s", "when the filter first navigated by external navigation, since boot"),
    "aiding_share": Objective("", "of the time from then on, how much it did"),
    "aiding_losses": Objective("", "how often it stopped"),
    "ate_m": Objective("m", "how far its positions are from the reference, aligned, root of the mean square"),
    "ate_poses": Objective("", "positions compared with the reference"),
    "log_m": Objective("m", "how far they are from those of the log that is flown again, root of the mean square"),
    "messages": Objective("", "messages of external navigation that arrived"),
    "accepted_share": Objective("", "those whose data went to the filter, of all"),
    "ignored": Objective("", "those whose data was withheld from it"),
    "dropped": Objective("", "those without effect"),
    "texts": Objective("", "texts for the ground station"),
    "warnings": Objective("", "those among them that warn, or worse"),
    "stamp_lag_ms": Objective("ms", "by how much corrected stamps are before the arrival, median"),
}
"""The columns, in their order."""

LOWER_IS_BETTER: Final = frozenset(
    {
        "nis",
        "worst_ratio",
        "rejected",
        "lost",
        "refused",
        "resets",
        "time_to_aiding_s",
        "aiding_losses",
        "ate_m",
        "log_m",
    }
    | {"ignored", "dropped", "texts", "warnings"}
    | {f"{what}_{kind}" for what in ("nis", "rms") for kind in UNITS}
)
"""The columns whose minimum is the best; of others it is the maximum."""


class _Squares:
    """Sums over the samples of a kind."""

    def __init__(self) -> None:
        self.tested = 0
        self.normalised = self.innovation = self.worst_ratio = 0.0

    def add(self, ratio: float, sigmas: float, innovation: float) -> None:
        self.tested += 1
        self.normalised += sigmas**2
        self.innovation += innovation**2
        self.worst_ratio = max(self.worst_ratio, ratio)


class _ByTime:
    """Sums over spans of time, which double in length when there are too many."""

    def __init__(self) -> None:
        self._span_s = 1
        self._sums: dict[tuple[str, int], list[float]] = {}

    def add(self, kind: str, time_us: int, squares: tuple[float, float]) -> None:
        while time_us // (self._span_s * 1_000_000) >= MOST_SPANS:
            before, self._sums = self._sums, {}
            self._span_s *= 2
            for (other, number), sums in before.items():
                self._add(other, number // 2, sums)
        self._add(kind, time_us // (self._span_s * 1_000_000), (1, *squares))

    def _add(self, kind: str, number: int, sums: Sequence[float]) -> None:
        known = self._sums.get((kind, number), (0, 0.0, 0.0))
        self._sums[kind, number] = [one + other for one, other in zip(known, sums, strict=True)]

    def as_dict(self) -> dict[str, Any]:
        sums: dict[str, list[list[float]]] = {}
        for (kind, number), of_span in self._sums.items():
            sums.setdefault(kind, []).append([number, *of_span])
        return {"span_s": self._span_s, "sums": sums}


class Judge:
    """Follows a replay and returns its row of figures; ``truth`` is the path of the vehicle, by times since boot.

    ``basis`` is the source of the vehicle's motion, with ``notes`` on it, if it repeats a log's flight.
    """

    def __init__(self, truth: Trajectory | None = None) -> None:
        self._truth = truth
        self._squares: dict[str, _Squares] = {}
        self._by_time = _ByTime()
        self._track: Array = np.zeros((0, 4))
        self.basis: Basis | None = None
        self.notes: tuple[str, ...] = ()
        self._lags_ms: list[float] = []
        self._places: dict[int, tuple[float, float, float]] = {}
        self._vehicle: Vehicle | None = None
        self._gate_of: Callable[[str], float] = lambda _kind: math.nan

    def start(self, vehicle: Vehicle, watch: FilterWatch | None) -> None:
        """Observe a vehicle from boot on."""
        self._vehicle = vehicle
        self._gate_of = _gates(vehicle)
        flight = vehicle.source.flight
        if flight is not None:
            self._track, self.basis, self.notes = flight.track, flight.basis, flight.told()
        if watch is not None:
            watch.listeners.append(self._take_test)

    def _take_test(self, test: SampleTest) -> None:
        time_us, (kind, _, _, ratio, innovation) = test
        if ratio is None or innovation is None or not math.isfinite(ratio):
            return
        sigmas = ratio * self._gate_of(kind)
        squares = self._squares.get(kind) or self._squares.setdefault(kind, _Squares())
        squares.add(ratio, sigmas, innovation)
        self._by_time.add(kind, time_us, (sigmas**2, innovation**2))

    def take_message(self, message: ReplayedMessage) -> None:
        """Add the outcome of a message."""
        for name, values in message.records:
            if name in _STAMPED:
                time_us, corrected_ms = values[_TIME], values[_CORRECTED]
                assert isinstance(time_us, int)
                assert isinstance(corrected_ms, int)
                self._lags_ms.append(time_us * 1e-3 - corrected_ms)
        if self._truth is not None or len(self._track):
            self._note_place()

    def _note_place(self) -> None:
        vehicle = self._vehicle
        ahrs = None if vehicle is None else vehicle.ahrs
        if vehicle is None or not isinstance(ahrs, Ekf3Ahrs) or ahrs.core is None:
            return
        if ahrs.aiding_mode() is not AidingMode.NONE:
            self._places[vehicle.clock.micros64()] = ahrs.core.position()

    def row(self, outcome: ReplayOutcome) -> Row:
        """Return the figures of a finished replay, one for each column of ``OBJECTIVES``, and ``BY_TIME``."""
        row: Row = dict.fromkeys(OBJECTIVES)
        row |= _of_messages(outcome)
        if self._lags_ms:
            row["stamp_lag_ms"] = statistics.median(self._lags_ms)
        if outcome.aiding is not None:
            row |= _of_samples(outcome.filter_counts)
            row["fused_share"] = _product(row["fused_share"], row["accepted_share"])
            row |= self._of_innovations()
            row |= _of_aiding(outcome.aiding)
            row |= self._of_places()
        row[BY_TIME] = self._by_time.as_dict()
        return row

    def _of_innovations(self) -> Row:
        squares = self._squares.values()
        tested = sum(square_sum.tested for square_sum in squares)
        row: Row = {"tested": tested}
        if not tested:
            return row
        row["nis"] = sum(square_sum.normalised for square_sum in squares) / tested
        row["worst_ratio"] = max(square_sum.worst_ratio for square_sum in squares)
        for kind, square_sum in self._squares.items():
            row[f"nis_{kind}"] = square_sum.normalised / square_sum.tested
            row[f"rms_{kind}"] = math.sqrt(square_sum.innovation / square_sum.tested)
        return row

    def _timed(self) -> tuple[Array, Array]:
        times_us = sorted(self._places)
        places = np.array([self._places[time_us] for time_us in times_us]).reshape(-1, 3)
        return np.array(times_us, np.float64), places

    def agreement(self) -> Agreement | None:
        """Return how near the positions were to those of the log that is flown again; None if that is not known."""
        return agreement_of(*self._timed(), self._track)

    def _of_places(self) -> Row:
        times_us, places = self._timed()
        agreement = self.agreement()
        row: Row = {"log_m": None if agreement is None else agreement.position_m}
        if self._truth is None:
            return row
        estimate = timed_places(times_us.astype(np.int64), places)
        try:
            error = absolute_error(estimate, self._truth)
        except EvaluationError:
            return {**row, "ate_poses": 0}
        return {**row, "ate_m": error.rmse_m, "ate_poses": error.count}


def timed_places(time_us: npt.NDArray[np.int64], places: Array) -> Trajectory:
    """Return positions over time, without attitudes and without those not later than the previous one."""
    kept = np.diff(time_us, prepend=-1) > 0
    return Trajectory(time_us[kept] * 1000, places[kept], np.tile((1.0, 0.0, 0.0, 0.0), (kept.sum(), 1)))


def _gates(vehicle: Vehicle) -> Callable[[str], float]:
    """Return a function from a kind of sample to its gate in standard deviations, by the present parameters."""
    known: dict[str, float] = {}
    generation = -1

    def gate_of(kind: str) -> float:
        nonlocal generation
        if vehicle.params.generation != generation:
            generation = vehicle.params.generation
            known.clear()
        if kind not in known:
            known[kind] = _gate(vehicle, kind)
        return known[kind]

    return gate_of


def _gate(vehicle: Vehicle, kind: str) -> float:
    found = vehicle.params.find(_GATES[kind]) if kind in _GATES else None
    return GATE_SIGMAS if found is None else max(0.01 * float(found.value), 1.0)


def _of_messages(outcome: ReplayOutcome) -> Row:
    counts: Counter[VerdictKind] = Counter()
    for (name, verdict, _), count in outcome.verdicts.items():
        if name in VISION_NAMES:
            counts[verdict] += count
    return {
        "messages": counts.total(),
        "accepted_share": counts[VerdictKind.ACCEPTED] / counts.total() if counts else None,
        "ignored": counts[VerdictKind.IGNORED],
        "dropped": counts[VerdictKind.DROPPED],
        "texts": len(outcome.texts),
        "warnings": sum(text.severity <= _WARNING for text in outcome.texts),
    }


def _product(share: Figure, other: Figure) -> Figure:
    return None if share is None or other is None else share * other


def _of_samples(counts: FilterCounts) -> Row:
    outcomes: Counter[OutcomeKind] = Counter()
    for _, rule, count in final_counts(counts):
        outcomes[outcome_kind(rule)] += count
    useful = outcomes.total() - outcomes[OutcomeKind.UNUSED]
    return {
        "fused_share": (outcomes[OutcomeKind.FUSED] + outcomes[OutcomeKind.RESET]) / useful if useful else 0.0,
        "rejected": outcomes[OutcomeKind.REJECTED],
        "lost": outcomes[OutcomeKind.LOST],
        "refused": outcomes[OutcomeKind.REFUSED],
        "resets": outcomes[OutcomeKind.RESET],
    }


def _of_aiding(spans: tuple[AidingSpan, ...]) -> Row:
    aided = [span for span in spans if span.mode is not AidingMode.NONE]
    if not aided:
        return {"time_to_aiding_s": None, "aiding_share": 0.0, "aiding_losses": 0}
    since_us = spans[-1].end_us - aided[0].start_us
    aided_us = sum(span.end_us - span.start_us for span in aided)
    after = spans[spans.index(aided[0]) :]
    return {
        "time_to_aiding_s": aided[0].start_us * 1e-6,
        "aiding_share": aided_us / since_us if since_us else 1.0,
        "aiding_losses": sum(span.mode is AidingMode.NONE for span in after),
    }
