# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The output of ``viso landmarks``: innovations as rows, and statistics for people and for machines."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from rich.table import Column, Table

from viso.landmarks.fit import PoseErrors
from viso.landmarks.residuals import Innovation, InnovationStatistics, Summary
from viso.landmarks.scene import Scene

MOST_ROWS: Final = 20
"""The most rows of single landmarks or aircraft in a table; JSON has all."""
_INNOVATION: Final = (
    *("id", "observed_u_px", "observed_v_px", "predicted_u_px", "predicted_v_px"),
    *("du_px", "dv_px", "in_image", "range_m"),
)
CSV_COLUMNS: Final = ("t_s", "picture", "pose", "kind", *_INNOVATION, "seen")
_AGREES_SIGMAS: Final = 3.0
_LEAST_SIGMA: Final = 1e-4
_UNTOLD: Final = "the data do not tell"


def scene_row(scene: Scene) -> dict[str, Any]:
    """Return the innovations of a scene for JSON.

    An aircraft with ``seen`` false was not detected: its innovation is the difference of the two poses.
    """
    landmarks, aircraft = scene.landmark_residuals, scene.aircraft_residuals
    return {
        "t_s": scene.t_s,
        "picture": scene.number,
        "pose": scene.situation.label,
        "innovations": [_innovation(innovation) for innovation in landmarks.innovations],
        "aircraft": [_innovation(innovation, seen=seen) for innovation, seen in _of_aircraft(scene)],
        "unmatched": [*landmarks.unmatched, *aircraft.unmatched],
        "not_projected": [*landmarks.not_projected, *aircraft.not_projected],
        "duplicates": [*landmarks.duplicates, *aircraft.duplicates],
    }


def csv_rows(scene: Scene) -> Iterator[tuple[Any, ...]]:
    """Yield the innovations of a scene, with the columns of ``CSV_COLUMNS``."""
    head = (scene.t_s, scene.number, scene.situation.label)
    for innovation in scene.landmark_residuals.innovations:
        yield (*head, "landmark", *_innovation(innovation).values(), True)
    for innovation, seen in _of_aircraft(scene):
        yield (*head, "aircraft", *_innovation(innovation).values(), seen)


def live_line(scene: Scene) -> str:
    """Return one line on a scene."""
    innovations = scene.landmark_residuals.innovations
    parts = [f"{scene.t_s:.2f} s #{scene.number} [{scene.situation.label}]", f"{len(innovations)} landmarks"]
    if innovations:
        count = len(innovations)
        du_px, dv_px = (
            sum(innovation.du_px for innovation in innovations),
            sum(innovation.dv_px for innovation in innovations),
        )
        parts.append(f"{du_px / count:+.1f} {dv_px / count:+.1f} px in the mean")
    if scene.aircraft:
        parts.append(f"{len(scene.aircraft)} aircraft")
    return ", ".join(parts)


def errors_row(errors: PoseErrors) -> dict[str, Any]:
    """Return a fit for JSON: angles in degrees, times in ms; null if undetermined."""
    return {
        "yaw_offset_deg": _scaled(errors.yaw_offset_rad, math.degrees(1)),
        "yaw_sigma_deg": _scaled(errors.yaw_sigma_rad, math.degrees(1)),
        "pitch_trim_deg": _scaled(errors.pitch_trim_rad, math.degrees(1)),
        "pitch_sigma_deg": _scaled(errors.pitch_sigma_rad, math.degrees(1)),
        "delay_ms": _scaled(errors.delay_s, 1e3),
        "delay_sigma_ms": _scaled(errors.delay_sigma_s, 1e3),
        "used": errors.used,
        "rejected": errors.rejected,
        "rms_px": errors.rms_px,
    }


def summary_row(summary: Summary) -> dict[str, Any]:
    """Return statistics for JSON."""
    return {
        "pictures": summary.pictures,
        **_statistics(summary.overall),
        "per_id": {name: _statistics(its) for name, its in summary.per_id.items()},
        "unmatched": dict(summary.unmatched),
        "not_projected": dict(summary.not_projected),
        "duplicates": dict(summary.duplicates),
    }


def summary_table(kind: str, summary: Summary) -> Table:
    """Return the statistics of landmarks or aircraft as a table."""
    numbers = [Column(name, justify="right") for name in ("count", "mean, px", "median, px", "spread, px")]
    table = Table(kind, *numbers, title=f"{summary.pictures} pictures: observed less predicted, u and v")
    table.add_row("all", *_cells(summary.overall))
    for name, its in list(summary.per_id.items())[:MOST_ROWS]:
        table.add_row(name, *_cells(its))
    rest = len(summary.per_id) - MOST_ROWS
    if rest > 0:
        table.add_row(f"and {rest} more")
    return table


