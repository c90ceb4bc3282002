# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log of the vehicle: opens it, writes the start-up block, then record after record (AP_Logger/AP_Logger.cpp)."""

import logging
from collections import Counter
from collections.abc import Callable, Container, Iterator, Sequence
from typing import Final, Protocol

import numpy as np

from ap_core.clock import NEVER, Clock
from ap_core.dataflash import DataFlashWriter
from ap_core.log_field import LogValue
from ap_core.log_structure import COMMON_STRUCTURES, MAV, MODE, PARM, LogStructure
from ap_core.param import ParamTable
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from ekf_stub.log.ekf_log_structure import LOG_STRUCTURE_FROM_EKF3
from ekf_stub.log.replay_log_structure import LOG_STRUCTURE_FROM_DAL
from viso.firmware.log_releases import LOG_STRUCTURE_FROM_GPS, OF, RFND
from viso.logs.files import LogStoreError


class LogSink(Protocol):
    """An open log: a file, or memory in tests.

    Attributes:
        dropped: how many records are lost.
        reason: why, in one line, once the log takes no more.
        flush_due_us: before when, since boot, there is nothing to do for ``flush_if_due``.
    """

    dropped: int
    reason: str | None
    flush_due_us: int

    def write(self, data: bytes) -> bool:
        """Append whole records; False if they are lost."""

    def flush_if_due(self, now_us: int) -> bool:
        """Write out what waits when its time has come; False if the log takes no more."""

    def close(self) -> None:
        """Write out what waits and let go."""


