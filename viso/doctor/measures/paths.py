# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stream's positions against the vehicle's own path: scale and axes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from viso.doctor.measures.compare import ALIGNING_TYPES, Comparison
from viso.doctor.measures.tracks import Poses
from viso.doctor.measures.vehicle_position import EXTNAV, PositionSeries
from viso.estimators.orientation import ChosenAxes
from viso.estimators.positions import Scale, estimate_position_axes, estimate_scale

_FEWEST: Final = 40


@dataclass(frozen=True, slots=True, eq=False)
class PathComparison:
    """What the vehicle's own path says about a stream's.

    Attributes:
        poses: of the stream, as sent.
        origin: what tells the vehicle's path.
        scale: what positions have to be multiplied with.
        axes: which way those of the positions point; None where the stream's heading is not known.
    """

    poses: Poses
    origin: str
    scale: Scale
    axes: ChosenAxes | None


def _heading_deg(compared: Comparison | None, params: Mapping[str, float]) -> float | None:
    """Return the compass direction of the stream's x; None if nothing tells it."""
    if compared is not None and compared.orientation.sufficient and compared.world.sufficient:
        is_level = compared.world.axes.signed_axes[2] == 3
        return compared.world.heading_deg if is_level else None
    is_aligned = int(params.get("VISO_TYPE", 0)) in ALIGNING_TYPES or params.get("EK3_SRC1_YAW") == EXTNAV
    return None if is_aligned else 0.0


def compare_paths(
    poses: Sequence[Poses],
    position: PositionSeries | None,
    comparisons: Sequence[Comparison],
    params: Mapping[str, float],
) -> tuple[PathComparison, ...]:
    """Return what the vehicle's own path says about each track of poses."""
    if position is None:
        return ()
    found = []
    for one in poses:
        if len(one.track) < _FEWEST:
            continue
        compared = next((other for other in comparisons if other.poses is one), None)
        late = compared is not None and compared.since_arrival.enough_motion
        delay_ms = compared.since_arrival.delay_ms if compared is not None and late else 0.0
        paths = one.track.arrival_us, one.pos_m, position.time_us, position.ned_m
        heading_deg = _heading_deg(compared, params)
        axes = None
        if heading_deg is not None:
            axes = estimate_position_axes(*paths, heading_deg=heading_deg, delay_ms=delay_ms)
        found.append(PathComparison(one, position.origin, estimate_scale(*paths, delay_ms=delay_ms), axes))
    return tuple(found)
