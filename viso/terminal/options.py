# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of several commands: which firmware to be, and the domain of live topics."""

from typing import Annotated

import typer

from viso.errors import InputError
from viso.firmware.releases import ALIASES, DEFAULT, PROFILES, Firmware

_OLD_NAMES = (f"{alias} is {name}, the master of {PROFILES[name].date}" for alias, name in ALIASES.items())
_NAMES = "; ".join((", ".join(PROFILES), *_OLD_NAMES))
FirmwareOption = Annotated[str, typer.Option("--firmware", help=f"The firmware to be: {_NAMES}.", metavar="PROFILE")]
DEFAULT_FIRMWARE = DEFAULT.name
RecordedFirmwareOption = Annotated[
    str | None,
    typer.Option(
        "--firmware",
        help=f"The firmware to be: {_NAMES}; default that nearest to what flew in the recording, "
        f"{DEFAULT_FIRMWARE} if that is not known.",
        metavar="PROFILE",
    ),
]


def firmware_of(name: str, option: str = "--firmware") -> Firmware:
    """Return a profile by the name that an option gives. Raises InputError if there is no such profile."""
    name = ALIASES.get(name, name)
    if name not in PROFILES:
        raise InputError(f"{option} {name}: no such profile; there are {', '.join(PROFILES)}")
    return PROFILES[name]


DomainOption = Annotated[
    int, typer.Option("--domain", envvar="ROS_DOMAIN_ID", help="Of a live topic: the domain of DDS.", metavar="ID")
]
