# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of a report. Each is made of what the log has; one with nothing to show is None."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from viso.doctor.evidence.own_filter import CHANNELS, NOT_KNOWN, OwnFilter, source_name
from viso.estimators.series import Array, Series
from viso.report import drawing
from viso.report.agreement import ekf_poses, lag_ms, remote_lag_ms, vision_poses
from viso.report.drawing import AXES, EKF, GATE, GREEN, MUTED, VIOLET, VISION, WITHHELD, dots, legend, level, line
from viso.report.facts import STALE_S, UNHEALTHY_S, Facts, positioned_at
from viso.report.flight_data import Material, position_moves
from viso.report.timeline import draw_timeline

_NED: Final = ("north", "east", "down")
_IN_SECONDS_MS: Final = 10_000.0
# No scale is finer than these from end to end.
_LEAST_M: Final = 0.2
_LEAST_M_S: Final = 0.2
_LEAST_DEG: Final = 2.0


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A figure, which has its name as a file and within the page; ``absent`` is what a log lacks that has none."""

    name: str
    title: str
    caption: str
    draw: Callable[[Material, Facts], Figure | None]
    absent: str


def _over_time(axes: Any, facts: Facts, last: bool = True) -> None:
    axes.set_xlim(facts.start_s, max(facts.end_s, facts.start_s + 1.0))
    if last:
        axes.set_xlabel("seconds since boot")


def _without_position(material: Material, facts: Facts) -> list[tuple[float, float]]:
    """Return when the EKF had no position, as far as it is known: what is compared with it then means little."""
    if not len(material.xkf4):
        return []
    edges = [facts.start_s, *(edge for span in facts.positioned for edge in span), facts.end_s]
    return [(start, end) for start, end in zip(edges[::2], edges[1::2], strict=True) if end > start]


def _path(material: Material, facts: Facts) -> Figure | None:
    vision, ekf = vision_poses(material), ekf_poses(material)
    positioned = positioned_at(facts.own, ekf.time_s)
    if not len(vision.time_s) and not positioned.any():
        return None
    figure = drawing.new_figure(4.6)
    plan, height = figure.subplots(1, 2, width_ratios=(1, 1.35))
    withheld = material.visp["Ign"] > 0
    known = np.where(positioned[:, np.newaxis], ekf.pos_ned, np.nan)
    line_s, lines = drawing.broken_at(ekf.time_s, known, position_moves(material.xkf4)[0])
    for mask, colour, label in ((~withheld, VISION, "vision"), (withheld, WITHHELD, "vision, withheld")):
        some = vision.where(mask)
        dots(plan, some.pos_ned[:, 1], some.pos_ned[:, 0], colour, label, 4)
        dots(height, some.time_s, -some.pos_ned[:, 2], colour, label, 4)
    line(plan, lines[:, 1], lines[:, 0], EKF, "EKF")
    line(height, line_s, -lines[:, 2], EKF, "EKF")
    _mark_ends(plan, known if positioned.any() else vision.pos_ned)
    plan.set(xlabel="east, m", ylabel="north, m", title="In plan")
    plan.set_aspect("equal", adjustable="datalim")
    _no_narrower_than(plan, np.concatenate([known, vision.pos_ned]), 1.0)
    height.set(ylabel="m above the EKF's origin", title="Height")
    drawing.shade(height, _without_position(material, facts), MUTED, "EKF without position")
    drawing.no_flatter_than(height, 0.5)
    _over_time(height, facts)
    legend(height, 4)
    return figure


def _mark_ends(axes: Any, pos_ned: Array) -> None:
    known = pos_ned[np.isfinite(pos_ned).all(axis=1)]
    for end, text, marker in ((known[:1], "start", "o"), (known[-1:], "end", "s")):
        if len(end):
            axes.plot(end[:, 1], end[:, 0], marker, mfc="none", mec=MUTED, mew=1.5, ms=8, ls="none", label=text)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")


def _no_narrower_than(axes: Any, pos_ned: Array, width_m: float) -> None:
    """Widen the scales of a path that hardly moves, so that noise does not look like a flight."""
    known = pos_ned[np.isfinite(pos_ned).all(axis=1)]
    middle = (known.min(axis=0) + known.max(axis=0))[[1, 0]] / 2 if len(known) else np.zeros(2)
    axes.update_datalim([middle - width_m / 2, middle + width_m / 2])
    axes.autoscale_view()


def _differences(material: Material, facts: Facts) -> Figure | None:
    found = facts.differences
    rows: list[tuple[str, float, Array, list[tuple[Array, str, str]]]] = []
    if np.isfinite(found.pos_ned).any():
        rows.append(("position, m", _LEAST_M, found.time_s, _named(found.pos_ned)))
        rows.append(("yaw, deg", _LEAST_DEG, found.time_s, [(found.yaw_deg, VIOLET, "yaw")]))
    if np.isfinite(found.vel_ned).any():
        rows.insert(1 if rows else 0, ("velocity, m/s", _LEAST_M_S, found.vel_time_s, _named(found.vel_ned)))
    if not rows:
        return None
    figure = drawing.new_figure(0.6 + 1.9 * len(rows))
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for number, (axes, (label, least, times, curves)) in enumerate(zip(panels, rows, strict=True)):
        for values, colour, name in curves:
            dots(axes, times, values, colour, name)
        axes.axhline(0, color=MUTED, lw=0.8)
        drawing.shade(axes, _without_position(material, facts), MUTED, "EKF without position")
        axes.set(ylabel=label)
        drawing.no_flatter_than(axes, least)
        _over_time(axes, facts, last=number == len(rows) - 1)
        legend(axes)
    panels[0].set_title("Vision less EKF")
    return figure


def _named(columns: Array) -> list[tuple[Array, str, str]]:
    return [(columns[:, i], AXES[i], _NED[i]) for i in range(3)]


def _innovations(material: Material, facts: Facts) -> Figure | None:
    xkf3, xkf4 = material.xkf3, material.xkf4
    if not len(xkf3) and not len(xkf4):
        return None
    every: tuple[tuple[str, float, tuple[str, ...]], ...] = (
        ("velocity, m/s", _LEAST_M_S, ("IVN", "IVE", "IVD")),
        ("position, m", _LEAST_M, ("IPN", "IPE", "IPD")),
        ("yaw, deg", _LEAST_DEG, ("IYAW",)),
    )
    groups = [group for group in every if any(xkf3.has(label) for label in group[2])]
    figure = drawing.new_figure(2.4 + 1.6 * len(groups))
    heights = [1.5, *[1.0] * len(groups)]
    panels = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    _ratios(panels[0], xkf4, facts.own)
    for number, (axes, (name, least, labels)) in enumerate(zip(panels[1:], groups, strict=True)):
        for label, colour, axis in zip(labels, (VIOLET,) if len(labels) == 1 else AXES, _NED, strict=False):
            line(axes, xkf3.time_s, xkf3[label], colour, axis if len(labels) > 1 else "yaw", 1.0)
        axes.axhline(0, color=MUTED, lw=0.8)
        axes.set(ylabel=name)
        drawing.no_flatter_than(axes, least)
        if number == 0:
            axes.set_title("Innovations")
        legend(axes)
    for axes in panels:
        drawing.shade(axes, facts.over_gate, GATE, "", 0.12)
        _over_time(axes, facts, last=axes is panels[-1])
    return figure


def _ratios(axes: Any, xkf4: Series, own: OwnFilter) -> None:
    least = 0.01  # the log's resolution
    labels = zip(("SV", "SP", "SH", "SM"), (EKF, VISION, GREEN, VIOLET), CHANNELS, strict=True)
    for channel, (label, colour, name) in enumerate(labels):
        source = own.source(channel)
        by = "" if source == NOT_KNOWN else f" ({source_name(channel, source)})"
        line(axes, xkf4.time_s, np.maximum(xkf4[label], least), colour, f"{name}{by}", 1.1)
    largest = np.nanmax(xkf4.matrix("SV", "SP", "SH", "SM"), initial=1.0)
    axes.set(yscale="log", ylim=(least * 0.9, max(2.0, 1.5 * largest)), ylabel="test ratio", title="Against the gates")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.axhline(1.0, color=GATE, lw=1, ls="--", zorder=1, label="gate, rejected above")
    legend(axes, 5)


def _quality(material: Material, facts: Facts) -> Figure | None:
    source, name = material.stamped, "VISP" if len(material.visp) else "VISV"
    if not len(source):
        return None
    figure = drawing.new_figure(4.4)
    quality, resets = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1))
    withheld = source["Ign"] > 0
    dots(quality, source.time_s[~withheld], source["Q"][~withheld], VISION, "given to the EKF", 4)
    dots(quality, source.time_s[withheld], source["Q"][withheld], WITHHELD, "withheld", 4)
    least = material.parameter("VISO_QUAL_MIN")
    if least is not None:
        level(quality, least, GATE, f"VISO_QUAL_MIN {least:g}")
    quality.set(ylim=(-8, 108), yticks=(0, 25, 50, 75, 100), ylabel=f"quality ({name}.Q)", title="Quality")
    if not source.has("Q"):
        quality.text(0.5, 0.5, "the log has no quality", ha="center", va="center", transform=quality.transAxes)
    legend(quality)
    _resets(resets, source, facts)
    _over_time(quality, facts, last=False)
    _over_time(resets, facts)
    return figure


def _resets(axes: Any, source: Series, facts: Facts) -> None:
    if source.has("Rst"):
        axes.step(source.time_s, source["Rst"], where="post", color=VISION, lw=1.3, label="reset counter of vision")
    for colour, kind in ((EKF, "position"), (VIOLET, "yaw"), (GREEN, "height")):
        times = [reset.time_s for reset in facts.resets if reset.by == "EKF" and reset.what.startswith(kind)]
        if times:
            across = axes.get_xaxis_transform()
            axes.vlines(times, 0, 1, transform=across, color=colour, lw=1.1, ls=":", label=f"EKF {kind} reset")
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True, min_n_ticks=1))
    top = float(np.nanmax(source["Rst"], initial=1.0))
    axes.set(ylim=(-0.1 * max(top, 1), 1.15 * max(top, 1)), ylabel="counter", title="Resets")
    legend(axes)


def _lag(material: Material, facts: Facts) -> Figure | None:
    source = material.stamped
    corrected, raw = lag_ms(source), remote_lag_ms(source)
    if not np.isfinite(corrected).any():
        return None
    figure = drawing.new_figure(4.6)
    panels = figure.subplots(2, 2, width_ratios=(4, 1), sharex="col", sharey="row")
    for row, (values, colour, title) in enumerate(
        (
            (corrected, EKF, "Age when logged, by the corrected stamp (CTimeMS)"),
            (raw, VISION, "Age when logged, by the sender's stamp (RTimeUS), above the least seen"),
        )
    ):
        in_seconds = np.nanmax(np.abs(values), initial=0.0) > _IN_SECONDS_MS
        shown = values * 1e-3 if in_seconds else values
        axes, histogram = panels[row]
        dots(axes, source.time_s, shown, colour, "")
        axes.set(ylabel="s" if in_seconds else "ms", title=title)
        _over_time(axes, facts, last=row == 1)
        histogram.hist(shown[np.isfinite(shown)], bins=40, orientation="horizontal", color=colour, rasterized=False)
        low, high = float(np.nanmin(shown, initial=0.0)), float(np.nanmax(shown, initial=1.0))
        axes.set_ylim(low - 0.05 * (high - low), high + 0.08 * (high - low))
    panels[1, 1].set_xlabel("records")
    return figure


def per_second(time_s: Array, start_s: float, end_s: float) -> tuple[Array, Array]:
    """Return how many records there are in each second, and the edges of the seconds: a silence is one long one.

    Only whole seconds count, as a part of one would look like a drop.
    """
    seconds = np.maximum(1.0, np.floor(end_s - start_s))
    second, counts = np.unique(np.floor(time_s - start_s), return_counts=True)
    inside = (second >= 0) & (second < seconds)
    second, counts = second[inside], counts[inside]
    edges = np.unique(np.concatenate([[0.0, seconds], second, second + 1.0]))
    steps = np.zeros(len(edges) - 1)
    steps[np.searchsorted(edges, second)] = counts
    return steps, start_s + edges


def _rates(material: Material, facts: Facts) -> Figure | None:
    if len(facts.arrivals_s) < 2:
        return None
    figure = drawing.new_figure(4.6)
    rate, steps = figure.subplots(2, 1, sharex=True)
    most = 1
    kinds = zip(material.vision, (("VISP", VISION), ("VISV", EKF), ("VISO", GREEN)), strict=True)
    for number, (series, (name, colour)) in enumerate(kinds):
        if len(series):
            counts, edges = per_second(series.time_s, facts.arrivals_s[0], facts.arrivals_s[-1])
            rate.stairs(counts, edges, color=colour, lw=1.2 if number else 2.6, label=name, baseline=None)
            most = max(most, int(counts.max()))
    rate.set(ylabel="records in a second", title="Rate")
    rate.set_ylim(0, 1.12 * most)
    drawing.shade(rate, facts.gaps, WITHHELD, "silent for more than 300 ms")
    legend(rate)
    gap_ms = np.diff(facts.arrivals_s) * 1e3
    healthy = gap_ms <= UNHEALTHY_S * 1e3
    dots(steps, facts.arrivals_s[1:][healthy], gap_ms[healthy], MUTED, "", 3)
    dots(steps, facts.arrivals_s[1:][~healthy], gap_ms[~healthy], WITHHELD, "", 7)
    level(steps, UNHEALTHY_S * 1e3, VISION, "300 ms: not healthy", above=False)
    level(steps, STALE_S * 1e3, WITHHELD, "500 ms: no height from vision")
    low, high = float(gap_ms.min()), float(gap_ms.max())
    steps.set(yscale="log", ylim=(max(0.5, low / 2), max(1500.0, 2 * high)), ylabel="ms", title="From record to record")
    steps.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for axes in (rate, steps):
        _over_time(axes, facts, last=axes is steps)
    return figure


FIGURES: Final = (
    FigureKind(
        "timeline",
        "What happened when",
        "Above: armed, the flight mode, what the EKF says that it has, and when vision was silent for more than 300 ms "
        "or withheld. Below: what the autopilot said and logged; all of it is in the table of texts and events.",
        draw_timeline,
        "No texts, events or EKF status.",
    ),
    FigureKind(
        "path",
        "Path",
        "Vision where the driver put it (VISP: scaled and aligned), at the time that it is of; the EKF (XKF1) where it "
        "had a position. Both in metres from the EKF's origin. Vision is of the camera, the EKF of the vehicle's IMU.",
        _path,
        "Neither VISP nor a position of the EKF.",
    ),
    FigureKind(
        "innovations",
        "Innovations and gates",
        "Above: the square roots of test ratios (XKF4); what is over 1 is rejected, red on the ground of all panels. "
        "Ratios below 0.01 are drawn there. Below: by how much measurements differed from what the EKF expected "
        "(XKF3), whatever sensor they came from.",
        _innovations,
        "Neither XKF3 nor XKF4.",
    ),
    FigureKind(
        "differences",
        "Vision against EKF",
        "Vision less EKF at the same instant: the time of the measurement, VISO_DELAY_MS before CTimeMS. Withheld "
        "samples are included. The EKF is interpolated between its records, and shifted to the camera (VISO_POS).",
        _differences,
        "Vision and EKF do not overlap in this log.",
    ),
    FigureKind(
        "quality",
        "Quality, withheld samples, resets",
        "-1 failed, 0 unknown (all messages but ODOMETRY), 1 to 100. Below: the reset counter that vision sent, and "
        "when the EKF moved its own position (OFN, OFE), yaw or height.",
        _quality,
        "Neither VISP nor VISV.",
    ),
    FigureKind(
        "lag",
        "Lag",
        "Above: from the corrected stamp to the record; the EKF takes VISO_DELAY_MS more off. Below: by the sender's "
        "own clock, whose offset is unknown, so the least is 0: a slope is drift, a step a jump of a clock.",
        _lag,
        "Neither VISP nor VISV.",
    ),
    FigureKind(
        "rates",
        "Rate and gaps",
        "Records of each kind in each whole second, and the time between records of any kind.",
        _rates,
        "Fewer than two records of vision.",
    ),
)
