# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vehicles that have booted; those with the same options boot once a process, and each is a copy of its own."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from mav_handlers.channel import Channel
from viso.logs.sink import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.testing.copies import Copies
from viso.testing.options import AutopilotOptions
from viso.vehicle.vehicle import Vehicle

READY_US: Final = 6_500_000
"""When a test begins, us since boot: the estimator runs, and the vehicle has told all it has to tell of its start."""

KINDS_KEPT: Final = 32


@dataclass(slots=True)
class BootedVehicle:
    """A vehicle with one link, from which nothing is waiting to be sent, what moves its time, and its logs."""

    vehicle: Vehicle
    scheduler: Scheduler
    channel: Channel
    logs: list[MemoryLog] = field(default_factory=list)


def booted_vehicle(options: AutopilotOptions) -> BootedVehicle:
    """Return a vehicle at ``READY_US``.

    Raises:
        ValueError: an option cannot be used.
    """
    if options.reads_file:
        # It may be another one by the next time.
        return boot(options)
    return _copies(options.preset, options.imu, options.firmware, tuple(options.params.items())).make()


@lru_cache(KINDS_KEPT)
def _copies(
    preset: str | None, imu: str, firmware: str, params: tuple[tuple[str, float], ...]
) -> Copies[BootedVehicle]:
    return Copies(boot(AutopilotOptions(dict(params), preset, imu, firmware)))


def boot(options: AutopilotOptions) -> BootedVehicle:
    """Boot a vehicle until ``READY_US``.

    Raises:
        ValueError: an option cannot be used.
    """
    logs: list[MemoryLog] = []

    def open_log() -> MemoryLog:
        logs.append(MemoryLog())
        return logs[-1]

    vehicle = Vehicle(options.vehicle_config(open_log))
    booted = BootedVehicle(vehicle, Scheduler(vehicle), vehicle.endpoint.open_channel("test"), logs)
    booted.scheduler.run_until(READY_US)
    vehicle.endpoint.bytes_to_send(booted.channel)
    return booted
