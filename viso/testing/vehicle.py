# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle of a test: booted, with one link, and its parameters as a mapping that can be written."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from ap_core.param import ParamOutcome
from mav_handlers.channel import Channel
from viso.logs.logger import MemoryLog
from viso.parameters.conversion import name_here
from viso.parameters.releases import ALL_RENAMES
from viso.running.virtual_time import Scheduler
from viso.testing.options import AutopilotOptions
from viso.vehicle.vehicle import Vehicle

READY_US: Final = 6_500_000
"""When a test begins, us since boot: the estimator runs, and the texts of the start were sent."""


@dataclass(slots=True)
class BootedVehicle:
    """A vehicle with one link from which everything was sent, its scheduler, and its logs."""

    vehicle: Vehicle
    scheduler: Scheduler
    channel: Channel
    logs: list[MemoryLog]


def booted_vehicle(options: AutopilotOptions) -> BootedVehicle:
    """Boot a vehicle until ``READY_US``. Raises ValueError if an option cannot be used."""
    logs: list[MemoryLog] = []

    def open_log() -> MemoryLog:
        logs.append(MemoryLog())
        return logs[-1]

    vehicle = Vehicle(options.vehicle_config(open_log))
    booted = BootedVehicle(vehicle, Scheduler(vehicle), vehicle.endpoint.open_channel("test"), logs)
    booted.scheduler.run_until(READY_US)
    vehicle.endpoint.bytes_to_send(booted.channel)
    return booted


__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is


class LiveParams(Mapping[str, float]):
    """The parameters of a vehicle by name; those it lists at the moment when iterated over.

    To set one does what a PARAM_SET of a ground station does: it is kept, logged and echoed, and what takes effect at
    boot alone does not take effect.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    def __getitem__(self, name: str) -> float:
        """Return a value; KeyError if there is no such parameter."""
        found = self._vehicle.params.find(name)
        if found is None:
            raise KeyError(self._unknown(name))
        return float(found.value)

    def __setitem__(self, name: str, value: float) -> None:
        """Set a value at once.

        Raises:
            KeyError: there is no such parameter.
            ValueError: the value is not finite, or the parameter is read-only.
        """
        vehicle = self._vehicle
        result = vehicle.params.set_from_mavlink(name, value)
        if result.outcome is ParamOutcome.UNKNOWN:
            raise KeyError(self._unknown(name))
        if result.outcome is not ParamOutcome.SET:
            why = "read-only" if result.outcome is ParamOutcome.READ_ONLY else f"{value} is not finite"
            raise ValueError(f"{name}: {why}")
        vehicle.log.parameter(name, result.value)
        vehicle.endpoint.echo_parameters(result.echoes)

    def _unknown(self, name: str) -> str:
        other = name_here(name, self._vehicle.params, ALL_RENAMES)
        return f"{name}: no such parameter" + ("" if other is None else f"; this firmware calls it {other}")

    def __iter__(self) -> Iterator[str]:
        """Go through the names in the order in which ground stations see them."""
        return (param.name for param in self._vehicle.params)

    def __len__(self) -> int:
        """Return how many parameters there are at the moment."""
        return self._vehicle.params.count