class MemoryLog:
    """A log in memory."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.dropped = 0
        self.reason: str | None = None
        self.flush_due_us = NEVER

    def write(self, data: bytes) -> bool:
        """Append whole records."""
        self.data += data
        return True

    def flush_if_due(self, now_us: int) -> bool:
        """Do nothing: memory is always up to date."""
        return True

    def close(self) -> None:
        """Do nothing: the data stays readable."""


_log = logging.getLogger(__name__)


def _in_firmware_order() -> Iterator[LogStructure]:
    for structure in COMMON_STRUCTURES:
        yield structure
        if structure is PARM:
            yield from LOG_STRUCTURE_FROM_GPS
        if structure is MODE:
            yield RFND
            yield from (*LOG_STRUCTURE_FROM_DAL, *LOG_STRUCTURE_FROM_EKF3)
        if structure is MAV:
            yield from LOG_STRUCTURE_FROM_VISUALODOM
            yield OF


STRUCTURES: Final = tuple(_in_firmware_order())


RETRY_US: Final = 5_000_000


class Logger:
    """Writes the records of a vehicle to the log that is open; without one they are gone, as in the firmware.

    A log that cannot be opened, or takes no more, is told of once, unless whoever opened it does that at the end. A new
    one is tried 5 s later, again and again.

    Args:
        open_sink: opens the next log; raises LogStoreError. None: no logging at all.
        on_open: called when a log has its start-up block, to write what every log begins with.
        own: returns a layout as the firmware's release has it.

    Attributes:
        failure: why there is no log, or the last one is not whole, in one line; None while all is well.
        losses: how many records are lost for which reason, though a log was wanted.
        on_write: hears of each record.
        wanted_by_listener: the names of those that it wants; None for all.
    """

    def __init__(
        self,
        clock: Clock,
        open_sink: Callable[[], LogSink] | None,
        on_open: Callable[[], None] = lambda: None,
        own: Callable[[LogStructure], LogStructure] = lambda structure: structure,
    ) -> None:
        self._clock = clock
        self._open_sink = open_sink
        self._on_open = on_open
        layouts = {structure: own(structure) for structure in STRUCTURES}
        self._writer = DataFlashWriter(tuple(layouts.values()))
        self._own = {before.name: after for before, after in layouts.items() if before != after}
        self._sink: LogSink | None = None
        self._wanted = False
        self._retry_us = 0
        self.on_write: Callable[[LogStructure, Sequence[LogValue]], None] | None = None
        self.wanted_by_listener: Container[str] | None = None
        self.failure: str | None = None
        self.losses: Counter[str] = Counter()
        self.records = 0
        self.size = 0

    @property
    def is_open(self) -> bool:
        """Return whether a log takes records now."""
        return self._sink is not None

    @property
    def open_number(self) -> int | None:
        """Return the number of the log that takes records now, if it has one."""
        return getattr(self._sink, "number", None)

    @property
    def dropped(self) -> int:
        """Return how many records are lost because no log could be written."""
        return self.losses.total()

    def takes(self, structure: LogStructure) -> bool:
        """Return whether there is, or may come to be, anybody who wants records of a fixed type."""
        wanted = self.wanted_by_listener
        is_heard = self.on_write is not None and (wanted is None or structure.name in wanted)
        return is_heard or self._open_sink is not None

    def update(self, wanted: bool, params: ParamTable) -> None:
        """Open or close the log as wanted, and let waiting bytes out when they are due."""
        now_us = self._clock.micros64()
        if not wanted:
            self.close()
        elif self._sink is None and self._open_sink is not None:
            self._wanted = True
            if now_us >= self._retry_us:
                self._open(self._open_sink, params, now_us)
        if self._sink is not None and not self._sink.flush_if_due(now_us):
            self._give_up()

    def idle_until_us(self, wanted: bool) -> int:
        """Return before when ``update`` has nothing to do as things are; 0 if the next one may."""
        if self._sink is not None:
            return self._sink.flush_due_us if wanted else 0
        return NEVER if not wanted or self._open_sink is None else self._retry_us

    def _open(self, open_sink: Callable[[], LogSink], params: ParamTable, now_us: int) -> None:
        try:
            self._sink = open_sink()
        except LogStoreError as error:
            self._fail(str(error))
            return
        self._writer.new_log()
        rows = ((param.name, param.value, param.default) for param in params)
        for record in self._writer.start_up(rows, time_us=now_us):
            self._append(record)
        self._on_open()
        if self._sink is not None and self.failure is not None:
            _log.warning("log: restarted, %d records are lost", self.dropped)
            self.failure = None

    def _append(self, data: bytes) -> None:
        self.records += 1
        self.size += len(data)
        if self._sink is None:
            self._lose()
        elif not self._sink.write(data):
            self._give_up()

    def _give_up(self) -> None:
        self.close()
        self._wanted = True

    def _lose(self) -> None:
        if self._wanted and self.failure is not None:
            self.losses[self.failure] += 1

    def _fail(self, reason: str, *, is_told_at_end: bool = False) -> None:
        self._retry_us = self._clock.micros64() + RETRY_US
        if self.failure is None and not is_told_at_end:
            _log.error("log: %s", reason)
        self.failure = reason

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Write a record of a fixed type (AP_Logger::WriteBlock); ``on_write`` hears of it, log or no log."""
        structure = self._own.get(structure.name, structure)
        if self.on_write is not None:
            self.on_write(structure, values)
        if self._sink is None:
            self._lose()
        else:
            self._append(self._writer.record(structure, values, time_us=self._clock.micros64()))

    def write_named(
        self, name: str, labels: str, units: str, multipliers: str, format: str, values: Sequence[LogValue]
    ) -> None:
        """Write a record of a type that is made at first use (AP_Logger::Write)."""
        if self._sink is None:
            self._lose()
        else:
            self.write(self._writer.define(name, labels, format, units, multipliers), values)

    def write_parameter(self, name: str, value: np.float32) -> None:
        """Write a parameter that has changed (AP_Logger::Write_Parameter)."""
        if self._sink is None:
            self._lose()
        else:
            self._append(self._writer.parameter(name, value, time_us=self._clock.micros64()))

    def close(self) -> None:
        """Close the log that is open, if any."""
        sink, self._sink, self._wanted = self._sink, None, False
        if sink is not None:
            sink.close()
            if sink.reason is not None:
                self.losses[sink.reason] += sink.dropped
                self._fail(sink.reason, is_told_at_end=getattr(sink, "is_told_at_end", False))
