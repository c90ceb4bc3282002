# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's log: opens it, writes the start-up block, then record after record (AP_Logger/AP_Logger.cpp)."""

import logging
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from ap_core.clock import Clock
from ap_core.dataflash import DataFlashWriter
from ap_core.log_field import LogValue
from ap_core.log_structure import COMMON_STRUCTURES, MAV, MODE, MSG, PARM, LogStructure
from ap_core.param import ParamTable
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from ekf_stub.log.log_structure import LOG_STRUCTURE_FROM_EKF_STUB
from viso.firmware.log_releases import LOG_STRUCTURE_FROM_GPS, OF
from viso.logs.files import LogStoreError
from viso.logs.sink import LogSink

_log = logging.getLogger(__name__)


def _in_firmware_order() -> Iterator[LogStructure]:
    for structure in COMMON_STRUCTURES:
        yield structure
        if structure is PARM:
            yield from LOG_STRUCTURE_FROM_GPS
        if structure is MODE:
            yield from LOG_STRUCTURE_FROM_EKF_STUB
        if structure is MAV:
            yield from LOG_STRUCTURE_FROM_VISUALODOM
            yield OF


STRUCTURES: Final = tuple(_in_firmware_order())


def structures_with(message: LogStructure) -> tuple[LogStructure, ...]:
    """Return all layouts, with a release's own of MSG."""
    return tuple(message if structure is MSG else structure for structure in STRUCTURES)


RETRY_US: Final = 5_000_000


class Logger:
    """Writes the records of a vehicle to the log that is open; without one they are gone, as in the firmware.

    Args:
        clock: time since boot.
        open_sink: opens the next log; raises LogStoreError. None: no logging at all.
        on_open: called when a log has its start-up block, to write what every log begins with.
        structures: layouts of the records of fixed types.
    """

    def __init__(
        self,
        clock: Clock,
        open_sink: Callable[[], LogSink] | None,
        on_open: Callable[[], None] = lambda: None,
        structures: Sequence[LogStructure] = STRUCTURES,
    ) -> None:
        self._clock = clock
        self._open_sink = open_sink
        self._on_open = on_open
        self._writer = DataFlashWriter(structures)
        self._sink: LogSink | None = None
        self._retry_us = 0
        self._dropped_before = 0
        self.on_write: Callable[[LogStructure, Sequence[LogValue]], None] | None = None
        self.failure: str | None = None
        self.records = 0
        self.size = 0

    @property
    def is_open(self) -> bool:
        """Tell whether a log takes records now."""
        return self._sink is not None

    @property
    def open_number(self) -> int | None:
        """Return the number of the log that takes records now, if it has one."""
        return getattr(self._sink, "number", None)

    @property
    def dropped(self) -> int:
        """Return how many records are lost because a log could not be written."""
        return self._dropped_before + (self._sink.dropped if self._sink is not None else 0)

    def update(self, wanted: bool, params: ParamTable) -> None:
        """Open or close the log as wanted, and let waiting bytes out when they are due."""
        now_us = self._clock.micros64()
        if not wanted:
            self.close()
        elif self._sink is None and self._open_sink is not None and now_us >= self._retry_us:
            self._open(self._open_sink, params, now_us)
        if self._sink is not None and not self._sink.flush_if_due(now_us):
            self.failure = "log cannot be written"

    def _open(self, open_sink: Callable[[], LogSink], params: ParamTable, now_us: int) -> None:
        try:
            self._sink = open_sink()
        except LogStoreError as error:
            self._retry_us = now_us + RETRY_US
            self.failure = str(error)
            _log.error("%s", error)
            return
        self.failure = None
        self._writer.new_log()
        rows = ((param.name, param.value, param.default) for param in params)
        for record in self._writer.start_up(rows, time_us=now_us):
            self._append(self._sink, record)
        self._on_open()

    def _append(self, sink: LogSink, data: bytes) -> None:
        self.records += 1
        self.size += len(data)
        if not sink.write(data):
            self.failure = "log cannot be written"

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Write a record of a fixed type (AP_Logger::WriteBlock); ``on_write`` hears of it, log or no log."""
        if self.on_write is not None:
            self.on_write(structure, values)
        sink = self._sink
        if sink is not None:
            self._append(sink, self._writer.record(structure, values, time_us=self._clock.micros64()))

    def write_named(
        self, name: str, labels: str, units: str, multipliers: str, format: str, values: Sequence[LogValue]
    ) -> None:
        """Write a record of a type that is made at first use (AP_Logger::Write)."""
        if self._sink is not None:
            self.write(self._writer.define(name, labels, format, units, multipliers), values)

    def write_parameter(self, name: str, value: np.float32) -> None:
        """Write a parameter that has changed (AP_Logger::Write_Parameter)."""
        if self._sink is not None:
            self._append(self._sink, self._writer.parameter(name, value, time_us=self._clock.micros64()))

    def close(self) -> None:
        """Close the log that is open, if any."""
        if self._sink is not None:
            self._sink.close()
            if self._sink.dropped:
                self.failure = "log cannot be written"
            self._dropped_before += self._sink.dropped
            self._sink = None
