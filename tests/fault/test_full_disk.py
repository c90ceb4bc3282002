# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log meets the end of its space, or is deleted: the vehicle flies on, says so, and counts what is lost.

The system's own limit on the size of a file stands for a full disk: a write is cut short at it, and the next fails.
"""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from pymavlink.DFReader import DFReader_binary

from mav_handlers.wire.messages import COMMAND_LONG, STATUSTEXT
from tests.little_space import space_for
from viso.parameters.store import ParamStore

if TYPE_CHECKING:
    from tests.fault.conftest import Bench, MakeBench

ARM = COMMAND_LONG(1, 1, 400, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ROOM_BYTES = 10_000


def fill_the_disk(bench: "Bench") -> int:
    """Let the log run into the limit while samples come; return the limit."""
    limit = bench.store.path_of(1).stat().st_size + ROOM_BYTES
    with space_for(limit):
        for _ in range(200):
            bench.send_sample(0)
            bench.run_ms(20)
            bench.read_all()
    return limit


def read(path: Path) -> tuple[int, int]:
    """Return how many bytes of a log are whole records, and the time of the last one."""
    size, last_us = 0, 0
    with DFReader_binary(str(path)) as log:
        while (record := log.recv_msg()) is not None:
            size += record.fmt.len
            last_us = getattr(record, "TimeUS", last_us)
    return size, last_us


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
    size, last_us = read(bench.store.path_of(1))
    assert limit - 255 < size <= limit
    assert last_us > 5_000_000


@pytest.mark.slow
def test_new_log_begins_when_there_is_room_again(make_bench: "MakeBench") -> None:
    bench = make_bench()
    fill_the_disk(bench)
    bench.run_ms(5_000)
    lost = bench.vehicle.logger.dropped
    bench.run_ms(1_000)
    bench.check_alive(0)
    bench.vehicle.close()
    assert bench.vehicle.logger.failure is None
    assert bench.vehicle.logger.losses == {f"{bench.store.path_of(1)}: File too large": lost}
    assert read(bench.store.path_of(2))[0] == bench.store.path_of(2).stat().st_size


@pytest.mark.slow
def test_deleted_folder_of_logs_is_noticed_told_and_made_anew(make_bench: "MakeBench") -> None:
    bench = make_bench()
    kept = bench.param_store.load()
    shutil.rmtree(bench.folder)
    bench.run_ms(2_000)
    bench.send(0, ARM)
    bench.run_ms(100)
    assert "Arm: Logging failed" in [text.text for text in bench.read(0) if isinstance(text, STATUSTEXT)]
    bench.run_ms(5_000)
    assert list(bench.vehicle.logger.losses) == [f"{bench.store.path_of(1)}: deleted while it was written"]
    lost = bench.vehicle.logger.dropped
    assert lost > 100
    bench.run_ms(1_000)
    bench.vehicle.close()
    assert bench.vehicle.logger.dropped == lost
    assert read(bench.store.path_of(1))[0] == bench.store.path_of(1).stat().st_size
    assert ParamStore(bench.folder / "storage.parm").load() == kept


def test_arming_is_refused_while_the_log_cannot_be_written(make_bench: "MakeBench") -> None:
    bench = make_bench()
    fill_the_disk(bench)
    bench.send(0, ARM)
    bench.run_ms(100)
    texts = [message.text for message in bench.read(0) if isinstance(message, STATUSTEXT)]
    assert "Arm: Logging failed" in texts
    assert not bench.vehicle.copter.is_armed()
