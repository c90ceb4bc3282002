# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a log takes to be read as columns, every value, and by DFReader record by record."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_columns import LogColumns
from ap_core.log_structure import ATT, COMMON_STRUCTURES, PARM
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM, VISP, VISV
from viso.logs.recorded import read_log

RECORDS: Final = 6_000
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


def receive_all(log: Any) -> float:
    """Have DFReader, once it has opened and indexed a log, read it; return the seconds that this took."""
    begin_s = time.process_time()
    while log.recv_msg() is not None:
        pass
    return time.process_time() - begin_s


def prepare(_stack: ExitStack) -> Callable[[], float]:
    """A round is a log."""
    data = log_of(RECORDS)

    def read() -> float:
        begin_s = time.process_time()
        read_all(data)
        return time.process_time() - begin_s

    return read


def prepare_dfreader(stack: ExitStack) -> Callable[[], float]:
    """A round is the same log, record by record."""
    path = Path(stack.enter_context(TemporaryDirectory()), "00000001.BIN")
    path.write_bytes(log_of(RECORDS))
    return lambda: read_log(path, receive_all)
