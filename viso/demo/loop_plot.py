# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A closed loop's picture: the flight over its ground, errors with their sigmas, height, quality and states."""

from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from ekf_stub.reports import AidingMode, FilterFlag
from viso.companion.vio.types import VioState
from viso.demo.errors import PoseErrors, estimate_errors, odometry_errors, truth
from viso.demo.loop import CompanionLoop
from viso.estimators.series import spans_of
from viso.files.outputs import output_file

_TRUTH: Final = "#ffd92f"
_VIO: Final = "#1f77b4"
_EKF: Final = "#d62728"
_COVERED: Final = "0.85"
_RESTART: Final = "#9467bd"
_STATES: Final = {
    VioState.INIT: "#c7c7c7",
    VioState.TRACKING: "#2ca02c",
    VioState.DEGRADED: "#ff9f1c",
    VioState.LOST: "#d62728",
}
_SHORTEST_S: Final = 1.0  # of a picture
_GAP_S: Final = 0.5  # between poses of one line
_GROUND_MARGIN_M: Final = 12.0
_HEADROOM: Final = 3.0  # for sigmas above the worst error
_LABELLED: Final = 0.05  # share of the time that a state must have taken to be named
_PLAN_SHAPE: Final = 1.3  # height by width
_GROUND_STEP: Final = 3  # pixels of the texture to one of the picture


class _Story:
    """A loop, prepared for drawing."""

    def __init__(self, loop: CompanionLoop) -> None:
        self.loop, self.record, self.setup = loop, loop.record, loop.setup
        self.start_s = loop.setup.companion_us * 1e-6
        self.end_s = max(loop.now_us * 1e-6, self.start_s + _SHORTEST_S)
        self.times_s = np.arange(self.start_s, self.end_s, 0.05)
        self.true_ned = truth(loop.setup, self.times_s)[0]
        self.vio = odometry_errors(loop.setup, loop.record.arrived)
        self.ekf = estimate_errors(loop.setup, loop.record.estimates)

    def covered_s(self) -> list[tuple[float, float]]:
        spans = [(self.start_s + begin, self.start_s + end) for begin, end in self.setup.flight.covered_s]
        return [span for span in spans if span[0] < self.end_s]

    def resets_s(self) -> list[float]:
        arrived = self.record.arrived
        return [
            later.time_us * 1e-6
            for earlier, later in pairwise(arrived)
            if later.message.reset_counter != earlier.message.reset_counter
        ]


def _mark(axes: Any, story: _Story) -> list[Any]:
    """Mark what happened to the odometry; return what a legend needs."""
    covered = [axes.axvspan(*span, color=_COVERED, zorder=0, label="lens covered") for span in story.covered_s()]
    resets = [axes.axvline(at, color=_RESTART, lw=1.5, ls="--", label="restarted") for at in story.resets_s()]
    return covered[:1] + resets[:1]


def _broken(errors: PoseErrors, values: Any) -> tuple[Any, Any]:
    """Return times and values with a gap where there are none."""
    gaps = np.flatnonzero(np.diff(errors.t_s) > _GAP_S) + 1
    return np.insert(errors.t_s, gaps, np.nan), np.insert(np.asarray(values, float), gaps, np.nan, axis=0)


def _ground(axes: Any, story: _Story) -> None:
    """Draw the texture, mirrored as far as it takes, with north up."""
    texture = story.setup.flight.texture
    small = texture.pixels[::_GROUND_STEP, ::_GROUND_STEP]
    rows, columns = small.shape
    mirrored = np.pad(small, ((rows, rows), (columns, columns)), mode="symmetric")
    east, north = (1.5 * extent for extent in texture.extent_m)
    start = story.setup.flight.truth(story.setup.flight.start_ns).t
    extent = (-east - start[0], east - start[0], -north - start[1], north - start[1])
    axes.imshow(mirrored, cmap="gray", extent=extent, vmin=-60, vmax=300, zorder=0, interpolation="bilinear")


def _plan(axes: Any, story: _Story) -> None:
    _ground(axes, story)
    axes.plot(story.true_ned[:, 1], story.true_ned[:, 0], color=_TRUTH, lw=5, alpha=0.9, label="truth")
    for errors, colour, label in ((story.vio, _VIO, "odometry"), (story.ekf, _EKF, "autopilot's estimate")):
        _, path = _broken(errors, errors.pos_ned)
        axes.plot(path[:, 1], path[:, 0], color=colour, lw=1.6, label=label)
    at = [int(np.searchsorted(story.times_s, time_s)) for span in story.covered_s() for time_s in span]
    for first, last in zip(at[::2], at[1::2], strict=True):
        dark = story.true_ned[first : last + 1]
        axes.plot(dark[:, 1], dark[:, 0], color="black", lw=9, alpha=0.35, solid_capstyle="butt", zorder=1.5)
    axes.plot(0, 0, "o", color="white", mec="black", ms=7, label="start")
    low, high = story.true_ned[:, :2].min(axis=0), story.true_ned[:, :2].max(axis=0)
    north, east = 0.5 * (high + low)
    half = max(high[1] - low[1], (high[0] - low[0]) / _PLAN_SHAPE) / 2 + _GROUND_MARGIN_M
    axes.set_xlim(east - half, east + half)
    axes.set_ylim(north - _PLAN_SHAPE * half, north + _PLAN_SHAPE * half)
    axes.set(xlabel="east, m", ylabel="north, m", title="The flight over its ground (dark: lens covered)")
    axes.legend(loc="best", fontsize="small")


