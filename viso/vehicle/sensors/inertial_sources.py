# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sources of inertial data, by the names that the command line knows; a new one is a file and a row."""

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from ap_core.location import Location
from viso.errors import InputError
from viso.vehicle.sensors.flown.source import read_recorded_source
from viso.vehicle.sensors.hil import HilSource
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.script.script import read_script_source
from viso.vehicle.sensors.source import ImuOptions, VehicleSource
from viso.vehicle.sensors.standing import BenchSource
from viso.vehicle.sensors.stream.follow import FollowSource

MakeSource = Callable[[ImuOptions], VehicleSource]

FLOWN: Final = "log"
"""The source that flies a log again."""
FLIES: Final = "fly"
"""The source that flies as it is commanded."""
VICON: Final = "vicon"
"""The camera that sees what flies."""

MOST_ALTITUDE_M: Final = 10_000

_OPTION: Final = "--imu"


class ImuSource(NamedTuple):
    """A source of inertial data.

    Attributes:
        argument: what follows its name and a colon; empty if nothing does.
        help: what it is, in a few words.
        read: returns what makes it, from its argument; raises InputError for one that cannot be used.
    """

    argument: str
    help: str
    read: Callable[[str], MakeSource]


IMU_SOURCES: Final[Mapping[str, ImuSource]] = MappingProxyType(
    {
        "bench": ImuSource("", "stands still", lambda _: BenchSource),
        "script": ImuSource("FILE", "moves as a TOML file says", read_script_source),
        "follow": ImuSource("", "moves as external navigation says", lambda _: FollowSource),
        FLIES: ImuSource("", "flies as it is commanded, a model of a multicopter", lambda _: FlyingSource),
        "hil": ImuSource("", "HIL_SENSOR and HIL_STATE_QUATERNION over MAVLink", lambda _: HilSource),
        FLOWN: ImuSource("FILE", "moves as a DataFlash log says", read_recorded_source),
    }
)

IMU_HELP: Final = "; ".join(
    f"{name}{source.argument and ':'}{source.argument}: {source.help}" for name, source in IMU_SOURCES.items()
)


def read_source(text: str) -> MakeSource:
    """Return what makes the source that ``NAME`` or ``NAME:ARGUMENT`` names; files are read now.

    Raises InputError if there is no such source, or its argument cannot be used.
    """
    name, colon, argument = text.partition(":")
    source = IMU_SOURCES.get(name)
    if source is None:
        raise InputError(f"{_OPTION} {text}: no such source; there are {', '.join(IMU_SOURCES)}")
    if source.argument and not argument:
        raise InputError(f"{_OPTION} {text}: not {name}:{source.argument}")
    if colon and not source.argument:
        raise InputError(f"{_OPTION} {text}: {name} takes nothing behind it")
    return source.read(argument)


_GROUND: Final = ("bench", "script", "follow", FLIES)
"""The sources that do not know where on earth they are."""


def home_of(numbers: Sequence[float] | None, imu: str, option: str) -> tuple[Location | None, float]:
    """Return where a vehicle starts, and its heading in rad, -pi to pi; None and 0 if nothing is said of it.

    Args:
        numbers: latitude and longitude in degrees, height above sea level in m, heading in degrees.
        imu: the source of its inertial data.
        option: where they come from.

    Raises:
        InputError: they are no such place, or the source knows where it is.
    """
    if numbers is None:
        return None, 0.0
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise InputError(f"{option}: not four numbers LAT,LON,ALT,HEADING")
    lat_deg, lon_deg, alt_m, heading_deg = numbers
    if abs(lat_deg) > 90 or abs(lon_deg) > 180 or abs(alt_m) > MOST_ALTITUDE_M:
        raise InputError(f"{option}: no place on earth; degrees, and up to {MOST_ALTITUDE_M} m")
    if imu.partition(":")[0] not in _GROUND:
        raise InputError(f"{option}: {_OPTION} {imu} says where it is; take {', '.join(_GROUND)}")
    place = Location(round(1e7 * lat_deg), round(1e7 * lon_deg), round(100 * alt_m))
    return place, math.remainder(math.radians(heading_deg), 2 * math.pi)


def wants_vicon(vision: str | None, imu: str | None, option: str) -> bool:
    """Return whether the simulator's own camera is asked for. Raises InputError for another, or if nothing flies."""
    if vision is None:
        return False
    if vision != VICON:
        raise InputError(f"{option} {vision}: no such camera; there is {VICON}")
    if imu != FLIES:
        raise InputError(f"{option} {vision}: it sees a vehicle that flies alone; add {_OPTION} {FLIES}")
    return True