def oddities(summary: Summary) -> Iterator[str]:
    """Yield lines on detections without an innovation."""
    for what, counts in (
        ("seen, but not known", summary.unmatched),
        ("seen, but not ahead of the camera, or of unknown height", summary.not_projected),
        ("seen twice in a picture; the first counts", summary.duplicates),
    ):
        if counts:
            names = [f"{name} ({count} times)" for name, count in list(counts.items())[:MOST_ROWS]]
            more = f" and {len(counts) - MOST_ROWS} more" if len(counts) > MOST_ROWS else ""
            yield f"{what}: {', '.join(names)}{more}"


def fit_lines(errors: PoseErrors) -> Iterator[str]:
    """Yield the results of a fit in sentences."""
    if not errors.used:
        yield f"no fit: {errors.rejected} observations of known landmarks with poses around them are too few"
        return
    yield f"heading: {_verdict(errors.yaw_offset_rad, errors.yaw_sigma_rad, math.degrees(1), 'deg', _heading)}"
    yield f"mounting: {_verdict(errors.pitch_trim_rad, errors.pitch_sigma_rad, math.degrees(1), 'deg', _mounting)}"
    still = ": a vehicle that stands still shows no delay" if errors.delay_s is None else ""
    yield f"time: {_verdict(errors.delay_s, errors.delay_sigma_s, 1e3, 'ms', _delay)}{still}"
    used, rejected = errors.used, errors.rejected
    yield f"from {used} observations, {rejected} left out; {errors.rms_px:.2f} px rms are left"


def _heading(off_deg: float, sigma_deg: float) -> str:
    side = "left of" if off_deg > 0 else "right of"
    makes_up = f"heading_offset_deg {_rounded(off_deg, sigma_deg):+} makes up"
    return f"your heading is off by {_measured(off_deg, sigma_deg)} deg: the true one is {side} it ({makes_up})"


def _mounting(off_deg: float, sigma_deg: float) -> str:
    side = "higher" if off_deg > 0 else "lower"
    makes_up = f"{_rounded(off_deg, sigma_deg):+} on pitch_trim_deg makes up"
    return f"the camera looks {_measured(off_deg, sigma_deg)} deg {side} than believed ({makes_up})"


def _delay(off_ms: float, sigma_ms: float) -> str:
    side = "late" if off_ms > 0 else "early"
    return f"the stamps of the pictures are {_measured(off_ms, sigma_ms)} ms {side}"


def _verdict(
    off: float | None, sigma: float | None, scale: float, unit: str, sentence: Callable[[float, float], str]
) -> str:
    """Return the sentence about an error with its sigma, both scaled to a unit."""
    if off is None or sigma is None:
        return _UNTOLD
    off, sigma = off * scale, sigma * scale
    return f"right, within {sigma:.1g} {unit}" if abs(off) <= _AGREES_SIGMAS * sigma else sentence(off, sigma)


def _measured(value: float, sigma: float) -> str:
    """Return the magnitude of a value with its sigma, to significant digits."""
    digits = _digits(sigma)
    return f"{abs(value):.{digits}f} +- {sigma:.{digits}f}"


def _rounded(value: float, sigma: float) -> float:
    return round(value, _digits(sigma))


def _digits(sigma: float) -> int:
    return min(max(-math.floor(math.log10(max(sigma, _LEAST_SIGMA))), 0), 4)


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _innovation(innovation: Innovation, **more: Any) -> dict[str, Any]:
    return {name: getattr(innovation, name) for name in _INNOVATION} | more


def _of_aircraft(scene: Scene) -> Iterator[tuple[Innovation, bool]]:
    """Yield the innovations of aircraft that were seen, then of those whose actual place is that of raw odometry."""
    yield from ((innovation, True) for innovation in scene.aircraft_residuals.innovations)
    for mark in scene.aircraft:
        if not mark.seen and mark.predicted is not None and mark.actual is not None:
            yield Innovation(mark.id, *mark.predicted, *mark.actual, mark.in_image, mark.range_m), False


def _statistics(its: InnovationStatistics) -> dict[str, Any]:
    if not its.count:
        return {"count": 0}
    pairs = {"mean": its.mean, "median": its.median, "spread": its.spread, "robust_spread": its.robust_spread}
    return {"count": its.count, **{f"{name}_px": list(pair) for name, pair in pairs.items()}}


def _cells(its: InnovationStatistics) -> tuple[str, ...]:
    if not its.count:
        return ("0", "-", "-", "-")
    mean, median = (f"{u:+.2f} {v:+.2f}" for u, v in (its.mean, its.median))
    return str(its.count), mean, median, f"{its.spread[0]:.2f} {its.spread[1]:.2f}"


def refusals(refused: Mapping[str, Mapping[str, int]]) -> Iterator[str]:
    """Yield a line for each input and reason why parts of it were unusable."""
    for name, reasons in refused.items():
        for reason, count in sorted(reasons.items()):
            yield f"note: {name}: {count} left out: {reason}"


def drops(dropped: Mapping[str, int]) -> Iterator[str]:
    """Yield a line for each reason why events were unusable."""
    for reason, count in sorted(dropped.items()):
        yield f"note: {count} left out: {reason}"
