# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of aircraft reports to and from the MAVLink message ADSB_VEHICLE.

Source: common.xml (ADSB_VEHICLE, ADSB_FLAGS, ADSB_ALTITUDE_TYPE).
"""

from enum import IntEnum, IntFlag
from typing import Final

from mav_handlers.wire.messages import ADSB_VEHICLE
from viso.landmarks.types import M_PER_FT, M_S_PER_KT, AircraftReport

MAX_ICAO: Final = 0xFFFFFF
MAX_HEADING_CDEG: Final = 36000
MAX_SPEED_CM_S: Final = 0xFFFF
MAX_RATE_CM_S: Final = 0x7FFF
MAX_ALTITUDE_MM: Final = 0x7FFFFFFF
MAX_AGE_S: Final = 0xFF


class AdsbFlags(IntFlag):
    """The valid fields of a message."""

    COORDS = 1
    ALTITUDE = 2
    HEADING = 4
    VELOCITY = 8
    VERTICAL_VELOCITY = 128
    BARO = 256


class AltitudeType(IntEnum):
    """The reference of an altitude."""

    PRESSURE_QNH = 0
    GEOMETRIC = 1


def to_message(report: AircraftReport, now_s: float) -> ADSB_VEHICLE:
    """Return the message of a report.

    In a report zero may mean unknown, so a speed and heading of 0 are marked as not valid. Numbers are limited to the
    range of the message. ``now_s`` is on the report's clock.
    """
    flags = AdsbFlags.COORDS
    if report.altitude_ft is not None:
        flags |= AdsbFlags.ALTITUDE | (AdsbFlags.BARO if report.is_baro else AdsbFlags(0))
    if report.speed_kt or report.heading_deg:
        flags |= AdsbFlags.HEADING | AdsbFlags.VELOCITY
    if report.vertical_rate_ft_min:
        flags |= AdsbFlags.VERTICAL_VELOCITY
    return ADSB_VEHICLE(
        ICAO_address=int(report.icao, 16),
        lat=round(report.latitude_deg * 1e7),
        lon=round(report.longitude_deg * 1e7),
        altitude_type=AltitudeType.PRESSURE_QNH if report.is_baro else AltitudeType.GEOMETRIC,
        altitude=_within((report.altitude_ft or 0.0) * M_PER_FT * 1e3, -MAX_ALTITUDE_MM, MAX_ALTITUDE_MM),
        heading=round(report.heading_deg % 360 * 100) % MAX_HEADING_CDEG,
        hor_velocity=_within(report.speed_kt * M_S_PER_KT * 100, 0, MAX_SPEED_CM_S),
        ver_velocity=_within(report.vertical_rate_ft_min * M_PER_FT / 60 * 100, -MAX_RATE_CM_S, MAX_RATE_CM_S),
        callsign="",
        emitter_type=0,
        tslc=_within(now_s - report.t_s, 0, MAX_AGE_S),
        flags=int(flags),
        squawk=0,
    )


def from_message(message: ADSB_VEHICLE, arrival_s: float) -> AircraftReport:
    """Return the report in a message; its time is that of arrival less the age in the message, in whole seconds.

    Fields that its flags do not mark as valid are unknown. Raises ValueError, naming the field, if the address is not
    an ICAO address or the position is not valid.
    """
    flags = AdsbFlags(message.flags)
    if not 0 < message.ICAO_address <= MAX_ICAO:
        raise ValueError(f"ICAO_address: {message.ICAO_address}")
    if AdsbFlags.COORDS not in flags or (message.lat == 0 and message.lon == 0):
        raise ValueError("lat: not valid")
    heading_known = AdsbFlags.HEADING in flags and message.heading < MAX_HEADING_CDEG
    # The flag for the vertical velocity is the younger one: older senders mean both by the other.
    rate_known = flags & (AdsbFlags.VELOCITY | AdsbFlags.VERTICAL_VELOCITY)
    return AircraftReport(
        arrival_s - message.tslc,
        f"{message.ICAO_address:06X}",
        message.lat * 1e-7,
        message.lon * 1e-7,
        message.altitude * 1e-3 / M_PER_FT if AdsbFlags.ALTITUDE in flags else None,
        message.hor_velocity * 1e-2 / M_S_PER_KT if AdsbFlags.VELOCITY in flags else 0.0,
        message.heading * 1e-2 if heading_known else 0.0,
        message.ver_velocity * 1e-2 / M_PER_FT * 60 if rate_known else 0.0,
        message.altitude_type == AltitudeType.PRESSURE_QNH,
    )


def _within(value: float, lowest: int, highest: int) -> int:
    return round(min(max(value, lowest), highest))
