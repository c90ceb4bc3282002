# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A rough position of an ADS-B receiver from the aircraft that it hears.

The middle of the aircraft is taken for the receiver, so this is kilometres off: the spread of the aircraft is not the
error of the receiver. It is for display only, and must never reach the autopilot. Needs the extra ``landmarks``.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from viso.extras import pip_install
from viso.geometry.rotation import Array
from viso.landmarks.aircraft import STALE_AFTER_S
from viso.landmarks.local_frame import FrameMode, to_enu, to_geodetic
from viso.landmarks.types import AircraftReport, GeodeticPoint

MISSING_EXTRA: Final = f"the receiver's position is filtered with filterpy: {pip_install('landmarks')}"
PERIOD_S: Final = 5.0
"""The period of estimates."""
FEWEST_AIRCRAFT: Final = 4
_AGE_SCALE_S: Final = 30.0
_UNKNOWN_ALTITUDE_FT: Final = 35_000.0
_LOW_FT: Final = 15_000.0
_ACCELERATION_M_S2: Final = 1.5
_SHORTEST_S, _LONGEST_S = 0.1, 30.0
_LEAST_SIGMA_M: Final = 100.0
_START_SPEED_VARIANCE: Final = 2500.0
_NIS_GATE: Final = 9.21  # 99 % of chi-square with two degrees of freedom
_LEAST_FILTERED_RADIUS_M: Final = 1000.0


@dataclass(frozen=True, slots=True)
class ReceiverEstimate:
    """The weighted middle of the aircraft, at height 0.

    Attributes:
        sigma_major_m, sigma_minor_m: spread of the aircraft along and across their cloud.
        confidence: 0 to 1.
        used_icaos: in the order of the addresses.
        rejected_outliers: how many aircraft were too far from the others.
    """

    t_s: float
    point: GeodeticPoint
    sigma_major_m: float
    sigma_minor_m: float
    confidence: float
    used_icaos: tuple[str, ...]
    rejected_outliers: int


@dataclass(frozen=True, slots=True)
class FilteredPosition:
    """The filtered estimate.

    Attributes:
        point: at height 0.
        radius_m: the receiver's distance bound from the filter's covariance.
        nis: normalised innovation squared of the last estimate; None for the first one.
        accepted: whether that was used.
    """

    point: GeodeticPoint
    radius_m: float
    nis: float | None
    accepted: bool


def estimate_receiver(
    reports: Iterable[AircraftReport], now_s: float, mode: FrameMode = FrameMode.WGS84
) -> ReceiverEstimate | None:
    """Return the weighted mean of recently heard aircraft; None for fewer than four.

    Args:
        reports: one of each aircraft.
        now_s: by the clock of the reports.
        mode: of the local frame.
    """
    fresh = (report for report in reports if abs(now_s - report.t_s) <= STALE_AFTER_S)
    heard = sorted(fresh, key=lambda report: report.icao)
    if len(heard) < FEWEST_AIRCRAFT:
        return None
    weights = _weights(heard, now_s)
    middle = _mean_place(heard, weights)
    enu = to_enu(
        mode, middle, [aircraft.latitude_deg for aircraft in heard], [aircraft.longitude_deg for aircraft in heard], 0.0
    )[:, :2]
    kept = _gate(enu, weights)
    centre, covariance = _moments(enu[kept], weights[kept])
    east_m, north_m = centre.tolist()
    minor_m, major_m = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance), 0.0)).tolist()
    used = [aircraft for aircraft, keep in zip(heard, kept.tolist(), strict=True) if keep]
    return ReceiverEstimate(
        now_s,
        to_geodetic(mode, middle, east_m, north_m, 0.0),
        major_m,
        minor_m,
        _confidence(used, len(heard), major_m),
        tuple(aircraft.icao for aircraft in used),
        len(heard) - len(used),
    )


def _weights(heard: Sequence[AircraftReport], now_s: float) -> Array:
    """Return weights with sum 1: fresh reports count more, and low aircraft, which cannot be heard from afar."""
    ages_s = np.array([max(now_s - report.t_s, 0.0) for report in heard])
    alts_ft = np.array([_UNKNOWN_ALTITUDE_FT if report.altitude_ft is None else report.altitude_ft for report in heard])
    # Pressure altitudes below the sea's level are real, but a weight needs a height above it.
    weights: Array = np.exp(-ages_s / _AGE_SCALE_S) / np.sqrt(np.maximum(alts_ft, 0.0) + 500)
    weights /= weights.sum()
    return weights


def _mean_place(heard: Sequence[AircraftReport], weights: Array) -> GeodeticPoint:
    latitude_deg = float(weights.dot([report.latitude_deg for report in heard]))
    # Counted from one of them: they may be on both sides of the date line.
    first_deg = heard[0].longitude_deg
    turn_deg = float(weights.dot([math.remainder(report.longitude_deg - first_deg, 360) for report in heard]))
    return GeodeticPoint(latitude_deg, math.remainder(first_deg + turn_deg, 360))


