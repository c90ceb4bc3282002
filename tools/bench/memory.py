# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What memory a vehicle needs that is sent 200 messages per second for long: all that grows is to be its log on disk.

Prints a list in JSON with a point for each minute of the vehicle's time; 60 take some minutes. Example:
python -m tools.bench.memory 60 > memory.json
"""

import argparse
import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

from tools.bench.vehicles import FullVehicle

RATE_HZ: Final = 200
MINUTE_S: Final = 60
_MIB: Final = 1 << 20


class MemoryPoint(NamedTuple):
    """What there was after some minutes of the vehicle's time.

    Attributes:
        minute: of virtual time.
        rss_mib: of the process, as the system counts it.
        blocks: how many blocks of memory Python has allocated and not let go of.
        log_mib: on disk.
    """

    minute: int
    rss_mib: float
    blocks: int
    log_mib: float


def rss_mib() -> float:
    """Return the memory of this process that is in the machine's."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / _MIB


def points(minutes: int) -> Iterator[MemoryPoint]:
    """Run a vehicle for some minutes of its time, and yield after each what memory there is."""
    with TemporaryDirectory() as folder:
        run = FullVehicle(Path(folder), period_us=1_000_000 // RATE_HZ)
        try:
            for minute in range(1, minutes + 1):
                run.run(MINUTE_S * RATE_HZ)
                log_mib = sum(path.stat().st_size for path in Path(folder).iterdir()) / _MIB
                yield MemoryPoint(minute, rss_mib(), sys.getallocatedblocks(), log_mib)
        finally:
            run.vehicle.close()


def main(arguments: Sequence[str]) -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("minutes", type=int, help="for how long, in the vehicle's time")
    print(json.dumps([point._asdict() for point in points(parser.parse_args(arguments).minutes)]))


if __name__ == "__main__":
    main(sys.argv[1:])
