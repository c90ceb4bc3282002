# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What memory a vehicle needs that is sent 200 messages a second for long: all that grows is to be its log on disk."""

import os
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from viso.bench.full_vehicle import FullVehicle

RATE_HZ: Final = 200
MINUTE_S: Final = 60
_YAW_OF_CAMERA: Final = 6
_STATM: Final = Path("/proc/self/statm")
_MIB: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class MemoryPoint:
    """What there was after some minutes of the vehicle's time.

    Attributes:
        minute: of virtual time.
        rss_mib: of the process, as the system counts it; None where it does not tell.
        blocks: how many blocks of memory Python has allocated and not let go of.
        traced_mib: how large these are since the start, None unless that was traced.
        log_mib: on disk.
    """

    minute: int
    rss_mib: float | None
    blocks: int
    traced_mib: float | None
    log_mib: float


def rss_mib() -> float | None:
    """Return the memory of this process that is in the machine's, None where the system does not tell."""
    try:
        pages = int(_STATM.read_text().split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") / _MIB


def run(minutes: int, on_point: Callable[[MemoryPoint], None], *, trace: bool = False) -> None:
    """Run a vehicle for some minutes of its time, and tell after each what memory there is.

    Args:
        minutes: of virtual time.
        on_point: is told.
        trace: whether to trace what is allocated, with which it takes some four times as long.
    """
    with TemporaryDirectory() as folder:
        vehicle = FullVehicle(_YAW_OF_CAMERA, Path(folder), period_us=1_000_000 // RATE_HZ)
        if trace:
            tracemalloc.start()
        try:
            for minute in range(1, minutes + 1):
                vehicle.run(MINUTE_S * RATE_HZ, lambda: 0.0)
                log_mib = sum(path.stat().st_size for path in Path(folder).iterdir()) / _MIB
                traced_mib = tracemalloc.get_traced_memory()[0] / _MIB if trace else None
                on_point(MemoryPoint(minute, rss_mib(), sys.getallocatedblocks(), traced_mib, log_mib))
        finally:
            tracemalloc.stop()
            vehicle.vehicle.close()
