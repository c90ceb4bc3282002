# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log meets the end of its space: the vehicle flies on, says so, and counts what is lost.

The system's own limit on the size of a file stands for a full disk: a write is cut short at it, and the next fails.
"""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pymavlink.DFReader import DFReader_binary

from mav_handlers.wire.messages import COMMAND_LONG, STATUSTEXT

if TYPE_CHECKING:
    from tests.fault.conftest import Bench, MakeBench

ARM = COMMAND_LONG(1, 1, 400, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ROOM_BYTES = 10_000


@contextmanager
def space_for(size: int) -> Iterator[None]:
    """Let no file grow beyond a size in bytes; Python ignores the signal that goes with it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def fill_the_disk(bench: "Bench") -> int:
    """Let the log run into the limit while samples come; return the limit."""
    limit = bench.store.path_of(1).stat().st_size + ROOM_BYTES
    with space_for(limit):
        for _ in range(200):
            bench.send_sample(0)
            bench.run_ms(20)
            bench.read_all()
    return limit


def test_log_without_space_stops_and_the_vehicle_goes_on(make_bench: "MakeBench") -> None:
    bench = make_bench()
    limit = fill_the_disk(bench)
    assert bench.store.path_of(1).stat().st_size == limit
    assert bench.accepted() == 200
    assert bench.vehicle.logger.dropped > 100
    assert bench.vehicle.logger.failure is not None
    bench.check_alive(0)
    bench.check_alive(1)
    bench.check_account()


def test_log_without_space_is_readable_to_its_last_whole_record(make_bench: "MakeBench") -> None:
    bench = make_bench()
    limit = fill_the_disk(bench)
    bench.vehicle.close()
    size, last_us = 0, 0
    with DFReader_binary(str(bench.store.path_of(1))) as log:
        while (record := log.recv_msg()) is not None:
            size += record.fmt.len
            last_us = getattr(record, "TimeUS", last_us)
    assert limit - 255 < size <= limit
    assert last_us > 5_000_000


def test_arming_is_refused_while_the_log_cannot_be_written(make_bench: "MakeBench") -> None:
    bench = make_bench()
    fill_the_disk(bench)
    bench.send(0, ARM)
    bench.run_ms(100)
    texts = [message.text for message in bench.read(0) if isinstance(message, STATUSTEXT)]
    assert "Arm: Logging failed" in texts
    assert not bench.vehicle.copter.is_armed()
