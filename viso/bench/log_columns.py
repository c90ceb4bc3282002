# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many records of a log are read and written as columns, beside one by one."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_columns import LogColumns
from ap_core.dataflash_packing import Part as LogPart
from ap_core.dataflash_packing import pack_columns, write_log
from ap_core.log_structure import ATT, COMMON_STRUCTURES, PARM, LogStructure
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM, VISP, VISV
from viso.bench.measure import NowS, Part, Round
from viso.logs.recorded import read_log

RECORDS: Final = 6_000
_TIMES: Final = 10
_TYPES: Final = (VISP, VISV, ATT, PARM)


def columns_of(structure: LogStructure, count: int, seed: int) -> list[Any]:
    """Return made-up values of a type, a column a field, with a record each 10 ms."""
    rng = np.random.default_rng(seed)
    made: dict[str, Callable[[], Any]] = {
        "Q": lambda: np.arange(count) * 10_000,
        "I": lambda: np.arange(count) * 10,
        "B": lambda: rng.integers(0, 200, count),
        "b": lambda: rng.integers(0, 100, count),
        "f": lambda: rng.normal(size=count).astype(np.float32),
        "N": lambda: np.array([f"NAME_{number % 500}" for number in range(count)]),
    }
    return [made[char]() for char in structure.format]


class BenchLog:
    """A log of four types of records that take turns.

    Attributes:
        data: its bytes.
    """

    def __init__(self, records: int = RECORDS) -> None:
        each = records // len(_TYPES)
        places = np.arange(each) * len(_TYPES)
        self._columns = {one: columns_of(one, each, seed) for seed, one in enumerate(_TYPES)}
        self._places = {one: places + number for number, one in enumerate(_TYPES)}
        self.data = self.write_columns()

    @property
    def count(self) -> int:
        """The records without those that describe them."""
        return sum(map(len, self._places.values()))

    @cached_property
    def rows(self) -> list[tuple[LogStructure, tuple[Any, ...]]]:
        """The records one by one: type and values."""
        values = [list(zip(*(column.tolist() for column in self._columns[one]), strict=True)) for one in _TYPES]
        return [pair for row in zip(*values, strict=True) for pair in zip(_TYPES, row, strict=True)]

    def write_columns(self) -> bytes:
        """Return the log, from columns."""
        parts = [LogPart(one, self._places[one], pack_columns(one, self._columns[one])) for one in _TYPES]
        return write_log(_writer(), parts)

    def write_rows(self) -> bytes:
        """Return the log, record by record."""
        writer = _writer()
        return b"".join(writer.record(structure, values) for structure, values in self.rows)

    def read_columns(self) -> int:
        """Read every value of every type; return how many records there are."""
        log = LogColumns(self.data)
        for name in log.counts:
            log.columns(name)
        return len(log)


def _writer() -> DataFlashWriter:
    return DataFlashWriter((*COMMON_STRUCTURES, *LOG_STRUCTURE_FROM_VISUALODOM))


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
    log, longer = BenchLog(), BenchLog(_TIMES * RECORDS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "00000001.BIN"
        path.write_bytes(log.data)

        def run_round() -> Mapping[str, Part]:
            received_s = _received_s(path, now_s)
            parts = {}
            for name, one in (("read", log), (f"read, {_TIMES} times as many", longer)):
                begin_s = now_s()
                count = one.read_columns()
                parts[name] = Part(now_s() - begin_s, count, received_s * count)
            begin_s = now_s()
            log.write_columns()
            written_s = now_s()
            log.write_rows()
            parts["written"] = Part(written_s - begin_s, log.count, now_s() - written_s)
            return parts

        yield run_round
