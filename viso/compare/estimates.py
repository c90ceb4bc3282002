# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's estimates over a log beside the log's own, by the targets of ``viso ekf``."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from viso.compare.differences import Error, Tolerances, apart, error_of
from viso.compare.events import EventComparison, changes, compare_changes, compare_moves, compare_texts
from viso.compare.tolerances import (
    AFTER_EVENT_S,
    AFTER_RESET_S,
    BENCH,
    EQUAL_SHARE,
    UNDECIDED,
    UNITS,
    Tolerance,
    tolerances_of,
)
from viso.estimators.series import Array, Mask
from viso.replay.ekf.run import FIELDS, LABELS, EkfReplay

AIDING: Final = ("is using external nav data", "started relative aiding", "is using GPS")
MEASURED: Final = LABELS[: LABELS.index("SV")]
RATIOS: Final = ("SV", "SP", "SH")
_HEIGHT_JUMP_M: Final = 0.2


@dataclass(frozen=True, slots=True)
class Check:
    """One comparison: its figure, and its target, empty if there is none."""

    what: str
    figure: str
    target: str
    passed: bool


@dataclass(frozen=True, slots=True)
class EstimateComparison:
    """The comparison of a core's estimates with a log's.

    Attributes:
        records: the number of estimates that count.
        errors: the errors over these estimates, by label.
        equal: the shares of records with the same TS, SS and both; 0 if no record counts.
        aiding_s: when aiding starts first, ours and the log's, in s since boot; None where it does not.
        texts: what differs in the texts.
        checks: all comparisons.
    """

    records: int
    errors: Mapping[str, Error]
    equal: Mapping[str, float]
    aiding_s: tuple[float | None, float | None]
    texts: EventComparison
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether all targets are met."""
        return all(check.passed for check in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison for machines."""
        return {**asdict(self), "texts": self.texts.as_dict()}


def compare_estimates(replay: EkfReplay, kind: str) -> EstimateComparison:
    """Compare by the targets of a kind: BENCH by the times of events, FLIGHT by the errors of estimates."""
    tolerances, is_bench = tolerances_of(kind), kind == BENCH
    texts = compare_texts("MSG", replay.recorded_texts, replay.our_texts, tolerances)
    aiding_s = _aiding_start(replay.our_texts), _aiding_start(replay.recorded_texts)
    window = _outside_events(replay) if is_bench else replay.time_s >= (aiding_s[1] or 0.0)
    counted = dict.fromkeys(MEASURED, window)
    if not is_bench:
        counted["PD"] = window & _outside(replay.time_s, _resets(replay), AFTER_RESET_S)
    errors = {
        label: error_of(apart(FIELDS[label], replay.recorded[label], replay.ours[label])[counted[label]])
        for label in MEASURED
    }
    everything = np.ones_like(window) if is_bench else window
    equal = {label: _equal(replay, (label,), everything) for label in ("TS", "SS")}
    equal["both"] = _equal(replay, ("TS", "SS"), everything)
    checks = [
        *(_check_error(label, errors[label], tolerances.get(FIELDS[label])) for label in MEASURED),
        *(_check_sides(replay, label) for label in RATIOS if is_bench),
        *(_check_events(replay, tolerances) if is_bench else ()),
        _check_equal(equal, None if is_bench else EQUAL_SHARE),
        _check_differences("texts", texts, tolerances["MSG.TimeUS"]),
    ]
    return EstimateComparison(int(window.sum()), errors, equal, aiding_s, texts, tuple(checks))


# Which records count


def _aiding_start(texts: Sequence[tuple[float, str]]) -> float | None:
    return next((time_s for time_s, text in texts if text.startswith(AIDING)), None)


def _outside(time_s: Array, events_s: Sequence[float], after_s: float) -> Mask:
    """Return which times are not within ``after_s`` after any event."""
    outside: Mask = np.ones(time_s.shape, dtype=np.bool_)
    for event_s in events_s:
        outside &= (time_s < event_s) | (time_s > event_s + after_s)
    return outside


