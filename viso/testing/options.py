# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What autopilot a test wants: parameters, sensors and firmware, checked when it is made."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from types import MappingProxyType
from typing import Final

from viso.errors import InputError
from viso.firmware.releases import DEFAULT, PROFILES
from viso.logs.logger import LogSink
from viso.parameters.conversion import name_here
from viso.parameters.releases import ALL_RENAMES
from viso.terminal.settings import PRESETS, known_parameters, load_settings
from viso.vehicle.config import VehicleConfig, by_ekf3
from viso.vehicle.sensors.inertial_sources import home_of, read_source, wants_vicon
from viso.vehicle.sensors.source import ImuOptions

DEFAULT_PARAMS: Final[Mapping[str, float]] = MappingProxyType(
    {
        "VISO_TYPE": 1,
        "EK3_SRC1_POSXY": 6,
        "EK3_SRC1_VELXY": 6,
        "EK3_SRC1_POSZ": 6,
        "EK3_SRC1_VELZ": 6,
        "EK3_SRC1_YAW": 6,
        "GPS1_TYPE": 0,
        "COMPASS_ENABLE": 0,
    }
)
"""Parameters where no preset is asked for: everything from external navigation, by any camera that speaks MAVLink."""


@dataclass(frozen=True, slots=True)
class AutopilotOptions:
    """What autopilot a test wants.

    Attributes:
        params: values by name, over those of the preset; they hold from boot on. Names are those of the firmware, or of
            another one, whose values are converted.
        preset: parameters of a usual set-up, by a name that ``viso serve --preset`` takes; ``DEFAULT_PARAMS`` for None.
        imu: what its sensors say, as for ``viso serve --imu``: ``follow`` moves as external navigation says, ``bench``
            stands still.
        firmware: which one it is, by name.
        home: where it starts, and where it points at first: latitude and longitude in degrees, height above sea level
            in m, heading in degrees from north; None for where the firmware's simulator starts, heading north.
        vision: ``vicon`` for the simulator's own camera, which sees a vehicle that flies; None for none.

    Raises:
        ValueError: a parameter's value is no finite number.
    """

    params: Mapping[str, float] = field(default_factory=dict)
    preset: str | None = None
    imu: str = "follow"
    firmware: str = DEFAULT.name
    vision: str | None = None
    home: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        """Look at the values of parameters; all else is looked at when the vehicle is built."""
        for name, value in self.params.items():
            if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
                raise ValueError(f"params: {name} is {value!r}, not a finite number")

    def vehicle_config(self, open_log: Callable[[], LogSink]) -> VehicleConfig:
        """Return how to build the vehicle.

        Args:
            open_log: opens the next log.

        Raises:
            ValueError: an option cannot be used; the text is one line that names it.
        """
        if self.firmware not in PROFILES:
            raise ValueError(f"firmware {self.firmware!r}: no such firmware; there are {', '.join(PROFILES)}")
        try:
            source = read_source(self.imu)
            vicon = wants_vicon(self.vision, self.imu, "--vision")
            home, heading_rad = home_of(self.home, self.imu, f"--home {self.home}")
        except InputError as error:
            raise ValueError(str(error).removeprefix("--")) from None
        return VehicleConfig(
            by_ekf3(source, ImuOptions(heading_rad=heading_rad, home=home)),
            defaults={**self._preset_params(), **self._own_params()},
            open_log=open_log,
            firmware=PROFILES[self.firmware],
            vicon=vicon,
        )

    def _preset_params(self) -> Mapping[str, float]:
        if self.preset is None:
            return DEFAULT_PARAMS
        if self.preset not in PRESETS:
            raise ValueError(f"preset {self.preset!r}: no such preset; there are {', '.join(PRESETS)}")
        return load_settings([PRESETS[self.preset]], [], links=1, firmware=PROFILES[self.firmware])

    def _own_params(self) -> Mapping[str, float]:
        firmware = PROFILES[self.firmware]
        table = known_parameters(1, firmware)
        renamed = {name: float(self.params[name]) for name in self.params if name_here(name, table, ALL_RENAMES)}
        others = [f"{name}={float(value)!r}" for name, value in self.params.items() if name not in renamed]
        try:
            return {**renamed, **load_settings([], others, links=1, firmware=firmware)}
        except InputError as error:
            raise ValueError(str(error).replace("--param", "params:", 1)) from None
