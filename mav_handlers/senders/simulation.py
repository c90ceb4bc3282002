# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The true state of a flying vehicle, as the firmware's simulator sends it (SITL/SITL.cpp)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ap_core.location import Location
from mav_handlers.channel import Channel
from mav_handlers.senders.position import NOWHERE
from mav_handlers.wire.messages import SIM_STATE, SIMSTATE

if TYPE_CHECKING:
    from viso.vehicle.copter.flying.flight_control import FlightTruth
    from viso.vehicle.vehicle import Vehicle


def _truth(vehicle: Vehicle) -> tuple[FlightTruth, Location] | None:
    flight = vehicle.copter.flight
    if flight is None:
        return None
    truth = flight.truth()
    return truth, truth.place or NOWHERE


def simstate(vehicle: Vehicle, _channel: Channel, _now_us: int) -> SIMSTATE | None:
    """Attitude, inertial data and location; not sent for a vehicle without a flight (SIM::simstate_send)."""
    if (found := _truth(vehicle)) is None:
        return None
    truth, place = found
    return SIMSTATE(*truth.rpy_rad, *truth.acc_frd_m_s2, *truth.rates_frd_rad_s, place.lat, place.lng)


def sim_state(vehicle: Vehicle, _channel: Channel, _now_us: int) -> SIM_STATE | None:
    """The same with the velocity; location in 1e-7 degrees (SIM::sim_state_send)."""
    if (found := _truth(vehicle)) is None:
        return None
    truth, place = found
    return SIM_STATE(
        *truth.quat_wxyz,
        *truth.rpy_rad,
        *truth.acc_frd_m_s2,
        *truth.rates_frd_rad_s,
        float(place.lat),
        float(place.lng),
        0.01 * place.alt_cm,
        0.0,
        0.0,
        *truth.vel_ned_m_s,
        place.lat,
        place.lng,
    )
