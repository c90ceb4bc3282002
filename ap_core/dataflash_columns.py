# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A DataFlash log as columns: an array for each field of each type of record.

Nothing is opened here: a log is its bytes. A type is read as a whole, and only when it is requested.
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from ap_core.dataflash_dtype import Column, Records, shown
from ap_core.dataflash_scan import (
    HEADER_BYTES,
    Bytes,
    Chain,
    Formats,
    Layout,
    Lost,
    Offsets,
    lost_bytes,
    rows_at,
    scan,
)
from ap_core.log_structure import FMTU, MULT, UNIT

# The prefixes that DFReader puts before a unit; other factors are written out.
_PREFIXES: Final = {0.0: "", 1.0: "", 1e-1: "d", 1e-2: "c", 1e-3: "m", 1e-6: "\u00b5", 1e-9: "n"}
_TIME: Final = np.dtype([("TimeUS", "<u8")])
_FILE: Final = "FILE"  # holds pieces of files, which are no texts


class LogColumns:
    """All records of a log.

    Args:
        data: the log's bytes (bytes or a memory map).

    Attributes:
        lost: the bytes that are in no record, and why; empty for a sound log.
    """

    def __init__(self, data: Any) -> None:
        self._data = np.frombuffer(data, np.uint8) if len(data) else np.zeros(0, np.uint8)
        self._chain: Chain
        self._formats: Formats
        self._chain, self._formats = scan(self._data)
        self.lost: tuple[Lost, ...] = lost_bytes(self._data, self._chain, self._formats)
        self._by_name = {layout.name: layout for layout in self._formats.layouts.values()}

    def __len__(self) -> int:
        return len(self._chain.begins)

    @property
    def begins(self) -> Offsets:
        """The offset of each record in bytes."""
        return self._chain.begins

    @property
    def size(self) -> int:
        """The length of the log in bytes."""
        return len(self._data)

    @property
    def sequence(self) -> Bytes:
        """The type number of each record."""
        return self._chain.types

    @property
    def types(self) -> Mapping[str, Layout]:
        """The layout of each type in FMT records, by name, including types without records."""
        return MappingProxyType(self._by_name)

    @cached_property
    def counts(self) -> Mapping[str, int]:
        """The number of records of each type that has any."""
        counts = np.bincount(self._chain.types, minlength=256).tolist()
        return {name: counts[one.msg_type] for name, one in self._by_name.items() if counts[one.msg_type]}

    def offsets(self, name: str) -> Offsets:
        """Return the offset of each record of a type in bytes, which orders records of several types."""
        layout = self._by_name.get(name)
        if layout is None:
            return np.zeros(0, np.int64)
        begins: Offsets = self._chain.begins[self._chain.types == layout.msg_type]
        return begins

    def times_us(self) -> tuple[Offsets, Offsets, Bytes]:
        """Return offset in bytes, time in us and type number of each record that begins with TimeUS, in log order."""
        timed = np.zeros(256, np.bool_)
        for layout in self._by_name.values():
            timed[layout.msg_type] = layout.labels[:1] == ("TimeUS",) and layout.format[:1] == "Q"
        has_time = timed[self._chain.types]
        begins: Offsets = self._chain.begins[has_time]
        times_us: Offsets = rows_at(self._data, begins + HEADER_BYTES, _TIME)["TimeUS"].astype(np.int64)
        return begins, times_us, self._chain.types[has_time]

    def records(self, name: str) -> Records:
        """Return the records of a type as stored. Raises KeyError if the log has no such type."""
        return rows_at(self._data, self.offsets(name), self._by_name[name].dtype)

    def columns(self, name: str, labels: Iterable[str] | None = None) -> dict[str, Column]:
        """Return fields of a type by label, with the values that log readers show; see :func:`shown`.

        Args:
            name: of the type.
            labels: of the fields, all by default.

        Raises:
            KeyError: if the log has no such type, or the type no such field.
        """
        layout, records = self._by_name[name], self.records(name)
        formats = dict(zip(layout.dtype.names or (), " " + layout.format, strict=True))
        wanted = [(label, formats[label]) for label in (list(formats)[1:] if labels is None else labels)]
        if name == _FILE:
            return {label: records[label] for label, _ in wanted}
        return {label: shown(records[label], char) for label, char in wanted}

    @property
    def ill_described(self) -> Mapping[int, str]:
        """The reasons why types with an FMT cannot be read, by type number."""
        return MappingProxyType(self._formats.ill)

    def units(self, name: str) -> dict[str, str]:
        """Return the units of a type's fields by label, multipliers included, as DFReader shows them.

        A unit is an empty text if the log has none.
        """
        layout = self._by_name[name]
        ids, multiplier_ids = self._unit_ids.get(layout.msg_type, ("", ""))
        units = {}
        for number, label in enumerate(layout.labels):
            unit = self._unit_labels.get(ids[number : number + 1], "")
            factor = self._factors.get(multiplier_ids[number : number + 1])
            is_scaled = layout.format[number : number + 1] in tuple("cCeEL")
            units[label] = unit if is_scaled or not unit or factor is None else _with_factor(factor, unit)
        return units

    @cached_property
    def _unit_ids(self) -> dict[int, tuple[str, str]]:
        return {int(row[0]): (row[1], row[2]) for row in self._rows(FMTU.name, FMTU.fields[1:])}

    @cached_property
    def _unit_labels(self) -> dict[str, str]:
        return {chr(row[0] & 0xFF): row[1] for row in self._rows(UNIT.name, UNIT.fields[1:])}

    @cached_property
    def _factors(self) -> dict[str, float]:
        # The firmware's doubles carry float32 values; seven digits restore the intended value.
        return {chr(row[0] & 0xFF): float(f"{row[1]:.7g}") for row in self._rows(MULT.name, MULT.fields[1:])}

    def _rows(self, name: str, labels: Iterable[str]) -> Iterator[tuple[Any, ...]]:
        if name not in self._by_name:
            return iter(())
        columns = self.columns(name, labels)
        return zip(*(column.tolist() for column in columns.values()), strict=True)


def _with_factor(factor: float, unit: str) -> str:
    prefix = _PREFIXES.get(factor)
    return f"{factor:.4g} {unit}" if prefix is None else prefix + unit
