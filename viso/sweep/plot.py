# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of a sweep: figures along an axis, over two axes, or against each axis."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from viso.files.outputs import output_file
from viso.replay.figures import OBJECTIVES
from viso.sweep.best import best_rows
from viso.sweep.plan import SweepPlan
from viso.sweep.result_tables import changed_columns, found, swept_axes

_BESIDE: Final = ("nis_velocity", "nis_pose", "fused_share", "rejected", "ate_m", "time_to_aiding_s")
_MOST_PANELS: Final = 6
_MOST_IN_LEGEND: Final = 12
_BEST: Final = "#d62728"
_WIDE: Final = 3.0

Row = dict[str, Any]


def save_plot(plan: SweepPlan, rows: Sequence[Row], objective: str, path: Path) -> None:
    """Write the picture as PNG. Raises InputError if it cannot be written."""
    axes = swept_axes(plan)
    if len(axes) == 1:
        figure = _along(plan, rows, objective, axes[0])
    elif len(axes) == 2 and plan.sampling is None:
        figure = _over_two(plan, rows, objective, (axes[0], axes[1]))
    elif axes:
        figure = _against_each(rows, objective, axes)
    else:
        figure = _by_group(plan, rows, objective)
    figure.suptitle(f"{objective}: {OBJECTIVES[objective].what} (the filter is a model)", fontsize="medium")
    with output_file(path) as file:
        figure.savefig(file, dpi=110, format="png")


def _label(name: str) -> str:
    unit = OBJECTIVES[name].unit if name in OBJECTIVES else ""
    return f"{name}, {unit}" if unit else name


def _groups(plan: SweepPlan, rows: Sequence[Row], but: Sequence[str]) -> dict[str, list[Row]]:
    """Group the rows by all in which they differ but some axes."""
    names = [name for name in changed_columns(plan) if name not in but]
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(", ".join(f"{name} {_short(row[name])}" for name in names), []).append(row)
    return groups


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else Path(value).name if isinstance(value, str) else str(value)


def _varied(rows: Sequence[Row], objective: str) -> list[str]:
    """Return the objective, and what else is not the same everywhere."""
    names = [objective]
    for name in _BESIDE:
        if name != objective and len({row[name] for row in rows if row[name] is not None}) > 1:
            names.append(name)
    return names[:_MOST_PANELS]


def _is_wide(values: Sequence[float]) -> bool:
    """Return whether a minimum among these is visible on a logarithmic scale only."""
    return bool(values) and min(values) > 0 and max(values) > _WIDE * min(values)


