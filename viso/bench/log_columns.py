# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many records of a log are read as columns, beside one by one."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_columns import LogColumns
from ap_core.log_structure import ATT, COMMON_STRUCTURES, PARM
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM, VISP, VISV
from viso.bench.measure import NowS, Part, Round
from viso.logs.recorded import read_log

RECORDS: Final = 6_000
_TIMES: Final = 10
_TYPES: Final = (VISP, VISV, ATT, PARM)


def log_of(records: int) -> bytes:
    """Return a log with four types of records that take turns, one each 10 ms, of made-up values."""
    rng = np.random.default_rng(0)
    value_of: dict[str, Callable[[int], Any]] = {
        "Q": lambda number: number * 10_000,
        "I": lambda number: number * 10,
        "B": lambda _: int(rng.integers(0, 200)),
        "b": lambda _: int(rng.integers(0, 100)),
        "f": lambda _: float(rng.normal()),
        "N": lambda number: f"NAME_{number % 500}",
    }
    writer = DataFlashWriter((*COMMON_STRUCTURES, *LOG_STRUCTURE_FROM_VISUALODOM))
    return b"".join(
        writer.record(structure, [value_of[char](number) for char in structure.format])
        for number in range(records // len(_TYPES))
        for structure in _TYPES
    )


def read_all(data: bytes) -> int:
    """Read every value of every type of a log; return how many records there are."""
    log = LogColumns(data)
    for name in log.counts:
        log.columns(name)
    return len(log)


def _received_s(path: Path, now_s: NowS) -> float:
    """Return how long DFReader takes for each record of a log, once it has opened and indexed it."""

    def receive(log: Any) -> float:
        begin_s, count = now_s(), 0
        while log.recv_msg() is not None:
            count += 1
        return (now_s() - begin_s) / count

    return read_log(path, receive)


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Make a log, and one ten times as long."""
    log, longer = log_of(RECORDS), log_of(_TIMES * RECORDS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "00000001.BIN"
        path.write_bytes(log)

        def run_round() -> Mapping[str, Part]:
            received_s = _received_s(path, now_s)
            parts = {}
            for name, one in (("read", log), (f"read, {_TIMES} times as many", longer)):
                begin_s = now_s()
                count = read_all(one)
                parts[name] = Part(now_s() - begin_s, count, received_s * count)
            return parts

        yield run_round
