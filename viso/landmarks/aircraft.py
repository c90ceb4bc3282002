# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Aircraft around the vehicle: from ADS-B reports to position, velocity and attitude in ENU.

ADS-B reports pressure altitude (1013.25 hPa); the vehicle's is above mean sea level or the ellipsoid. An offset for the
present pressure, if known, corrects for that; without it heights are off by some 8 m per hPa.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from viso.companion.vio.frames import yaw_of_heading
from viso.geometry.rotation import Array, quat_wxyz_from_rotation
from viso.landmarks.local_frame import FrameMode, to_enu
from viso.landmarks.observation import world_R_body
from viso.landmarks.types import (
    M_PER_FT,
    M_S_PER_FT_MIN,
    M_S_PER_KT,
    AircraftReport,
    AircraftState,
    GeodeticPoint,
    VehiclePose,
)

STALE_AFTER_S: Final = 15.0
NEAREST_DRAWN_M: Final = 50.0
FARTHEST_DRAWN_M: Final = 8000.0
_SLOWEST_WITH_PITCH_M_S: Final = 1.0
_LONGEST_TURN_S: Final = 10.0  # between two headings; an aircraft may have gone round meanwhile
_TURN_WEIGHT: Final = 0.3


@dataclass(frozen=True, slots=True)
class _Track:
    report: AircraftReport
    turn_rate_rad_s: float | None = None


class AircraftTracker:
    """The last report and the turn rate of every aircraft.

    An aircraft whose report is more than 15 s away from now, earlier or later, is left out. The offset is added to
    pressure altitudes.
    """

    def __init__(self, mode: FrameMode = FrameMode.WGS84, qnh_offset_m: float | None = None) -> None:
        self._mode = mode
        self._qnh_offset_m = qnh_offset_m
        self._tracks: dict[str, _Track] = {}

    def add(self, report: AircraftReport) -> None:
        """Add a report; one slightly older than the last of its aircraft is ignored."""
        track = self._tracks.get(report.icao)
        # A large step either way is a new start: long silence, or a clock that was set.
        if track is None or abs(report.t_s - track.report.t_s) > STALE_AFTER_S:
            self._tracks[report.icao] = _Track(report)
        elif report.t_s >= track.report.t_s:
            self._tracks[report.icao] = _Track(report, _turn_rate_rad_s(track, report))

    def states(self, now_s: float, origin: GeodeticPoint) -> tuple[AircraftState, ...]:
        """Return the present aircraft, ordered by address.

        Their origin has the vehicle's present latitude and longitude, and the altitude of the ground that its camera's
        height is measured from. Without a fix, (0, 0), there is no aircraft.
        """
        if not origin.is_fix:
            return ()
        fresh = (track for track in self._tracks.values() if abs(now_s - track.report.t_s) <= STALE_AFTER_S)
        return tuple(self._state(track, origin) for track in sorted(fresh, key=lambda track: track.report.icao))

    def _state(self, track: _Track, origin: GeodeticPoint) -> AircraftState:
        report = track.report
        alt_m = origin.alt_m if report.altitude_ft is None else report.altitude_ft * M_PER_FT
        enu = to_enu(self._mode, origin, report.latitude_deg, report.longitude_deg, alt_m)
        east_m, north_m, up_m = enu.tolist()
        offset_m = (self._qnh_offset_m or 0.0) if report.is_baro else 0.0
        return AircraftState(
            report,
            east_m,
            north_m,
            None if report.altitude_ft is None else up_m + offset_m,
            velocity_enu(report),
            attitude_wxyz(report),
            track.turn_rate_rad_s,
        )


def velocity_enu(report: AircraftReport) -> Array:
    """Return the velocity [3] in m/s of a report."""
    heading_rad, speed_m_s = math.radians(report.heading_deg), report.speed_kt * M_S_PER_KT
    up_m_s = report.vertical_rate_ft_min * M_S_PER_FT_MIN
    return np.array([speed_m_s * math.sin(heading_rad), speed_m_s * math.cos(heading_rad), up_m_s])


