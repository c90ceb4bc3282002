# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The output log of a filter that is run over another log."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Final

from ap_core.dataflash import DataFlashWriter, ParameterRecord
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ekf_stub.core.core import Core
from ekf_stub.log.ekf_log import EkfLog
from ekf_stub.reports import CoreReport
from viso.files.outputs import output_file
from viso.logs.logger import STRUCTURES

# Independent of the firmware's own log level: this log is for the estimates.
_ALWAYS: Final = {"EK3_LOG_LEVEL": 0}


class EkfOutput:
    """A DataFlash log in memory: parameters, texts, events and estimates, empty before :meth:`begin`."""

    def __init__(self, primary: Callable[[], int]) -> None:
        self._writer = DataFlashWriter(STRUCTURES)
        self._data = bytearray()
        self._primary = primary
        self._estimates: dict[int, EkfLog] = {}

    def _estimates_of(self, number: int) -> EkfLog:
        if number not in self._estimates:
            self._estimates[number] = EkfLog(self, _ALWAYS.__getitem__, (number,), self._primary)
        return self._estimates[number]

    @property
    def is_empty(self) -> bool:
        """Return whether it is empty."""
        return not self._data

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Append a record."""
        self._data += self._writer.record(structure, values)

    def begin(self, parameters: Iterable[ParameterRecord], time_us: int) -> None:
        """Append the start of every log: the description of its records, and the parameters."""
        self._data += b"".join(self._writer.start_up(parameters, time_us=time_us))

    def parameter(self, name: str, value: float, time_us: int) -> None:
        """Append a parameter that has changed."""
        self._data += self._writer.parameter(name, value, time_us=time_us)

    def passed(self, number: int, core: Core, time_us: int) -> None:
        """Append the records that a core logs after a pass."""
        self._estimates_of(number).log_pass(core, time_us)

    def estimates(self, number: int, report: CoreReport, time_us: int) -> None:
        """Append the estimates of a core at a time."""
        self._estimates_of(number).write_streaming(report, time_us)

    def save(self, path: Path) -> None:
        """Write the log to a file at once.

        Raises InputError if that fails; an existing file then stays unchanged.
        """
        with output_file(path) as file:
            file.write(self._data)
