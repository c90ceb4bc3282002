# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vehicle's attitude and position come from: the filter on sensors of some kind, or a recorded log."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from viso.errors import InputError
from viso.vehicle.sensors.errors import ERROR_NAMES, parse_errors
from viso.vehicle.sensors.inertial_sources import FLOWN, IMU_HELP, home_of
from viso.vehicle.sensors.source import ImuOptions

AhrsOption = Annotated[
    Path | None,
    typer.Option(
        help="Follow this log (.BIN, also packed): the filter over its replay records, else its attitude and position.",
        metavar="LOG",
    ),
]
ImuOption = Annotated[str | None, typer.Option(help=f"The filter's sensors: {IMU_HELP}.", metavar="SOURCE")]
ImuErrorOption = Annotated[
    list[str] | None,
    typer.Option(
        help=f"What is wrong with them, such as gyro_bias_deg_s=0.1: {', '.join(ERROR_NAMES)}; repeatable.",
        metavar="NAME=VALUE",
    ),
]
ImuSeedOption = Annotated[int, typer.Option(help="Seed of their noise.", min=0)]
HeadingOption = Annotated[
    float, typer.Option(help="Where the vehicle points at first in degrees, if neither log nor script say.")
]
HomeOption = Annotated[
    str | None,
    typer.Option(
        help="Where it starts: degrees, m above sea level, degrees from north. Default: where the firmware's "
        "simulator does, heading north.",
        metavar="LAT,LON,ALT,HEADING",
    ),
]


@dataclass(frozen=True, slots=True)
class AhrsChoice:
    """What the command line says of attitude and position.

    A log is followed in place of a filter; else ``imu`` is the source of the sensors' data, each of ``imu_errors`` is
    NAME=VALUE, and the seed that of their random part. ``home`` is LAT,LON,ALT,HEADING. ``with_each_imu`` gives each
    IMU data of its own, and a filter.
    """

    log: Path | None = None
    imu: str | None = None
    imu_errors: list[str] | None = None
    imu_seed: int = 0
    heading_deg: float = 0.0
    home: str | None = None
    with_each_imu: bool = False


def of_stream(imu: str | None, stream: Path) -> str | None:
    """Return the source of inertial data; ``log`` alone stands for the log that is replayed."""
    return f"{FLOWN}:{stream}" if imu == FLOWN else imu


def heading_in_rad(heading_deg: float) -> float:
    """Return a heading, -pi to pi. Raises InputError if it is none."""
    if not math.isfinite(heading_deg):
        raise InputError(f"--heading {heading_deg}: not an angle in degrees")
    return math.remainder(math.radians(heading_deg), 2 * math.pi)


def imu_options(choice: AhrsChoice, default_imu: str = "bench") -> ImuOptions:
    """Return the options of inertial data that were chosen. Raises InputError if one cannot be used."""
    home, home_heading_rad = home_of(_numbers(choice.home), choice.imu or default_imu, f"--home {choice.home}")
    if home is not None and choice.heading_deg:
        raise InputError("--home and --heading both say where it points")
    heading_rad = heading_in_rad(choice.heading_deg) if home is None else home_heading_rad
    errors = parse_errors(choice.imu_errors or [])
    return ImuOptions(
        heading_rad=heading_rad,
        errors=errors,
        seed=choice.imu_seed,
        home=home,
        with_each_imu=choice.with_each_imu,
    )


def _numbers(text: str | None) -> list[float] | None:
    try:
        return None if text is None else [float(part) for part in text.split(",")]
    except ValueError:
        return []
