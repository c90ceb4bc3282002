# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that has booted, with one link."""

from dataclasses import dataclass
from typing import Final

from mav_handlers.channel import Channel
from viso.logs.sink import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.testing.options import AutopilotOptions
from viso.vehicle.vehicle import Vehicle

READY_US: Final = 6_500_000
"""When a test begins, us since boot: the estimator runs, and the vehicle has told all it has to tell of its start."""


@dataclass(slots=True)
class BootedVehicle:
    """A vehicle with one link, from which nothing is waiting to be sent, what moves its time, and its logs."""

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