def _errors(axes: Any, story: _Story) -> None:
    _mark(axes, story)
    handles = []
    for errors, colour, label in ((story.vio, _VIO, "odometry"), (story.ekf, _EKF, "autopilot's estimate")):
        times_s, values = _broken(errors, errors.horizontal_m)
        _, sigmas_m = _broken(errors, np.hypot(*errors.sigmas_m[:, :2].T))
        handles += axes.plot(times_s, values, color=colour, lw=1.4, label=label)
        stated = f"{label}: 1 sigma, as stated"
        handles.append(axes.fill_between(times_s, 0, sigmas_m, color=colour, alpha=0.13, lw=0, label=stated))
    worst_m = max((float(one.horizontal_m.max()) for one in (story.vio, story.ekf) if len(one)), default=0.0)
    axes.set(ylabel="m", ylim=(0, max(_HEADROOM * worst_m, 0.5)), title="Horizontal error")
    axes.legend(handles=handles, loc="upper left", fontsize="small")


def _height(axes: Any, story: _Story) -> None:
    marks = _mark(axes, story)
    axes.plot(story.times_s, -story.true_ned[:, 2], color=_TRUTH, lw=5, alpha=0.9)
    for errors, colour in ((story.vio, _VIO), (story.ekf, _EKF)):
        times_s, down_m = _broken(errors, errors.pos_ned[:, 2])
        axes.plot(times_s, -down_m, color=colour, lw=1.2)
    axes.set(ylabel="m", title="Height above the start (the autopilot's is by barometer)")
    if marks:
        axes.legend(handles=marks, loc="lower center", fontsize="small")


def _quality(axes: Any, story: _Story) -> None:
    _mark(axes, story)
    least = story.loop.vehicle.params.get_int("VISO_QUAL_MIN")
    lines = [axes.axhline(least, color="0.3", lw=0.8, ls=":", label="VISO_QUAL_MIN")]
    for accepted, colour, label in ((True, "#2ca02c", "handed to the filter"), (False, "#d62728", "withheld from it")):
        chosen = [one for one in story.record.arrived if one.is_accepted is accepted]
        times_s, qualities = [one.time_us * 1e-6 for one in chosen], [one.message.quality for one in chosen]
        lines += axes.plot(times_s, qualities, ".", color=colour, ms=3, label=label)
    axes.set(ylim=(-6, 104), ylabel="%", title="Quality of each ODOMETRY message")
    axes.legend(handles=lines, loc="center left", fontsize="small", markerscale=3)


def _bands(axes: Any, story: _Story) -> None:
    _mark(axes, story)
    estimates = story.record.estimates
    times_s = [one.time_s for one in estimates]
    rows = {
        "camera healthy": [one.is_camera_healthy and one.time_us >= story.setup.companion_us for one in estimates],
        "aiding": [one.mode is not AidingMode.NONE for one in estimates],
        "position": [bool(one.flags & FilterFlag.HORIZ_POS_ABS) for one in estimates],
        "armed": [one.is_armed for one in estimates],
    }
    for span in story.record.states(story.setup.companion_us, story.loop.now_us):
        begin_s, length_s = span.start_us * 1e-6, (span.end_us - span.start_us) * 1e-6
        axes.broken_barh([(begin_s, length_s)], (-0.38, 0.76), color=_STATES[span.state])
        if length_s > _LABELLED * (story.end_s - story.start_s):
            middle = begin_s + 0.5 * length_s, 0
            axes.text(*middle, span.state.value, ha="center", va="center", fontsize="small", color="white")
    for row, holds in enumerate(rows.values(), 1):
        spans = [(start_s, end_s - start_s) for start_s, end_s in spans_of(times_s, holds)]
        axes.broken_barh(spans, (row - 0.38, 0.76), color="0.45")
    axes.set(yticks=range(1 + len(rows)), yticklabels=["odometry", *rows], xlabel="seconds since boot")
    axes.set_title("States: the odometry's, and what the autopilot makes of it")
    axes.invert_yaxis()


def save_plot(loop: CompanionLoop, path: Path) -> None:
    """Write the picture of a loop up to now as PNG. Raises InputError if it cannot be written."""
    story = _Story(loop)
    figure = Figure(figsize=(14, 10), layout="constrained")
    grid = figure.add_gridspec(4, 2, width_ratios=(1, 1.35), height_ratios=(1.25, 1, 1, 1))
    _plan(figure.add_subplot(grid[:3, 0]), story)
    over_time = [figure.add_subplot(grid[row, 1]) for row in range(3)]
    for axes, draw in zip(over_time, (_errors, _height, _quality), strict=True):
        draw(axes, story)
    wide = figure.add_subplot(grid[3, :])
    _bands(wide, story)
    for axes in (*over_time, wide):
        axes.set_xlim(story.start_s - 0.5, story.end_s)
        axes.grid(alpha=0.3)
    strategy = loop.setup.config.strategy
    figure.suptitle(f"viso demo: a camera looks down, {strategy} makes odometry of it, the autopilot navigates by that")
    with output_file(path) as file:
        figure.savefig(file, dpi=100, format="png")
