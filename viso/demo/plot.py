# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration's picture: the path in plan and over time, how samples stood the filter's gates, and its flags."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from ekf_stub.reports import AidingMode, FilterFlag
from viso.demo.record import Estimate
from viso.demo.tracking_camera import END_S, FAULTS, FLIGHT, DemoResult
from viso.estimators.series import spans_of
from viso.files.outputs import output_file
from viso.vehicle.outcomes import OutcomeKind, outcome_kind

_TRUTH: Final = "0.45"
_GIVEN: Final = "#1f77b4"
_WITHHELD: Final = "#ff7f0e"
_REJECTED: Final = "#d62728"
_RAW: Final = "#9ecae1"
_ESTIMATE: Final = "black"
_KINDS: Final = {"pose": ("position", "#1f77b4"), "height": ("height", "#2ca02c"), "velocity": ("velocity", "#9467bd")}
_SHADES: Final = (
    (FAULTS.low_quality, "low quality", "#ffe9b3"),
    (FAULTS.dropout, "dropout", "#dddddd"),
    (FAULTS.mismatch, "wrong place", "#e5d4ef"),
)
_FLAGS: Final[dict[str, Callable[[Estimate], bool]]] = {
    "armed": lambda estimate: estimate.is_armed,
    "attitude": lambda estimate: bool(estimate.flags & FilterFlag.ATTITUDE),
    "velocity": lambda estimate: bool(estimate.flags & FilterFlag.HORIZ_VEL),
    "position": lambda estimate: bool(estimate.flags & FilterFlag.HORIZ_POS_ABS),
    "height": lambda estimate: bool(estimate.flags & FilterFlag.VERT_POS),
    "constant position": lambda estimate: bool(estimate.flags & FilterFlag.CONST_POS_MODE),
}


def _shade(axes: Any) -> None:
    for span, label, colour in _SHADES:
        if span is not None:
            axes.axvspan(span.start_s, span.end_s, color=colour, label=label, zorder=0)
    if FAULTS.reset_s is not None:
        axes.axvspan(FAULTS.reset_s, FAULTS.reset_s + 1, color="#f8cfc9", label="1 s after reset", zorder=0)


def _poses(result: DemoResult) -> Iterator[tuple[str, str, Any, Any]]:
    """Yield label, colour, times and positions of the poses by their outcomes."""
    rejected_ms = {
        test.outcome.time_ms
        for test in result.outcomes
        if test.outcome.kind == "pose" and outcome_kind(test.outcome.rule) is OutcomeKind.REJECTED
    }
    groups = (
        ("used by the filter", _GIVEN, lambda pose: not pose.ignored and pose.observed_ms not in rejected_ms),
        ("withheld from it", _WITHHELD, lambda pose: pose.ignored),
        ("rejected by its gate", _REJECTED, lambda pose: not pose.ignored and pose.observed_ms in rejected_ms),
    )
    for label, colour, is_member in groups:
        chosen = [pose for pose in result.poses if is_member(pose)]
        times = np.array([pose.time_s for pose in chosen])
        yield label, colour, times, np.array([pose.pos_ned for pose in chosen]).reshape(-1, 3)


def _estimates(result: DemoResult) -> tuple[Any, Any]:
    known = [(estimate.time_s, estimate.pos_ned) for estimate in result.estimates if estimate.pos_ned is not None]
    return np.array([time_s for time_s, _ in known]), np.array([pos for _, pos in known]).reshape(-1, 3)


def _plan(axes: Any, result: DemoResult, times: Any) -> None:
    truth = np.array([FLIGHT.position_ned(t) for t in times])
    axes.plot(truth[:, 1], truth[:, 0], color=_TRUTH, lw=4, alpha=0.5)
    for _, colour, pose_times, positions in _poses(result):
        flown = positions[pose_times >= FLIGHT.start_s]
        axes.plot(flown[:, 1], flown[:, 0], ".", color=colour, ms=4)
    estimate_times, estimates = _estimates(result)
    flown = estimates[estimate_times >= FLIGHT.start_s]
    axes.plot(flown[:, 1], flown[:, 0], color=_ESTIMATE, lw=1)
    axes.set(xlabel="east, m", ylabel="north, m", title="Path in plan")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)


