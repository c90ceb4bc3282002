# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A sweep's results for people: the best points, and where an objective has its minimum."""

from collections.abc import Sequence
from typing import Any, Final

from rich.table import Column, Table

from viso.compare.merit import SIGMAS
from viso.replay.figures import LOWER_IS_BETTER, OBJECTIVES
from viso.replay.observability import unobservable
from viso.sweep.best import GROUPED_BY, RESOLUTIONS, Best, best_along, best_rows
from viso.sweep.plan import DELAY, Recorded, SweepPlan

_MOST_ROWS: Final = 40
_BEST_ROWS: Final = 10
_BESIDE: Final = ("nis", "fused_share", "rejected", "resets", "time_to_aiding_s", "log_m", "ate_m")

Row = dict[str, Any]


def swept_axes(plan: SweepPlan) -> list[str]:
    """Return the names of the axes that have more than one value."""
    return [axis.name for axis in plan.axes if axis.span is not None or len(axis.values) > 1]


def swept_axis(plan: SweepPlan) -> str | None:
    """Return the name of the one axis that has more than one value; None where there are none or several."""
    names = swept_axes(plan)
    return names[0] if len(names) == 1 else None


def changed_columns(plan: SweepPlan) -> list[str]:
    """Return the columns in which points differ."""
    lists = zip(GROUPED_BY, (plan.recordings, plan.firmware, plan.faults, plan.seeds), strict=True)
    return [*(name for name, members in lists if len(members) > 1), *(axis.name for axis in plan.axes)]


def result_table(plan: SweepPlan, rows: Sequence[Row], objective: str) -> Table:
    """Return all rows of a small sweep in order, or the best ones."""
    shown = list(rows) if len(rows) <= _MOST_ROWS else best_rows(rows, objective, _BEST_ROWS)
    title = f"{len(rows)} points" if len(rows) <= _MOST_ROWS else f"The best {_BEST_ROWS} of {len(rows)} points"
    figures = [objective, *(name for name in _BESIDE if name != objective and len({row[name] for row in shown}) > 1)]
    changed = changed_columns(plan)
    table = Table(
        *(Column(name, justify="right", overflow="fold") for name in (*changed, *figures)),
        title=f"{title}, by {objective}",
    )
    best = best_rows(rows, objective, 1)
    for row in shown:
        style = "green" if row in best else None
        table.add_row(*(_cell(row[name]) for name in (*changed, *figures)), style=style)
    return table


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)


def found(plan: SweepPlan, rows: Sequence[Row], objective: str) -> list[Best]:
    """Return the best point along the one axis that is swept, of each group; nothing where there is no one axis."""
    axis = swept_axis(plan)
    return [] if axis is None else best_along(rows, axis, objective)


def best_lines(plan: SweepPlan, bests: Sequence[Best], objective: str) -> list[str]:
    """Return a line a group that says where its objective is best."""
    axis = swept_axis(plan) or ""
    return [_line(plan, best, axis, objective) for best in bests]


def _line(plan: SweepPlan, best: Best, axis: str, objective: str) -> str:
    extreme = "least" if objective in LOWER_IS_BETTER else "greatest"
    changed = [name for name in changed_columns(plan) if name != axis and name in GROUPED_BY]
    group = ", ".join(f"{name} {best.row[name]}" for name in changed)
    start = f"{group + ': ' if group else ''}"
    if reason := unjudged(plan, best, axis, objective):
        return f"{start}{axis} cannot be judged: {reason}"
    unit = OBJECTIVES[objective].unit
    same = "" if best.same_until == best.at else f", and the same up to {best.same_until:g}"
    value = f"{best.value:.6g}{unit and ' ' + unit}"
    text = f"{start}{objective} is {extreme} at {axis} {best.at:g}{same} ({value})"
    if best.at_edge:
        text += ", at the edge of what was tried: what is best may lie beyond"
    elif best.vertex is not None:
        text += f"; a parabola has it at {best.vertex:{'.1f' if axis == DELAY else '.6g'}}"
    text += _chance(best, axis)
    return text + (_age(plan, best) if axis == DELAY and best.stands_out is not False else "")


def _chance(best: Best, axis: str) -> str:
    if best.alike is None:
        return ""
    if not best.stands_out:
        return f"; no value is worse by more than chance ({SIGMAS:g} deviations): this material does not show {axis}"
    low, high = best.alike
    step = f", or a step of the filter, {RESOLUTIONS[axis]:g} ms" if axis in RESOLUTIONS else ""
    return "" if low == high else f"; {low:g} to {high:g} are not told apart ({SIGMAS:g} deviations{step})"


def unjudged(plan: SweepPlan, best: Best, axis: str, objective: str) -> str | None:
    """Return why what is best along an axis says nothing; None if it does."""
    if axis.endswith("_NSE") and objective.startswith("nis"):
        return f"{objective} counts innovations in units of it; rms_... does not"
    return None if _recorded(plan, best).ahrs else unobservable(axis, _recorded(plan, best).imu)


def age_ms(best: Best) -> float | None:
    """Return how old samples are when they arrive, in ms, where the best VISO_DELAY_MS is right; None if unknown."""
    lag_ms = best.row["stamp_lag_ms"]
    return None if lag_ms is None else (best.at if best.vertex is None else best.vertex) + float(lag_ms)


def _age(plan: SweepPlan, best: Best) -> str:
    age = age_ms(best)
    if age is None:
        return ""
    bound = "" if not best.at_edge else " or less" if best.is_first else " or more"
    lag = best.row["stamp_lag_ms"]
    hint = "; with --baud 0 stamps are later" if best.is_first and best.at == 0 and plan.baud != 0 else ""
    return f". Corrected stamps are {lag:.1f} ms before the arrival: samples arrive {age:.1f} ms{bound} old{hint}"


def _recorded(plan: SweepPlan, best: Best) -> Recorded:
    return next(recorded for recorded in plan.recordings if recorded.name == best.row["stream"])


def best_as_dict(plan: SweepPlan, best: Best, objective: str) -> dict[str, Any]:
    """Return the best point of a group for machines."""
    axis = swept_axis(plan) or ""
    names = ("at", "same_until", "value", "vertex", "at_edge", "alike", "stands_out")
    group, figures = {name: best.row[name] for name in GROUPED_BY}, {name: getattr(best, name) for name in names}
    row = {**group, "axis": axis, **figures, "unjudged": unjudged(plan, best, axis, objective)}
    return {**row, "age_on_arrival_ms": age_ms(best)} if axis == DELAY else row