def attitude_wxyz(report: AircraftReport) -> Array:
    """Return the attitude [4], FLU to ENU, of an aircraft that flies along its nose without bank."""
    speed_m_s = report.speed_kt * M_S_PER_KT
    moves = speed_m_s > _SLOWEST_WITH_PITCH_M_S
    pitch_rad = math.atan2(report.vertical_rate_ft_min * M_S_PER_FT_MIN, speed_m_s) if moves else 0.0
    yaw_rad = yaw_of_heading(math.radians(report.heading_deg))
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    # Nose up is a negative turn about the axis to the left.
    cp, sp = math.cos(0.5 * pitch_rad), -math.sin(0.5 * pitch_rad)
    return np.array([cy * cp, -sy * sp, cy * sp, sy * cp])


def drawn(state: AircraftState) -> bool:
    """Return whether an aircraft is neither too near nor too far for a picture, horizontally."""
    return NEAREST_DRAWN_M <= state.range_m <= FARTHEST_DRAWN_M


def _turn_rate_rad_s(track: _Track, report: AircraftReport) -> float | None:
    """Return the turn rate about up, an exponential mean; headings grow clockwise, so the sign is reversed."""
    dt_s = report.t_s - track.report.t_s
    if not 0 < dt_s < _LONGEST_TURN_S:
        return track.turn_rate_rad_s
    change_rad = math.radians(math.remainder(report.heading_deg - track.report.heading_deg, 360))
    rate = -change_rad / dt_s
    if track.turn_rate_rad_s is None:
        return rate
    return (1 - _TURN_WEIGHT) * track.turn_rate_rad_s + _TURN_WEIGHT * rate


def state_vectors_record(
    t_s: float, origin: GeodeticPoint, vehicle: VehiclePose, states: Sequence[AircraftState]
) -> dict[str, Any] | None:
    """Return the state vectors of vehicle and aircraft as a record for JSON; None without a fix.

    An unknown height of the vehicle is 0, that of an aircraft is null.
    """
    if not origin.is_fix:
        return None
    sec, nanosec = divmod(round(t_s * 1e9), 1_000_000_000)
    orientation = quat_wxyz_from_rotation(world_R_body(vehicle))
    return {
        "header": {
            "frame_id": "local_enu",
            "stamp": {"sec": sec, "nanosec": nanosec},
            "origin_lla": {"lat": origin.latitude_deg, "lon": origin.longitude_deg, "alt_m": origin.alt_m},
        },
        "vehicle": {
            "pose": _pose(vehicle.x_m, vehicle.y_m, vehicle.z_m or 0.0, orientation),
            "twist": _twist(np.zeros(3), 0.0),  # unknown
        },
        "aircraft": [_aircraft(state) for state in states],
    }


def _aircraft(state: AircraftState) -> dict[str, Any]:
    report = state.report
    return {
        "icao": report.icao,
        "pose": _pose(state.east_m, state.north_m, state.up_m, state.quat_wxyz),
        "twist": _twist(state.vel_enu, state.turn_rate_rad_s or 0.0),
        "raw": {
            "speed_kts": report.speed_kt,
            "heading_deg": report.heading_deg,
            "vertical_rate_ftmin": report.vertical_rate_ft_min,
            "altitude_ft": report.altitude_ft,
            "latitude": report.latitude_deg,
            "longitude": report.longitude_deg,
        },
    }


def _pose(x_m: float, y_m: float, z_m: float | None, quat_wxyz: Array) -> dict[str, Any]:
    w, x, y, z = quat_wxyz.tolist()
    return {"position": {"x": x_m, "y": y_m, "z": z_m}, "orientation": {"x": x, "y": y, "z": z, "w": w}}


def _twist(vel_enu: Array, turn_rate_rad_s: float) -> dict[str, Any]:
    x, y, z = vel_enu.tolist()
    return {"linear": {"x": x, "y": y, "z": z}, "angular": {"x": 0.0, "y": 0.0, "z": turn_rate_rad_s}}
