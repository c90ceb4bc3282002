# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a visual-inertial odometry's flight: its path from above, and its states and errors over time."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from viso.companion.run.log import VioLog
from viso.companion.vio.types import VioState
from viso.files.outputs import output_file
from viso.geometry.rotation import Array
from viso.geometry.trajectory import Trajectory

_TRUTH: Final = "0.45"
_PATH: Final = "#1f77b4"
_SECOND: Final = "#9467bd"
_SHADES: Final = {VioState.INIT: "#d6e6f5", VioState.DEGRADED: "#ffe9b3", VioState.LOST: "#f8cfc9"}


def save_plot(log: VioLog, truth: Trajectory | None, title: str, path: Path, *, aligned: bool) -> None:
    """Write the picture as PNG.

    Args:
        truth: the ground truth of the path.
        aligned: whether to rotate and shift the estimate onto the truth, as when their worlds differ.

    Raises:
        InputError: if it cannot be written.
    """
    estimate = log.trajectory()
    truth = _during(log, truth)
    error = log.error(truth) if aligned else None
    positions = estimate.positions if error is None else error.alignment.map(estimate.positions)
    figure = Figure(figsize=(13, 8), layout="constrained")
    grid = figure.add_gridspec(4, 2, width_ratios=(1, 1.2))
    rows = [figure.add_subplot(grid[row, 1]) for row in range(4)]
    _plan(figure.add_subplot(grid[:, 0]), positions, truth)
    _height(rows[0], _since_start_s(log, estimate.times_ns), positions, log, truth)
    _sigma(rows[1], log)
    _features(rows[2], log)
    _times(rows[3], log)
    for axes in rows:
        _shade(axes, log)
        axes.grid(alpha=0.3)
    figure.legend(handles=_handles(log, truth, turned=error is not None), ncols=7, loc="outside lower center")
    figure.suptitle(title)
    with output_file(path) as file:
        figure.savefig(file, dpi=110, format="png")


def _during(log: VioLog, truth: Trajectory | None) -> Trajectory | None:
    """Return the truth while there were frames, None if there is none."""
    if truth is None or not log.frames:
        return None
    part = truth.within(log.frames[0].t_ns, log.frames[-1].t_ns)
    return part if len(part) else None


def _since_start_s(log: VioLog, t_ns: Any) -> Array:
    start_ns = log.frames[0].t_ns if log.frames else 0
    return (np.asarray(t_ns, np.int64) - start_ns).astype(np.float64) * 1e-9


def _frame_s(log: VioLog) -> Array:
    return _since_start_s(log, [frame.t_ns for frame in log.frames])


def _plan(axes: Any, positions: Array, truth: Trajectory | None) -> None:
    if truth is not None:
        axes.plot(*truth.positions[:, :2].T, color=_TRUTH, lw=4, alpha=0.5)
    axes.plot(*positions[:, :2].T, color=_PATH, lw=1.2, marker=".", ms=3)
    for index, marker in ((0, "o"), (-1, "s")):
        if len(positions):
            axes.plot(*positions[index, :2], marker, color=_PATH, ms=7)
    axes.set(xlabel="x, m", ylabel="y, m", title="Path from above, from the circle to the square")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)


def _height(axes: Any, times_s: Array, positions: Array, log: VioLog, truth: Trajectory | None) -> None:
    if truth is not None:
        axes.plot(_since_start_s(log, truth.times_ns), truth.positions[:, 2], color=_TRUTH, lw=4, alpha=0.5)
    axes.plot(times_s, positions[:, 2], color=_PATH, lw=1.2)
    axes.set(ylabel="z, m", title="Height")


def _sigma(axes: Any, log: VioLog) -> None:
    sigmas = np.array([np.nan if frame.sigma_m is None else frame.sigma_m for frame in log.frames])
    axes.plot(_frame_s(log), sigmas, color=_PATH, lw=1.2)
    axes.set(ylabel="sigma, m", title="How well the position is known against the start")
    axes.set_ylim(bottom=0.0)


def _features(axes: Any, log: VioLog) -> None:
    outputs = [frame.result.output for frame in log.frames]
    tracked = [np.nan if output is None else output.feature_quality.tracked for output in outputs]
    inliers = [np.nan if output is None else output.feature_quality.inliers for output in outputs]
    axes.plot(_frame_s(log), tracked, color=_PATH, lw=1.2)
    axes.plot(_frame_s(log), inliers, color=_SECOND, lw=1.2)
    axes.set(ylabel="features", title="Features tracked, and those among them that agree")
    axes.set_ylim(bottom=0.0)


def _times(axes: Any, log: VioLog) -> None:
    axes.plot(_frame_s(log), [frame.total_ms for frame in log.frames], color=_PATH, lw=0, marker=".", ms=3)
    axes.set(ylabel="ms", xlabel="seconds since the first frame", title="Time a frame")
    axes.set_ylim(bottom=0.0)


def _shade(axes: Any, log: VioLog) -> None:
    """Colour the stretches in which a state lasted; and show the whole flight."""
    times_s = _frame_s(log)
    if not len(times_s):
        return
    ends_s = [*times_s[1:], times_s[-1]]
    states = np.array([list(VioState).index(frame.state) for frame in log.frames])
    for first, last in _stretches(states):
        colour = _SHADES.get(log.frames[first].state)
        if colour is not None:
            axes.axvspan(times_s[first], ends_s[last], color=colour, lw=0, zorder=0)
    axes.set_xlim(times_s[0], max(times_s[-1], times_s[0] + 1e-3))


def _stretches(values: npt.NDArray[np.int64]) -> list[tuple[int, int]]:
    """Return the first and the last index of each stretch of equal values."""
    edges = np.flatnonzero(np.diff(values)) + 1
    return [(int(part[0]), int(part[-1])) for part in np.split(np.arange(len(values)), edges)]


def _handles(log: VioLog, truth: Trajectory | None, *, turned: bool) -> list[Any]:
    name = "estimate, turned and shifted onto the truth" if turned else "estimate"
    handles: list[Any] = [Line2D([], [], color=_PATH, label=name)]
    if truth is not None:
        handles.append(Line2D([], [], color=_TRUTH, lw=4, alpha=0.5, label="truth, as far as known"))
    handles.append(Line2D([], [], color=_SECOND, label="features that agree"))
    states = {frame.state for frame in log.frames}
    return handles + [Patch(color=shade, label=state.value) for state, shade in _SHADES.items() if state in states]