def _moments(enu: Array, weights: Array) -> tuple[Array, Array]:
    share = weights / weights.sum()
    centre = share.dot(enu)
    off = enu - centre
    return centre, (off * share[:, np.newaxis]).T.dot(off)


def _gate(enu: Array, weights: Array) -> Any:
    """Return which of the places are near the others, bool [N]; all of them if too few are."""
    centre, _ = _moments(enu, weights)
    off = enu - centre
    distances_m = np.hypot(off[:, 0], off[:, 1])
    median_m = np.median(distances_m)
    mad_m = np.median(np.abs(distances_m - median_m))
    kept = distances_m <= median_m + 2.5 * (mad_m + 1.0)
    return kept if np.count_nonzero(kept) >= FEWEST_AIRCRAFT else np.ones(len(enu), dtype=bool)


def _confidence(used: Sequence[AircraftReport], heard: int, sigma_major_m: float) -> float:
    low = sum(report.altitude_ft is not None and report.altitude_ft < _LOW_FT for report in used)
    many = 0.30 * min(len(used) / 20, 1) + 0.30 * min(low / 6, 1)
    return many + 0.25 * math.exp(-sigma_major_m / 40e3) + 0.15 * len(used) / heard


class ReceiverFilter:
    """A constant-velocity filter over the estimates: east, north and their rates, from the first estimate's place."""

    def __init__(self, mode: FrameMode = FrameMode.WGS84) -> None:
        """Start without a position. Raises ModuleNotFoundError without filterpy; one line that says what to install."""
        try:
            # Imported here, because it takes a second that only estimation needs.
            from filterpy.kalman import KalmanFilter
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(MISSING_EXTRA, name="filterpy") from error
        self._mode = mode
        self._filter = KalmanFilter(dim_x=4, dim_z=2)
        self._filter.H = np.eye(2, 4)
        self._origin: GeodeticPoint | None = None
        self._t_s = 0.0

    def update(self, estimate: ReceiverEstimate) -> FilteredPosition:
        """Take the next estimate."""
        variance = max(_LEAST_SIGMA_M, estimate.sigma_major_m) ** 2
        nis = None
        accepted = True
        if self._origin is None:
            self._origin = estimate.point
            self._filter.P = np.diag([variance, variance, _START_SPEED_VARIANCE, _START_SPEED_VARIANCE])
        else:
            self._predict(estimate.t_s)
            nis = self._nis(self._origin, estimate.point, variance)
            accepted = nis <= _NIS_GATE
            if accepted:
                self._filter.update(self._seen(self._origin, estimate.point), R=variance * np.eye(2))
        self._t_s = estimate.t_s
        return self._position(self._origin, nis, accepted)

    def _predict(self, t_s: float) -> None:
        from filterpy.common import Q_discrete_white_noise

        dt_s = min(max(t_s - self._t_s, _SHORTEST_S), _LONGEST_S)
        moves = np.eye(4)
        moves[0, 2] = moves[1, 3] = dt_s
        noise = Q_discrete_white_noise(2, dt_s, _ACCELERATION_M_S2**2, block_size=2, order_by_dim=False)
        self._filter.predict(F=moves, Q=noise)

    def _seen(self, origin: GeodeticPoint, point: GeodeticPoint) -> Array:
        enu = to_enu(self._mode, origin, point.latitude_deg, point.longitude_deg, 0.0)
        return enu[:2, np.newaxis]

    def _nis(self, origin: GeodeticPoint, point: GeodeticPoint, variance: float) -> float:
        innovation = self._seen(origin, point) - self._filter.x[:2]
        spread = self._filter.P[:2, :2] + variance * np.eye(2)
        return float((innovation.T @ np.linalg.solve(spread, innovation)).item())

    def _position(self, origin: GeodeticPoint, nis: float | None, accepted: bool) -> FilteredPosition:
        east_m, north_m = self._filter.x[:2, 0].tolist()
        place = to_geodetic(self._mode, origin, east_m, north_m, 0.0)
        sigma_m = math.sqrt(np.linalg.eigvalsh(self._filter.P[:2, :2])[-1])
        return FilteredPosition(place, max(_LEAST_FILTERED_RADIUS_M, 2 * sigma_m), nis, accepted)


def receiver_record(raw: ReceiverEstimate, filtered: FilteredPosition) -> dict[str, Any]:
    """Return an estimate and its filtered position as a record for JSON; the first one's ``kf_nis`` is null."""
    place = filtered.point
    return {
        "raw_lat": raw.point.latitude_deg,
        "raw_lon": raw.point.longitude_deg,
        "kf_lat": place.latitude_deg,
        "kf_lon": place.longitude_deg,
        "lat": place.latitude_deg,
        "lon": place.longitude_deg,
        "kf_radius_km": filtered.radius_m / 1000,
        "kf_nis": filtered.nis,
        "kf_update_accepted": filtered.accepted,
        "sigma_major_km": raw.sigma_major_m / 1000,
        "sigma_minor_km": raw.sigma_minor_m / 1000,
        "confidence": raw.confidence,
        "used_icaos": list(raw.used_icaos),
        "aircraft_used": len(raw.used_icaos),
        "rejected_outliers": raw.rejected_outliers,
    }