def _resets(replay: EkfReplay) -> list[float]:
    """Return the times of position resets in the log, and of height resets, which no record has."""
    starts = [time_s for time_s, text in replay.recorded_texts if text.startswith((*AIDING, "stopped aiding"))]
    moves = [time_s for time_s, _ in changes(replay.time_s, _moves(replay.recorded))]
    return [*starts, *moves, *_height_steps(replay)]


def _height_steps(replay: EkfReplay) -> list[float]:
    """Return the times of the log's records after which height jumps.

    Height jumps where its change does not follow from velocity, in one step: ordinary corrections are smoothed in the
    outputs.
    """
    time_s, down, velocity = replay.time_s, replay.recorded["PD"], replay.recorded["VD"]
    beyond = np.diff(down, prepend=down[:1])
    beyond[1:] -= 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time_s)
    jumps = (np.abs(beyond) > _HEIGHT_JUMP_M) & (np.abs(np.diff(beyond, prepend=0.0)) > _HEIGHT_JUMP_M)
    before: list[float] = time_s[np.flatnonzero(jumps) - 1].tolist()
    return before


def _moves(values: dict[str, Array]) -> list[tuple[float, float]]:
    return list(zip(values["OFN"].tolist(), values["OFE"].tolist(), strict=True))


def _outside_events(replay: EkfReplay) -> Mask:
    """Return which records are not within a second after an event in the log."""
    events = [time_s for time_s, _ in replay.recorded_texts]
    for label in ("TS", "SS"):
        events += [time_s for time_s, _ in changes(replay.time_s, replay.recorded[label].tolist())]
    return _outside(replay.time_s, [*events, *_resets(replay)], AFTER_EVENT_S)


# Figures


def _equal(replay: EkfReplay, labels: Sequence[str], counted: Mask) -> float:
    same = np.logical_and.reduce([replay.ours[label] == replay.recorded[label] for label in labels])[counted]
    return float(same.mean()) if same.size else 0.0


# Checks


def _check_error(label: str, error: Error, target: Tolerance | None) -> Check:
    unit = UNITS[FIELDS[label]]
    figure = f"{error.rms:.3g} {unit} rms, {error.worst:.3g} {unit} at worst"
    if target is None:
        return Check(label, figure, "", passed=True)
    return Check(label, figure, target.limits(), error.is_within(target))


def _check_equal(equal: Mapping[str, float], share: float | None) -> Check:
    figure = f"{100 * equal['both']:.2f} % (TS {100 * equal['TS']:.2f} %, SS {100 * equal['SS']:.2f} %)"
    if share is None:
        return Check("TS and SS equal", figure, "", passed=True)
    return Check("TS and SS equal", figure, f"{100 * share:g} %", equal["both"] >= share)


def _check_differences(what: str, found: EventComparison, times: Tolerance) -> Check:
    return Check(what, str(found), f"equal, within {times.limits()}", not found.differences)


def _check_events(replay: EkfReplay, tolerances: Tolerances) -> list[Check]:
    found = {
        f"{label} changes": compare_changes(
            FIELDS[label],
            changes(replay.time_s, replay.recorded[label].tolist(), with_first=True),
            changes(replay.time_s, replay.ours[label].tolist(), with_first=True),
            tolerances,
        )
        for label in ("TS", "SS")
    }
    recorded, ours = (changes(replay.time_s, _moves(values)) for values in (replay.recorded, replay.ours))
    found["resets (OFN, OFE)"] = compare_moves(recorded, ours, tolerances)
    times = tolerances["XKF4.TimeUS"]
    return [_check_differences(what, differences, times) for what, differences in found.items()]


def _check_sides(replay: EkfReplay, label: str) -> Check:
    ours, recorded = replay.ours[label], replay.recorded[label]
    low, high = UNDECIDED
    wrong = ((ours > 1) != (recorded > 1)) & ((recorded < low) | (recorded > high))
    return Check(f"{label} side of 1", f"{int(wrong.sum())} of {wrong.size} differ", "none", not wrong.any())