def _along(plan: SweepPlan, rows: Sequence[Row], objective: str, axis: str) -> Figure:
    names = _varied(rows, objective)
    figure = Figure(figsize=(9, 2.2 * len(names) + 1.2), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    groups = _groups(plan, rows, (axis,))
    for panel, name in zip(panels, names, strict=True):
        for label, members in groups.items():
            known = sorted((row[axis], row[name]) for row in members if row[name] is not None)
            panel.plot(*zip(*known, strict=True) if known else ((), ()), ".-", lw=1, label=label)
        panel.set_ylabel(_label(name))
        panel.grid(alpha=0.3, which="both")
        if _is_wide([row[name] for row in rows if row[name] is not None]):
            panel.set_yscale("log")
    for best in found(plan, rows, objective):
        place = best.at if best.vertex is None else best.vertex
        panels[0].axvline(place, color=_BEST, lw=0.8, ls="--")
        _name(panels[0], place, best.value, "" if not best.at_edge else " or less" if best.is_first else " or more")
    panels[-1].set_xlabel(axis)
    if 1 < len(groups) <= _MOST_IN_LEGEND:
        figure.legend(*panels[0].get_legend_handles_labels(), fontsize="small", ncols=3, loc="outside lower center")
    return figure


def _name(panel: Any, place: float, value: float, bound: str) -> None:
    """Write where the best is beside it, on the side that has room."""
    low, high = panel.get_xlim()
    is_right = place > (low + high) / 2
    offset, align = ((-6, 6), "right") if is_right else ((6, 6), "left")
    text = panel.annotate(
        f"{place:.4g}{bound}", (place, value), textcoords="offset points", xytext=offset, ha=align, color=_BEST
    )
    text.set_path_effects([withStroke(linewidth=3, foreground="white")])


def _over_two(plan: SweepPlan, rows: Sequence[Row], objective: str, axes: tuple[str, str]) -> Figure:
    groups = list(_groups(plan, rows, axes).items())[:_MOST_PANELS]
    figure = Figure(figsize=(min(6.5 * len(groups), 20) + 1, 5.5), layout="constrained")
    panels = figure.subplots(1, len(groups), squeeze=False)[0]
    known = [row[objective] for row in rows if row[objective] is not None] or [0.0]
    image = None
    for panel, (label, members) in zip(panels, groups, strict=True):
        across, up = (sorted({row[axis] for row in members}) for axis in axes)
        grid = np.full((len(up), len(across)), np.nan)
        for row in members:
            if row[objective] is not None:
                grid[up.index(row[axes[1]]), across.index(row[axes[0]])] = row[objective]
        image = panel.pcolormesh(_edges(across), _edges(up), grid, cmap="viridis", vmin=min(known), vmax=max(known))
        for best in best_rows(members, objective, 1):
            panel.plot(best[axes[0]], best[axes[1]], "x", color=_BEST, ms=9, mew=2)
            edges = [name for name, values in zip(axes, (across, up), strict=True) if _bound(best[name], values)]
            if edges:
                label = "\n".join(filter(None, [label, f"best at the edge of {' and '.join(edges)}"]))
        panel.set(xlabel=axes[0], ylabel=axes[1], title=label)
    if image is not None:
        figure.colorbar(image, ax=list(panels), label=_label(objective))
    return figure


def _bound(value: float, values: Sequence[float]) -> str:
    """Return how a value goes on, if what is best may lie beyond those that were tried."""
    if len(set(values)) < 2:
        return ""
    return " or less" if value == min(values) else " or more" if value == max(values) else ""


def _edges(values: Sequence[float]) -> Any:
    """Return the borders of cells around values."""
    if len(values) == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    middles = (np.array(values[1:]) + np.array(values[:-1])) / 2
    return np.concatenate([[2 * values[0] - middles[0]], middles, [2 * values[-1] - middles[-1]]])


def _against_each(rows: Sequence[Row], objective: str, axes: Sequence[str]) -> Figure:
    shown = axes[: 2 * _MOST_PANELS]
    columns = min(len(shown), 3)
    lines = -(-len(shown) // columns)
    figure = Figure(figsize=(4.5 * columns, 3.4 * lines + 0.6), layout="constrained")
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    known = [row for row in rows if row[objective] is not None]
    best = best_rows(known, objective, 1)
    for panel, axis in zip(panels, shown, strict=False):
        values = [row[axis] for row in known]
        panel.plot(values, [row[objective] for row in known], ".", ms=4, alpha=0.6)
        for row in best:
            panel.plot(row[axis], row[objective], "x", color=_BEST, ms=9, mew=2)
            _name(panel, row[axis], row[objective], _bound(row[axis], values))
        panel.set(xlabel=axis)
        panel.grid(alpha=0.3)
    for panel in panels[len(shown) :]:
        panel.set_axis_off()
    for panel in panels[::columns]:
        panel.set_ylabel(_label(objective))
    return figure


def _by_group(plan: SweepPlan, rows: Sequence[Row], objective: str) -> Figure:
    groups = _groups(plan, rows, ("seed",))
    figure = Figure(figsize=(9, 0.45 * len(groups) + 1.6), layout="constrained")
    panel = figure.subplots()
    for height, members in enumerate(groups.values()):
        known = [row[objective] for row in members if row[objective] is not None]
        panel.plot(known, [height] * len(known), "o", color="#1f77b4", alpha=0.6)
    panel.set(xlabel=_label(objective), yticks=range(len(groups)), yticklabels=list(groups))
    panel.invert_yaxis()
    panel.grid(alpha=0.3)
    return figure