def _over_time(axes: Any, result: DemoResult, times: Any, axis: int, label: str) -> None:
    _shade(axes)
    axes.plot(times, [FLIGHT.position_ned(t)[axis] for t in times], color=_TRUTH, lw=4, alpha=0.5, label="true")
    raw = [(one.time_us * 1e-6, (one.message.x, one.message.y, one.message.z)[axis]) for one in result.arrived]
    axes.plot(*zip(*raw, strict=True), color=_RAW, lw=0.8, label="as the camera sent it")
    for name, colour, pose_times, positions in _poses(result):
        axes.plot(pose_times, positions[:, axis], ".", color=colour, ms=3, label=name)
    estimate_times, estimates = _estimates(result)
    axes.plot(estimate_times, estimates[:, axis], color=_ESTIMATE, lw=1, label="estimate")
    axes.set(ylabel=label, xlim=(times[0], times[-1]))
    axes.grid(alpha=0.3)


def _ratios(axes: Any, result: DemoResult) -> None:
    lines = []
    for kind, (label, colour) in _KINDS.items():
        tests = [
            (1e-6 * test.time_us, max(test.outcome.ratio, 1e-3))
            for test in result.outcomes
            if test.outcome.kind == kind and test.outcome.ratio is not None
        ]
        times, ratios = np.array(tests).reshape(-1, 2).T
        lines += axes.plot(times, ratios, ".", color=colour, ms=2.5, label=label)
    lines.append(axes.axhline(1, color=_REJECTED, lw=1, label="gate"))
    axes.legend(handles=lines, fontsize="small", ncols=4, loc="upper left", markerscale=3)
    _shade(axes)
    axes.set(yscale="log", ylim=(1e-3, 30), ylabel="innovation / gate", title="How samples stood the filter's gates")
    axes.grid(alpha=0.3)


def _flags(axes: Any, result: DemoResult) -> None:
    _shade(axes)
    times = [estimate.time_s for estimate in result.estimates]
    rows = {
        name: [(start, end - start) for start, end in spans_of(times, [holds(one) for one in result.estimates])]
        for name, holds in _FLAGS.items()
    }
    rows["aiding"] = [
        (1e-6 * span.start_us, 1e-6 * (span.end_us - span.start_us))
        for span in result.aiding
        if span.mode is not AidingMode.NONE
    ]
    for row, (name, spans) in enumerate(rows.items()):
        colour = _TRUTH if name == "armed" else _WITHHELD if name == "constant position" else _GIVEN
        axes.broken_barh(spans, (row - 0.35, 0.7), color=colour)
    axes.set(yticks=range(len(rows)), yticklabels=list(rows), xlabel="seconds since boot", title="The filter's flags")
    axes.invert_yaxis()
    axes.grid(axis="x", alpha=0.3)


def save_plot(result: DemoResult, path: Path) -> None:
    """Write the picture as PNG. Raises InputError if it cannot be written."""
    times = np.arange(math.floor(FLIGHT.start_s) - 6, FLIGHT.end_s + 2, 0.05)
    figure = Figure(figsize=(13, 11.5), layout="constrained")
    grid = figure.add_gridspec(5, 2, width_ratios=(1, 1.4), height_ratios=(1, 1, 1, 1.1, 1))
    _plan(figure.add_subplot(grid[:3, 0]), result, times)
    rows = [figure.add_subplot(grid[row, 1]) for row in range(3)]
    for axis, (axes, label) in enumerate(zip(rows, ("north, m", "east, m", "down, m"), strict=True)):
        _over_time(axes, result, times, axis, label)
    rows[0].set_title("Position over time")
    rows[-1].set_xlabel("seconds since boot")
    wide = [figure.add_subplot(grid[row, :]) for row in (3, 4)]
    _ratios(wide[0], result)
    _flags(wide[1], result)
    for axes in wide:
        axes.set_xlim(0, END_S)
    legend = rows[-1].get_legend_handles_labels()
    figure.legend(*legend, fontsize="small", ncols=5, loc="outside lower center", markerscale=2)
    figure.suptitle(
        "viso demo: what a T265-type camera sent, and what the autopilot made of it (its filter is a model)"
    )
    with output_file(path) as file:
        figure.savefig(file, dpi=110, format="png")
