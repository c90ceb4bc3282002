# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A DataFlash log as bytes: records, preceded by their FMT records, and the start-up block.

Nothing is opened or written here; every call returns the bytes to append to the log.

Source: AP_Logger/AP_Logger_Backend.cpp, AP_Logger/LoggerMessageWriter.cpp, AP_Logger/LogFile.cpp,
AP_Logger/AP_Logger.cpp.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np

from ap_core.log_field import LogValue
from ap_core.log_structure import (
    FMT,
    FMTU,
    MAX_MSG_TYPE,
    MULT,
    MULTIPLIERS,
    PARM,
    QUIET_NAN,
    TIME_LABEL,
    UNIT,
    UNITS,
    LogStructure,
)

ParameterRecord = tuple[str, float | np.float32, float | np.float32]
"""Name, value and effective default of a parameter."""

_REQUIRED: Final = (FMT, UNIT, FMTU, MULT, PARM)


class DataFlashWriter:
    """Turns records into the bytes of a self-describing log.

    One writer serves all logs of a vehicle: :meth:`new_log` begins another file, and run-time types keep their ids.
    Records never come before the FMT of their type.

    Args:
        structures: the fixed types, in the order of the start-up block. The first is FMT; UNIT, FMTU, MULT and PARM are
            among them, and may have other ids than the firmware's.

    Raises:
        ValueError: if one of these is missing, or an id or a name occurs twice.
    """

    def __init__(self, structures: Sequence[LogStructure]) -> None:
        self._fixed = tuple(structures)
        self._by_id = {structure.msg_type: structure for structure in self._fixed}
        self._by_name = {structure.name: structure for structure in self._fixed}
        if not len(self._fixed) == len(self._by_id) == len(self._by_name):
            raise ValueError("log structures share an id or a name")
        if self._fixed[:1] != (FMT,):
            raise ValueError("log structures must begin with FMT")
        missing = [wanted.name for wanted in _REQUIRED if not self._has(wanted)]
        if missing:
            raise ValueError(f"log structures lack {', '.join(missing)}")
        self._fmtu = self._by_name[FMTU.name]
        self._defined: dict[str, LogStructure] = {}
        self._described: dict[int, LogStructure] = {}
        self._time_us = 0

    def _has(self, wanted: LogStructure) -> bool:
        own = self._by_name.get(wanted.name)
        return own is not None and _layout(own) == _layout(wanted)

    def new_log(self) -> None:
        """Forget which types the log describes, as a new file begins (start_new_log_reset_variables)."""
        self._described.clear()

    def define(
        self, name: str, labels: str, format: str, units: str | None = None, multipliers: str | None = None
    ) -> LogStructure:
        """Return the run-time type of this name, created at first use with the highest free id.

        Missing units or multipliers become ``?``; without multipliers a leading TimeUS gets ``s`` and ``F``
        (AP_Logger::msg_fmt_for_name, fill_logstructure). Raises ValueError if the layout is invalid, the name is taken
        by another layout, or no id is left.
        """
        units, multipliers = _fill_units(labels, format, units, multipliers)
        known = self._defined.get(name)
        if known is not None and (format, labels, units, multipliers) == _layout(known):
            return known
        if known is not None or name in self._by_name:
            raise ValueError(f"log structure {name!r} is defined already")
        msg_type = self._free_msg_type()
        structure = LogStructure(msg_type, name, format, labels, units, multipliers)
        self._by_id[msg_type] = self._defined[name] = structure
        return structure

    def _free_msg_type(self) -> int:
        for msg_type in range(MAX_MSG_TYPE, 0, -1):
            if msg_type not in self._by_id:
                return msg_type
        raise ValueError("no message id is left for another log structure")

    def record(self, structure: LogStructure, values: Sequence[LogValue], *, time_us: int | None = None) -> bytes:
        """Return a record, after the FMT and FMTU records of its type where the log lacks them.

        Args:
            structure: a fixed type, or one made by :meth:`define`.
            values: one value a field; see :meth:`LogStructure.pack`.
            time_us: the time FMTU records carry; by default the record's TimeUS, or the latest one.

        Raises:
            ValueError: if the type is not registered here, or the values do not fit it.
        """
        is_described = self._described.get(structure.msg_type) is structure  # the usual case
        if not is_described and self._by_id.get(structure.msg_type) != structure:
            raise ValueError(f"log structure {structure.name!r} is not registered")
        packed = structure.pack(values)
        if time_us is not None:
            self._time_us = time_us
        elif structure.fields[0] == TIME_LABEL and isinstance(values[0], int):
            self._time_us = values[0]
        return packed if is_described else self._describe(structure) + packed

    def _describe(self, structure: LogStructure) -> bytes:
        """Return FMT and FMTU of a type, those of FMT and FMTU first (AP_Logger_Backend::Write_Emit_FMT).

        The FMT of FMTU comes between the two if this is the log's first FMTU record.
        """
        before = b"" if structure == FMT else self._describe(FMT)
        if structure.msg_type in self._described:
            return before
        return before + self._format(structure) + self._describe(self._fmtu) + self._format_units(structure)

    def _format(self, structure: LogStructure) -> bytes:
        self._described[structure.msg_type] = structure
        return FMT.pack((structure.msg_type, structure.length, structure.name, structure.format, structure.labels))

    def _format_units(self, structure: LogStructure) -> bytes:
        return self._fmtu.pack((self._time_us, structure.msg_type, structure.units, structure.multipliers))

    def parameter(self, name: str, value: float | np.float32, *, time_us: int) -> bytes:
        """Return the PARM record of a parameter that changed; its default is :data:`QUIET_NAN`."""
        return self.record(PARM, (time_us, name, value, QUIET_NAN))

    def start_up(self, parameters: Iterable[ParameterRecord], *, time_us: int) -> Iterator[bytes]:
        """Yield the start-up block, one record at a time: FMT, PARM, UNIT, MULT, FMTU.

        Other records may be written between two of these. FMT records already in the log are left out, FMTU
        records are repeated (LoggerMessageWriter_DFLogStart::process).

        Args:
            parameters: in the order of the parameter table.
            time_us: the time of the records.
        """
        for structure in self._fixed:
            if structure.msg_type not in self._described:
                yield self._format(structure)
        for name, value, default in parameters:
            yield self.record(PARM, (time_us, name, value, default))
        for unit, label in UNITS:
            yield self.record(self._by_name[UNIT.name], (time_us, ord(unit), label))
        for multiplier, factor in MULTIPLIERS:
            yield self.record(self._by_name[MULT.name], (time_us, ord(multiplier), factor))
        for structure in self._fixed:
            yield self.record(self._fmtu, (time_us, structure.msg_type, structure.units, structure.multipliers))


def _layout(structure: LogStructure) -> tuple[str, str, str, str]:
    return structure.format, structure.labels, structure.units, structure.multipliers


def _fill_units(labels: str, format: str, units: str | None, multipliers: str | None) -> tuple[str, str]:
    unknown = "?" * len(format)
    filled = unknown if units is None else units
    if multipliers is not None:
        return filled, multipliers
    if not labels.startswith(TIME_LABEL + ","):
        return filled, unknown
    return "s" + filled[1:], "F" + unknown[1:]
