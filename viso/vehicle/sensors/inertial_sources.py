# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sources of inertial data, by the names that the command line knows; a new one is a file and a row."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

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


def wants_vicon(vision: str | None, imu: str | None, option: str) -> bool:
    """Return whether the simulator's own camera is asked for. Raises InputError for another, or if nothing flies."""
    if vision is None:
        return False
    if vision != VICON:
        raise InputError(f"{option} {vision}: no such camera; there is {VICON}")
    if imu != FLIES:
        raise InputError(f"{option} {vision}: it sees a vehicle that flies alone; add {_OPTION} {FLIES}")
    return True
