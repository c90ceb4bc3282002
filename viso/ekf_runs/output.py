# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log that the filter writes when it is run over another one."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Final

from ap_core.dataflash import DataFlashWriter, ParameterRecord
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ekf_stub.core.ekf3_core import Ekf3Core
from ekf_stub.core.reporting import run_report_of
from ekf_stub.log.ekf_log import EkfLog
from ekf_stub.reports.core_report import CoreReport
from viso.files.outputs import output_file
from viso.logs.logger import STRUCTURES

# However little the firmware was told to log (EK3_LOG_LEVEL): the estimates are what this log is for.
_ALWAYS: Final = {"EK3_LOG_LEVEL": 0}


class EkfOutput:
    """A DataFlash log in memory: parameters, texts, events and estimates, and nothing before :meth:`begin`.

    Args:
        get_int: returns an integer parameter by its full name.
        cores: returns the numbers of the cores.
    """

    def __init__(self, get_int: Callable[[str], int], cores: Callable[[], tuple[int, ...]]) -> None:
        self._writer = DataFlashWriter(STRUCTURES)
        self._data = bytearray()
        self._estimates = EkfLog(self, lambda name: _ALWAYS[name] if name in _ALWAYS else get_int(name), cores)

    @property
    def is_empty(self) -> bool:
        """Tell whether it has not begun."""
        return not self._data

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Append a record."""
        self._data += self._writer.record(structure, values)

    def begin(self, parameters: Iterable[ParameterRecord], time_us: int) -> None:
        """Append what every log begins with: the description of its records, and the parameters."""
        self._data += b"".join(self._writer.start_up(parameters, time_us=time_us))

    def parameter(self, name: str, value: float, time_us: int) -> None:
        """Append a parameter that has changed."""
        self._data += self._writer.parameter(name, value, time_us=time_us)

    def frame(self, core: Ekf3Core, time_us: int, *, is_step: bool) -> None:
        """Append what a filter with a state writes by itself, after a frame."""
        if self._estimates.is_due(time_us, core.is_still(), is_step=is_step):
            self._estimates.update(run_report_of(core), time_us, is_step=is_step)

    def estimates(self, report: CoreReport, time_us: int) -> None:
        """Append what the filter says at a moment."""
        self._estimates.write_streaming(report, time_us)

    def save(self, path: Path) -> None:
        """Put the log in place as a whole.

        Raises InputError if that cannot be done; what was there before is untouched.
        """
        with output_file(path) as file:
            file.write(self._data)
