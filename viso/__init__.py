# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot's end of external navigation: vehicle, virtual time, streams, logs, and an autopilot for tests.

Names are imported when they are first used: the pytest plugin imports this package in every run of pytest, and the
command line needs none of them for its help.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from viso.errors import InputError
    from viso.firmware.releases import PROFILES, Firmware
    from viso.logs import MemoryLog, read_columns, read_recorded_states
    from viso.running.virtual_time import Scheduler
    from viso.streams import Stream, StreamMessage, read_stream
    from viso.testing import Autopilot, AutopilotOptions, UdpAutopilot
    from viso.vehicle.config import VehicleConfig
    from viso.vehicle.vehicle import Vehicle

__all__ = [
    "PROFILES",
    "Autopilot",
    "AutopilotOptions",
    "Firmware",
    "InputError",
    "MemoryLog",
    "Scheduler",
    "Stream",
    "StreamMessage",
    "UdpAutopilot",
    "Vehicle",
    "VehicleConfig",
    "read_columns",
    "read_recorded_states",
    "read_stream",
]

_MODULES: Final = {
    "viso.errors": ["InputError"],
    "viso.firmware.releases": ["PROFILES", "Firmware"],
    "viso.logs": ["MemoryLog", "read_columns", "read_recorded_states"],
    "viso.running.virtual_time": ["Scheduler"],
    "viso.streams": ["Stream", "StreamMessage", "read_stream"],
    "viso.testing": ["Autopilot", "AutopilotOptions", "UdpAutopilot"],
    "viso.vehicle.config": ["VehicleConfig"],
    "viso.vehicle.vehicle": ["Vehicle"],
}

if not TYPE_CHECKING:  # for type checkers other names are errors

    def __getattr__(name: str) -> object:
        for module, names in _MODULES.items():
            if name in names:
                return getattr(import_module(module), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
