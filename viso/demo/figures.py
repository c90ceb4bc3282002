# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A closed loop in figures: how good both ends were, in which states, and the outcome of the messages."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from rich.table import Column, Table

from ap_core.verdict import VerdictKind
from viso.demo.errors import PoseErrors, estimate_errors, odometry_errors, truth
from viso.demo.loop import CompanionLoop
from viso.demo.record import Arrived, Estimate
from viso.geometry.errors import rms
from viso.vehicle.outcomes import OutcomeKind, outcome_kind

_PATH_STEP_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How far poses were off in flight: root mean squares, the worst, and the last.

    Attributes:
        within_2_sigma: share of the positions, axis by axis, that were within twice what was stated.
    """

    horizontal_rms_m: float
    horizontal_max_m: float
    horizontal_end_m: float
    height_rms_m: float
    height_max_m: float
    tilt_rms_deg: float
    yaw_rms_deg: float
    within_2_sigma: float


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """A closed loop in figures; times in s.

    Attributes:
        path_m: how far the vehicle has flown.
        odometry, estimate: how good the companion's and the autopilot's poses were; None if there were none in flight.
        states: how long the odometry was in which state.
        aiding: how long the autopilot's filter navigated by what.
        sent: ODOMETRY messages.
        accepted: those handed to the filter.
        withheld: the others that arrived, by the code of the rule.
        fused: positions that the filter made use of; the number is a model's.
        qualities: the least, the median and the greatest of those that arrived.
        reset_counter: of the last message.
        position_resets: when the filter set its position again while it navigated, and by how many metres; a model's.
    """

    path_m: float
    odometry: Accuracy | None
    estimate: Accuracy | None
    states: Mapping[str, float]
    aiding: Mapping[str, float]
    sent: int
    accepted: int
    withheld: Mapping[str, int]
    fused: int
    qualities: tuple[int, int, int] | None
    reset_counter: int | None
    position_resets: tuple[tuple[float, float], ...]


def figures_of(loop: CompanionLoop) -> LoopFigures:
    """Return the figures of a loop up to now."""
    record, setup = loop.record, loop.setup
    states = record.states(setup.companion_us, loop.now_us)
    verdicts = [
        (outcome, code, count)
        for (name, outcome, code), count in loop.vehicle.endpoint.verdict_counts().items()
        if name == "ODOMETRY"
    ]
    outcomes = Counter(outcome_kind(test.outcome.rule) for test in record.outcomes if test.outcome.kind == "pose")
    return LoopFigures(
        path_m=_path_m(loop),
        odometry=accuracy_of(odometry_errors(setup, record.arrived).in_flight()),
        estimate=accuracy_of(estimate_errors(setup, record.estimates).in_flight()),
        states=_total((span.state.value, span.end_us - span.start_us) for span in states),
        aiding=_total((span.mode.value, span.end_us - span.start_us) for span in loop.watch.aiding()),
        sent=loop.companion.sender.counters["ODOMETRY"],
        accepted=sum(count for outcome, _, count in verdicts if outcome is VerdictKind.ACCEPTED),
        withheld={code: count for outcome, code, count in verdicts if outcome is not VerdictKind.ACCEPTED},
        fused=outcomes[OutcomeKind.FUSED] + outcomes[OutcomeKind.RESET],
        qualities=_qualities(record.arrived),
        reset_counter=record.arrived[-1].message.reset_counter if record.arrived else None,
        position_resets=tuple(_position_resets(record.estimates)),
    )


def accuracy_of(errors: PoseErrors) -> Accuracy | None:
    """Return how far poses were off, None if there are none."""
    if not len(errors):
        return None
    horizontal_m, height_m = errors.horizontal_m, errors.errors_ned[:, 2]
    return Accuracy(
        horizontal_rms_m=rms(horizontal_m),
        horizontal_max_m=float(horizontal_m.max()),
        horizontal_end_m=float(horizontal_m[-1]),
        height_rms_m=rms(height_m),
        height_max_m=float(np.abs(height_m).max()),
        tilt_rms_deg=float(np.degrees(rms(errors.tilt_rad))),
        yaw_rms_deg=float(np.degrees(rms(errors.yaw_rad))),
        within_2_sigma=float((np.abs(errors.errors_ned) <= 2 * errors.sigmas_m).mean()),
    )


def _path_m(loop: CompanionLoop) -> float:
    times_s = np.arange(loop.setup.companion_us * 1e-6, loop.now_us * 1e-6, _PATH_STEP_S)
    positions, _ = truth(loop.setup, times_s)
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def _total(spans_us: Iterable[tuple[str, int]]) -> dict[str, float]:
    total: Counter[str] = Counter()
    for name, length_us in spans_us:
        total[name] += length_us
    return {name: length_us * 1e-6 for name, length_us in total.items()}


def _position_resets(estimates: Iterable[Estimate]) -> Iterator[tuple[float, float]]:
    for earlier, later in pairwise(estimates):
        if earlier.pos_ned is not None and later.moved_ne is not None and later.moved_ne != earlier.moved_ne:
            yield later.time_us * 1e-6, math.hypot(*later.moved_ne)


def _qualities(arrived: Iterable[Arrived]) -> tuple[int, int, int] | None:
    qualities = sorted(one.message.quality for one in arrived)
    return (qualities[0], qualities[len(qualities) // 2], qualities[-1]) if qualities else None


def figures_table(figures: LoopFigures) -> Table:
    """Return the one table of a closed loop."""
    columns = [Column(name, justify="right") for name in ("odometry (companion)", "estimate (autopilot)")]
    table = Table("error, in flight", *columns, title=f"The loop, {figures.path_m:.0f} m flown")
    for what, *cells in _accuracy_rows(figures):
        table.add_row(what, *cells)
    table.add_section()
    for what, *cells in _course_rows(figures):
        table.add_row(what, *cells)
    return table


def _accuracy_rows(figures: LoopFigures) -> Iterable[tuple[str, str, str]]:
    both = figures.odometry, figures.estimate
    share = 100 / figures.path_m if figures.path_m else 0.0
    texts: dict[str, Callable[[Accuracy], str]] = {
        "horizontal: rms, worst": lambda one: f"{one.horizontal_rms_m:.2f} m, {one.horizontal_max_m:.2f} m",
        "horizontal: last, of the path": lambda one: (
            f"{one.horizontal_end_m:.2f} m, {one.horizontal_end_m * share:.2f} %"
        ),
        "height: rms, worst": lambda one: f"{one.height_rms_m:.2f} m, {one.height_max_m:.2f} m",
        "tilt: rms": lambda one: f"{one.tilt_rms_deg:.2f} deg",
        "heading: rms": lambda one: f"{one.yaw_rms_deg:.2f} deg",
        "within 2 of its own sigma": lambda one: f"{one.within_2_sigma:.0%}",
    }
    for what, text in texts.items():
        vio, ekf = ("-" if one is None else text(one) for one in both)
        yield what, vio, ekf


def _course_rows(figures: LoopFigures) -> Iterable[tuple[str, str, str]]:
    states, aiding = (
        "\n".join(f"{name} {length_s:.1f} s" for name, length_s in spans.items())
        for spans in (figures.states, figures.aiding)
    )
    withheld = "".join(f"\n{count} {code}" for code, count in figures.withheld.items())
    qualities = "-" if figures.qualities is None else "{}, {}, {}".format(*figures.qualities)
    yield "state; aiding", states, aiding
    yield "ODOMETRY: sent; accepted", str(figures.sent), f"{figures.accepted}{withheld}"
    yield "positions fused", "", str(figures.fused)
    yield "quality: least, median, most", qualities, ""
    resets = "\n".join(f"{moved_m:.2f} m at {time_s:.2f} s" for time_s, moved_m in figures.position_resets)
    yield "resets: counter; position", str(figures.reset_counter or 0), resets or "-"
