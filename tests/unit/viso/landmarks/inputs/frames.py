# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mode-S frames of known states: extended squitters with compact position reporting (DO-260B, A.1.7)."""

import math

ICAO = "3C6DD1"
_GENERATOR = 0xFFF409
_BITS = 17


def zones(latitude_deg: float) -> int:
    """Return the number of longitude zones of even frames at a latitude."""
    latitude = abs(latitude_deg)
    if latitude >= 87:
        return 2 if latitude == 87 else 1
    if latitude == 0:
        return 59
    part = (1 - math.cos(math.pi / 30)) / math.cos(math.radians(latitude)) ** 2
    return math.floor(2 * math.pi / math.acos(1 - part))


def bin_sizes_deg(latitude_deg: float, odd: bool) -> tuple[float, float]:
    """Return how much one step of a coded latitude and longitude is."""
    return 360 / (60 - odd) / 2**_BITS, 360 / max(zones(latitude_deg) - odd, 1) / 2**_BITS


def coded(latitude_deg: float, longitude_deg: float, odd: bool) -> tuple[int, int]:
    """Return latitude and longitude as a frame has them."""
    steps, width = 2**_BITS, 360 / (60 - odd)
    y = math.floor(steps * (latitude_deg % width) / width + 0.5)
    rounded = width * (y / steps + math.floor(latitude_deg / width))
    width = 360 / max(zones(rounded) - odd, 1)
    x = math.floor(steps * (longitude_deg % width) / width + 0.5)
    return y % steps, x % steps


def checksum(payload: int) -> int:
    """Return the parity of 88 bits."""
    remainder = payload << 24
    for bit in range(111, 23, -1):
        if remainder >> bit & 1:
            remainder ^= (1 << 24 | _GENERATOR) << (bit - 24)
    return remainder


def squitter(message: int, icao: str = ICAO, first_byte: int = 0x8D) -> str:
    """Return the frame of 56 bits."""
    payload = first_byte << 80 | int(icao, 16) << 56 | message
    return f"{payload << 24 | checksum(payload):028X}"


def position(
    latitude_deg: float,
    longitude_deg: float,
    odd: bool,
    altitude_ft: int | None = 10_000,
    kind: int = 11,
    icao: str = ICAO,
) -> str:
    """Return a frame with a position in the air; its altitude in steps of 25 ft, or with kind 20 to 22 in m."""
    y, x = coded(latitude_deg, longitude_deg, odd)
    if altitude_ft is None:
        altitude = 0
    elif kind >= 20:
        altitude = round(altitude_ft * 0.3048)
    else:
        steps = (altitude_ft + 1000) // 25
        altitude = (steps >> 4) << 5 | 1 << 4 | steps & 15
    return squitter(kind << 51 | altitude << 36 | int(odd) << 34 | y << 17 | x, icao)


def velocity(east_kt: int, north_kt: int, rate_ft_min: int, icao: str = ICAO) -> str:
    """Return a frame with a velocity over ground, in kt, and a vertical rate in steps of 64 ft/min."""
    east = (east_kt < 0) << 10 | abs(east_kt) + 1
    north = (north_kt < 0) << 10 | abs(north_kt) + 1
    rate = 1 << 10 | (rate_ft_min < 0) << 9 | abs(rate_ft_min) // 64 + 1
    return squitter(19 << 51 | 1 << 48 | east << 32 | north << 21 | rate << 10, icao)


def surface(latitude_deg: float, longitude_deg: float, odd: bool) -> str:
    """Return a frame with a position on the ground, whose code is not that of a real one."""
    y, x = coded(latitude_deg, longitude_deg, odd)
    return squitter(7 << 51 | int(odd) << 34 | y << 17 | x)
