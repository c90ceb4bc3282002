# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration's picture: path in plan, height and verdicts over time."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from companion.trajectory import Flight
from emulator.demo import FAULTS, FLIGHT, DemoResult

_TRUTH = "0.45"
_GIVEN = "#1f77b4"
_WITHHELD = "#d62728"
_RAW = "#9ecae1"


def _arrays(result: DemoResult, *, ignored: bool) -> tuple[Any, Any]:
    chosen = [pose for pose in result.poses if pose.ignored is ignored]
    times = np.array([pose.time_s for pose in chosen])
    return times, np.array([pose.pos_ned for pose in chosen]).reshape(-1, 3)


def _shade(axes: Any) -> None:
    spans = [(FAULTS.low_quality, "low quality", "#ffe9b3"), (FAULTS.dropout, "dropout", "#e0e0e0")]
    for span, label, colour in spans:
        if span is not None:
            axes.axvspan(span.start_s, span.end_s, color=colour, label=label, zorder=0)
    if FAULTS.reset_s is not None:
        axes.axvspan(FAULTS.reset_s, FAULTS.reset_s + 1, color="#f8cfc9", label="1 s after reset", zorder=0)


def _plan(axes: Any, result: DemoResult, flight: Flight, times: Any) -> None:
    truth = np.array([flight.position_ned(t) for t in times])
    given_times, given = _arrays(result, ignored=False)
    _, withheld = _arrays(result, ignored=True)
    given = given[given_times >= flight.start_s]
    axes.plot(truth[:, 1], truth[:, 0], color=_TRUTH, lw=3, alpha=0.6, label="true path")
    axes.plot(given[:, 1], given[:, 0], ".", color=_GIVEN, ms=3, label="given to the EKF")
    axes.plot(withheld[:, 1], withheld[:, 0], ".", color=_WITHHELD, ms=4, label="withheld")
    axes.set(xlabel="east, m", ylabel="north, m", title="Path in plan, after alignment")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize="small")


def _over_time(axes: Any, result: DemoResult, flight: Flight, times: Any, axis: int, label: str) -> None:
    _shade(axes)
    axes.plot(times, [flight.position_ned(t)[axis] for t in times], color=_TRUTH, lw=3, alpha=0.6, label="true")
    raw_times, raw = zip(*result.raw, strict=True)
    axes.plot(raw_times, [position[axis] for position in raw], color=_RAW, lw=0.8, label="as the camera sent it")
    for ignored, colour in ((False, _GIVEN), (True, _WITHHELD)):
        given_times, given = _arrays(result, ignored=ignored)
        name = "withheld" if ignored else "given to the EKF"
        axes.plot(given_times, given[:, axis], ".", color=colour, ms=3, label=name)
    axes.set(ylabel=label)
    axes.grid(alpha=0.3)


def save_plot(result: DemoResult, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: if it cannot be written.
    """
    times = np.arange(math.floor(FLIGHT.start_s) - 6, FLIGHT.end_s + 2, 0.05)
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1, 1.4))
    _plan(figure.add_subplot(grid[:, 0]), result, FLIGHT, times)
    rows = [figure.add_subplot(grid[row, 1]) for row in range(3)]
    for row, (axes, label) in enumerate(zip(rows, ("north, m", "east, m", "down, m"), strict=True)):
        _over_time(axes, result, FLIGHT, times, row, label)
        axes.set_xlim(times[0], times[-1])
    rows[0].set_title("Position over time")
    rows[-1].set_xlabel("seconds since boot")
    figure.legend(*rows[-1].get_legend_handles_labels(), fontsize="small", ncols=7, loc="outside lower center")
    figure.suptitle("viso demo: what a T265-type camera sent, and what the autopilot made of it")
    figure.savefig(path, dpi=110)
