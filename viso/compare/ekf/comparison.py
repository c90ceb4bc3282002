# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Judges the filter's estimates by a log's own."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from ekf_stub.inputs.inertial import Array
from viso.compare.ekf import targets
from viso.compare.ekf.events import Differences, changes, compare_moves, compare_texts, compare_values
from viso.compare.ekf.run import LABELS, EkfReplay

AIDING: Final = ("is using external nav data", "started relative aiding", "is using GPS")
MEASURED: Final = LABELS[: LABELS.index("SV")]
RATIOS: Final = ("SV", "SP", "SH")
_HEIGHT_JUMP_M: Final = 0.2

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that is compared: what it came to, and what it is to come to; empty when nothing is asked."""

    what: str
    figure: str
    target: str
    passed: bool


@dataclass(frozen=True, slots=True)
class Error:
    """How far apart a quantity is, in its unit."""

    rms: float
    worst: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """How near the filter comes to a log.

    Attributes:
        records: how many estimates count.
        errors: by label, over those estimates.
        equal: the share of records with the same value, of TS, of SS and of both; 0 when no record counts.
        aiding_s: when aiding starts first, ours and the log's; None where it does not.
        texts: what differs in the texts.
        checks: all that was compared.
    """

    records: int
    errors: dict[str, Error]
    equal: dict[str, float]
    aiding_s: tuple[float | None, float | None]
    texts: Differences
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Return whether nothing that was asked is missed."""
        return all(check.passed for check in self.checks)


def compare(replay: EkfReplay, *, bench: bool) -> Comparison:
    """Judge a run, a bench by its events, any other by its estimates."""
    texts = compare_texts(replay.our_texts, replay.recorded_texts)
    aiding_s = _aiding_start(replay.our_texts), _aiding_start(replay.recorded_texts)
    window = _outside_events(replay) if bench else replay.time_s >= (aiding_s[1] or 0.0)
    counted = dict.fromkeys(MEASURED, window)
    if not bench:
        counted["PD"] = window & _outside(replay.time_s, _resets(replay), targets.AFTER_RESET_S)
    errors = {label: _error(replay, label, counted[label]) for label in MEASURED}
    everything = np.ones_like(window) if bench else window
    equal = {label: _equal(replay, (label,), everything) for label in ("TS", "SS")}
    equal["both"] = _equal(replay, ("TS", "SS"), everything)
    limits = targets.BENCH_LIMITS if bench else targets.FLIGHT_LIMITS
    checks = [
        *(_check_error(label, errors[label], limits.get(label)) for label in MEASURED),
        *(_check_sides(replay, label) for label in RATIOS if bench),
        *(_check_events(replay) if bench else ()),
        _check_equal(equal, None if bench else targets.EQUAL_SHARE),
        _check_differences("texts", texts),
    ]
    return Comparison(int(window.sum()), errors, equal, aiding_s, texts, tuple(checks))


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
    """Return when the log's position was reset: what moved it, and its height, of which no record tells."""
    starts = [time_s for time_s, text in replay.recorded_texts if text.startswith((*AIDING, "stopped aiding"))]
    moves = [time_s for time_s, _ in changes(replay.time_s, _moves(replay.recorded))]
    return [*starts, *moves, *_height_steps(replay)]


def _height_steps(replay: EkfReplay) -> list[float]:
    """Return the times of the log's records after which height jumps.

    It jumps where it gets to a place to which velocity does not bring it, and did not do so before: the outputs glide
    after what the filter corrects.
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
    """Return which records are not within a second after anything that the log tells of."""
    events = [time_s for time_s, _ in replay.recorded_texts]
    for label in ("TS", "SS"):
        events += [time_s for time_s, _ in changes(replay.time_s, replay.recorded[label].tolist())]
    return _outside(replay.time_s, [*events, *_resets(replay)], targets.AFTER_EVENT_S)


# Figures


def _error(replay: EkfReplay, label: str, counted: Mask) -> Error:
    difference = (replay.ours[label] - replay.recorded[label])[counted]
    if label == "Yaw":
        difference = (difference + 180) % 360 - 180
    if not difference.size:
        return Error(0.0, 0.0)
    return Error(float(np.sqrt(np.mean(difference**2))), float(np.abs(difference).max()))


def _equal(replay: EkfReplay, labels: Sequence[str], counted: Mask) -> float:
    same = np.logical_and.reduce([replay.ours[label] == replay.recorded[label] for label in labels])[counted]
    return float(same.mean()) if same.size else 0.0


# Checks


def _check_error(label: str, error: Error, limit: targets.Limit | None) -> Check:
    figure = _figures(label, error.rms, error.worst)
    if limit is None:
        return Check(label, figure, "", passed=True)
    passed = error.rms <= limit.rms and error.worst <= limit.worst
    return Check(label, figure, _figures(label, limit.rms, limit.worst), passed)


def _figures(label: str, rms: float, worst: float) -> str:
    unit = targets.UNITS[label]
    at_worst = f", {worst:.3g} {unit} at worst" if math.isfinite(worst) else ""
    return f"{rms:.3g} {unit} rms{at_worst}"


def _check_equal(equal: Mapping[str, float], share: float | None) -> Check:
    figure = f"{100 * equal['both']:.2f} % (TS {100 * equal['TS']:.2f} %, SS {100 * equal['SS']:.2f} %)"
    if share is None:
        return Check("TS and SS equal", figure, "", passed=True)
    return Check("TS and SS equal", figure, f"{100 * share:g} %", equal["both"] >= share)


def _check_differences(what: str, found: Differences) -> Check:
    figure = f"{len(found.lines)} differ" if found.lines else f"{found.matched} equal, within {found.worst_s:.3f} s"
    return Check(what, figure, f"equal, within {targets.WITHIN_S} s", not found.lines)


def _check_events(replay: EkfReplay) -> list[Check]:
    found = {
        f"{label} changes": compare_values(
            label,
            changes(replay.time_s, replay.ours[label].tolist(), with_first=True),
            changes(replay.time_s, replay.recorded[label].tolist(), with_first=True),
        )
        for label in ("TS", "SS")
    }
    ours, recorded = (changes(replay.time_s, _moves(values)) for values in (replay.ours, replay.recorded))
    found["resets (OFN, OFE)"] = compare_moves(ours, recorded)
    return [_check_differences(what, differences) for what, differences in found.items()]


def _check_sides(replay: EkfReplay, label: str) -> Check:
    ours, recorded = replay.ours[label], replay.recorded[label]
    low, high = targets.UNDECIDED
    wrong = ((ours > 1) != (recorded > 1)) & ((recorded < low) | (recorded > high))
    return Check(f"{label} side of 1", f"{int(wrong.sum())} of {wrong.size} differ", "none", not wrong.any())
