# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of a visual-inertial odometry's progress and results."""

from collections.abc import Mapping
from typing import Any, Final

from rich.table import Column, Table
from rich.text import Text

from viso.companion.run.log import LoggedFrame
from viso.companion.vio.types import VioState

STYLES: Final = {
    VioState.INIT: "blue",
    VioState.TRACKING: "green",
    VioState.DEGRADED: "yellow",
    VioState.LOST: "bold red",
}
_NONE: Final = "-"


def live_table(frame: LoggedFrame | None) -> Table:
    """Return a table of the state after a frame; None before the first."""
    columns = [Column(name, justify="right") for name in ("tracked", "inliers", "parallax", "position, m", "sigma")]
    table = Table("state", "reason", *columns, Column("ms", justify="right"), Column("dropped", justify="right"))
    if frame is None:
        return table
    output = frame.result.output
    cells = [_NONE] * len(columns)
    if output is not None:
        quality, place = output.feature_quality, output.world_T_body.t
        position = " ".join(f"{value:8.2f}" for value in place)
        sigma = _NONE if frame.sigma_m is None else f"{frame.sigma_m:.2f} m"
        cells = [str(quality.tracked), str(quality.inliers), f"{quality.mean_parallax_px:.1f} px", position, sigma]
    state = Text(frame.state.value, STYLES[frame.state])
    row: list[str | Text] = [
        state,
        frame.result.reason,
        *cells,
        f"{frame.total_ms:.0f}",
        str(frame.result.dropped),
    ]
    if counters := frame.result.counters:
        table.add_column("engine")
        row.append(_counts(counters))
    table.add_row(*row)
    return table


def summary_table(name: str, summary: Mapping[str, Any]) -> Table:
    """Return the closing table."""
    table = Table("", "", title=f"{name}: {summary['frames']} frames in {summary['seconds']:.1f} s", show_header=False)
    for what, text in _rows(summary):
        table.add_row(what, text)
    return table


def _rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    states = ", ".join(f"{count} {state}" for state, count in summary["states"].items()) or _NONE
    ended = _NONE if summary["ended"] is None else f"{summary['ended']} ({summary['reason']})"
    sigma = "" if summary["sigma_m"] is None else f", known to {summary['sigma_m']:.2f} m at the end"
    rows = [
        ("states", states),
        ("ended", ended),
        ("path", f"{summary['path_m']:.1f} m in {summary['poses']} poses{sigma}"),
        ("error (ATE)", _error(summary)),
        ("tracked", _NONE if summary["tracked_median"] is None else f"{summary['tracked_median']:.0f} in the median"),
        ("time a frame", _times(summary)),
        ("dropped", f"{summary['dropped']} frames"),
        ("resets", str(summary["resets"])),
    ]
    if "engine" in summary:
        rows.append(("engine", _counts(summary["engine"])))
    sent = summary.get("sent")
    if sent is not None:
        rows.append(("sent", ", ".join(f"{count} {name}" for name, count in sent.items()) or "nothing"))
    return rows


def _counts(counters: Mapping[str, int]) -> str:
    counts = (f"{count} {name.replace('_', ' ')}" for name, count in counters.items() if count)
    return ", ".join(counts) or "no failure"


def _error(summary: Mapping[str, Any]) -> str:
    if summary["ate_m"] is None:
        return "the truth is not known"
    share = f", {summary['ate_m'] / summary['true_path_m']:.1%}" if summary["true_path_m"] else ""
    return f"{summary['ate_m']:.3f} m over {summary['true_path_m']:.1f} m{share}; scale {summary['scale_error']:+.1%}"


def _times(summary: Mapping[str, Any]) -> str:
    if summary["ms_median"] is None:
        return _NONE
    return f"{summary['ms_median']:.1f} ms in the median, 95 % below {summary['ms_95']:.1f} ms"
