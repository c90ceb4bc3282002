# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The true state of a flying vehicle, as the firmware's simulator sends it (SITL/SITL.cpp)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mav_handlers.channel import Channel
from mav_handlers.wire.messages import SIM_STATE, SIMSTATE

if TYPE_CHECKING:
    from viso.vehicle.copter.flying.flight_control import FlightTruth
    from viso.vehicle.vehicle import Vehicle


def _truth(vehicle: Vehicle) -> FlightTruth | None:
    flight = vehicle.copter.flight
    return None if flight is None else flight.truth()


def simstate(vehicle: Vehicle, _channel: Channel, _now_us: int) -> SIMSTATE | None:
    """Attitude, inertial data and location; not sent for a vehicle without a flight (SIM::simstate_send)."""
    if (truth := _truth(vehicle)) is None:
        return None
    return SIMSTATE(*truth.rpy_rad, *truth.acc_frd_m_s2, *truth.rates_frd_rad_s, truth.place.lat, truth.place.lng)


def sim_state(vehicle: Vehicle, _channel: Channel, _now_us: int) -> SIM_STATE | None:
    """The same with the velocity; location in 1e-7 degrees (SIM::sim_state_send)."""
    if (truth := _truth(vehicle)) is None:
        return None
    return SIM_STATE(
        *truth.quat_wxyz,
        *truth.rpy_rad,
        *truth.acc_frd_m_s2,
        *truth.rates_frd_rad_s,
        float(truth.place.lat),
        float(truth.place.lng),
        0.01 * truth.place.alt_cm,
        0.0,
        0.0,
        *truth.vel_ned_m_s,
        truth.place.lat,
        truth.place.lng,
    )
