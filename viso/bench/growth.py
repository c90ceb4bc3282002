# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a message costs the same when there are ten and a hundred times as many of them."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

from viso.bench.logging_vehicle import LoggingVehicle
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import odometry_at

AT_ONCE: Final = 100
TIMES: Final = (1, 10, 100)


def name_of(times: int) -> str:
    """Return the name of the part with so many times as many messages."""
    return f"{times}x: {times * AT_ONCE} ODOMETRY"


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Start a vehicle for each number of messages, whose main loop then stands still."""
    vehicles = {times: LoggingVehicle() for times in TIMES}

    def run_round() -> Mapping[str, Part]:
        parts: dict[str, Part] = {}
        once_s = 0.0
        for times, vehicle in vehicles.items():
            count = times * AT_ONCE
            elapsed_s = vehicle.take(vehicle.frames(odometry_at, count), now_s)
            once_s = once_s or elapsed_s
            parts[name_of(times)] = Part(elapsed_s, count, times * once_s)
        return parts

    yield run_round
