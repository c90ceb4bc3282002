# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads logs back: what a recorded AHRS needs, and numbers and texts out of records that may hold anything."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ap_core.dataflash_columns import LogColumns
from ap_core.dataflash_scan import Lost
from ap_core.location import Location
from ap_core.log_structure import FMT
from ekf_stub.ahrs.ahrs_base import AHRS_START_US
from ekf_stub.ahrs.ahrs_recorded import RecordedStates
from mav_handlers.links.packed import open_packed
from viso.errors import InputError
from viso.files.first_bytes import DATAFLASH_BYTES, content_of
from viso.logs.filter_records import rows_of
from viso.logs.vehicle_log import ORGN_EKF

Array = npt.NDArray[np.float64]

_EKF3_INITIALISED: Final = re.compile(r"EKF3 IMU\d initialised")
_START_UP_MS: Final = 2002  # from the start of the AHRS to that text
_EKF3_USES: Final = "EKF3 IMU0 is using "
_RECORD_PERIOD_US: Final = 110_000  # of XKF1
_HORIZONTAL_POSITION: Final = 1 << 3 | 1 << 4  # relative or absolute, of XKF4.SS
_VERTICAL_POSITION: Final = 1 << 5
OTHER_LOG: Final = "another log, such as the tail of an older one"
_STEP_BACK_US: Final = 100_000  # threads that write at the same time are less apart
_NEIGHBOURS: Final = 9  # records on either side of a step: a few damaged times are none


def _read_bytes(path: Path) -> bytes:
    with open_packed(path) as file:
        data = file.read()
    if not data.startswith(DATAFLASH_BYTES):
        found = content_of(path)
        instead = f", but a {found.value}" if found else ""
        raise InputError(f"{path}: not a DataFlash log{instead}")
    return data


@contextmanager
def _as_input_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except InputError:
        raise
    except Exception as error:  # whatever a damaged log provokes
        raise InputError(f"{path}: not a DataFlash log: {error}") from error


def read_columns(path: Path) -> LogColumns:
    """Return a DataFlash log, packed or not, as columns.

    A log ends where TimeUS steps back: another log follows there, such as the tail of an older one that the file had
    held before. ``lost`` of the columns tells it. Raises InputError if the log cannot be read.
    """
    with _as_input_errors(path):
        data = _read_bytes(path)
        columns = LogColumns(data)
        if other := _other_log_in(columns):
            columns = LogColumns(memoryview(data)[: other.offset])
            columns.lost += (other,)
    if problem := columns.ill_described.get(FMT.msg_type):
        raise InputError(f"{path}: not a DataFlash log: {problem}")
    return columns


def _other_log_in(log: LogColumns) -> Lost | None:
    """Return the bytes from the first lasting step back of TimeUS on; None without one.

    A step must show among the records of one type, since tools may write a log sorted by types.
    """
    begins, times_us, types = log.times_us()
    for step in np.flatnonzero(np.diff(times_us) < -_STEP_BACK_US) + 1:
        before, after = slice(max(step - _NEIGHBOURS, 0), step), slice(step, step + _NEIGHBOURS)
        is_lasting = np.median(times_us[after]) < np.median(times_us[before]) - _STEP_BACK_US
        if is_lasting and (np.isin(types[:step], types[after]) & (times_us[:step] > times_us[step])).any():
            offset, (from_s, to_s) = int(begins[step]), times_us[step - 1 : step + 1] * 1e-6
            return Lost(offset, log.size - offset, f"{OTHER_LOG}: TimeUS steps back from {from_s:.1f} to {to_s:.1f} s")
    return None


def notes_of_lost(log: LogColumns) -> Iterator[str]:
    """Yield what a log lost: bytes that are in no record, and another log at its end."""
    others = [one for one in log.lost if one.reason.startswith(OTHER_LOG)]
    damaged = [one for one in log.lost if one not in others]
    if damaged:
        reasons = ", ".join(sorted({lost.reason for lost in damaged}))
        size = sum(lost.size for lost in damaged)
        yield f"damaged: {size} bytes in {len(damaged)} places are in no record ({reasons})"
    for one in others:
        yield f"the last {one.size} bytes are {one.reason}; they are left out"


class LogRecord(SimpleNamespace):
    """A record as pymavlink's DFReader would give it: its fields by their labels."""

    def __init__(self, kind: str, fields: Mapping[str, Any]) -> None:
        super().__init__(**fields)
        self._kind = kind

    def get_type(self) -> str:
        """Return the name of its type."""
        return self._kind


def records_in(log: LogColumns, kinds: Iterable[str]) -> Iterator[LogRecord]:
    """Yield the records of some kinds in the log's order, many times faster than pymavlink's DFReader does."""
    present = [kind for kind in kinds if kind in log.counts]
    rows = [_rows(log, kind) for kind in present]
    owners = np.repeat(np.arange(len(present)), [log.counts[kind] for kind in present])
    for owner in owners[np.argsort(_offsets(log, present))].tolist():
        yield next(rows[owner])


def places_of(log: LogColumns, kinds: Iterable[str]) -> npt.NDArray[np.int64]:
    """Return where the records of some kinds begin, in bytes, in the log's order."""
    return np.sort(_offsets(log, kinds))


def _offsets(log: LogColumns, kinds: Iterable[str]) -> npt.NDArray[np.int64]:
    return np.concatenate([np.zeros(0, np.int64), *map(log.offsets, kinds)])


def _rows(log: LogColumns, kind: str) -> Iterator[LogRecord]:
    columns = log.columns(kind)
    for values in zip(*(column.tolist() for column in columns.values()), strict=True):
        yield LogRecord(kind, dict(zip(columns, values, strict=True)))


def read_recorded_states(path: Path) -> RecordedStates:
    """Return attitude and position of a log. Raises InputError if it cannot be read, or holds no ATT records."""
    return recorded_states(path, read_columns(path))


def recorded_states(path: Path, log: LogColumns) -> RecordedStates:
    """Return attitude and position of a log that has been read; see ``read_recorded_states``."""
    if not log.counts.get("ATT"):
        raise InputError(f"{path}: holds no ATT records to take the attitude from")
    with _as_input_errors(path):
        attitude = table_of(log, "ATT", ("TimeUS", "Roll", "Pitch", "Yaw"))
        state = _valid_states(log, ("PN", "PE", "PD", "VN", "VE", "VD"), core=0)
        origin = _gps_origin(log)
        start_us, pos_start_us = ahrs_start_us(log), _position_start_us(log, state[:, 0])
    return RecordedStates(
        attitude[:, 0], attitude[:, 1:], state[:, 0], state[:, 1:4], state[:, 4:], pos_start_us, start_us, origin
    )


def _position_start_us(log: LogColumns, pos_time_us: Array) -> float:
    """Return when the first position of a log became valid: when EKF3 said so, if that was just before the record."""
    first_us = float(pos_time_us[0]) if len(pos_time_us) else math.inf
    said_us = (time_us for time_us, text in rows_of(log, "MSG", "Message") if str(text).startswith(_EKF3_USES))
    return next((time_us for time_us in said_us if 0 <= first_us - time_us < _RECORD_PERIOD_US), first_us)


def ahrs_start_us(log: LogColumns) -> int:
    """Return when the AHRS of a log started, in us since boot, by when EKF3 was initialised.

    AP_AHRS::update_EKF3 waits until more than 1 s has passed, which is a pass later, and
    NavEKF3_core::InitialiseFilterBootstrap 1 s more. A log without that text began later; the start is then that of the
    reference's recordings.
    """
    texts = rows_of(log, "MSG", "Message")
    initialised_us = next((int(time_us) for time_us, text in texts if _EKF3_INITIALISED.fullmatch(str(text))), 0)
    start_ms = initialised_us // 1000 - _START_UP_MS
    return start_ms * 1000 if start_ms > 0 else AHRS_START_US


def _gps_origin(log: LogColumns) -> tuple[float, Location] | None:
    """Return when the EKF took its origin from GPS, and the place; RSO3 tells of one that a client sets."""
    if log.counts.get("RSO3"):
        return None
    if (origin := first_origin(log)) is None:
        return None
    time_us, lat_deg, lng_deg, alt_m = origin
    return time_us, Location(round(lat_deg * 1e7), round(lng_deg * 1e7), round(alt_m * 100))


def first_origin(log: LogColumns) -> tuple[float, float, float, float] | None:
    """Return the first origin of the EKF in a log: time in us, latitude and longitude in deg, altitude in m."""
    for time_us, kind, lat_deg, lng_deg, alt_m in rows_of(log, "ORGN", "Type", "Lat", "Lng", "Alt"):
        if kind == ORGN_EKF and all(map(math.isfinite, (lat_deg, lng_deg, alt_m))):
            return float(time_us), lat_deg, lng_deg, alt_m
    return None


def table_of(log: LogColumns, kind: str, labels: Sequence[str]) -> Array:
    """Return fields of the records of a kind as numbers, a row a record."""
    return np.column_stack([column.astype(np.float64) for column in log.columns(kind, labels).values()])


def valid_positions(log: LogColumns, core: int = 0) -> Array:
    """Return time and position of the XKF1 records of a core, as far as its XKF4 before it has a position."""
    return _valid_states(log, ("PN", "PE", "PD"), core)


def _valid_states(log: LogColumns, labels: Sequence[str], core: int) -> Array:
    if not (log.counts.get("XKF1") and log.counts.get("XKF4")):
        return np.zeros((0, 1 + len(labels)))
    of_core, of_status = (_of_core(log, kind, core) for kind in ("XKF1", "XKF4"))
    status = log.columns("XKF4", ["SS"])["SS"][of_status]
    valid = (status & _HORIZONTAL_POSITION != 0) & (status & _VERTICAL_POSITION != 0)
    # An XKF4 is written just before the XKF1 of the same time.
    latest = np.searchsorted(log.offsets("XKF4")[of_status], log.offsets("XKF1")[of_core])
    chosen = np.append(False, valid)[latest]
    states: Array = table_of(log, "XKF1", ("TimeUS", *labels))[of_core][chosen]
    return states


def _of_core(log: LogColumns, kind: str, core: int) -> npt.NDArray[np.bool_]:
    """Return which records are of a core; before Copter 4.1 others than the first have types of their own."""
    if "C" not in log.types[kind].labels:
        return np.ones(log.counts[kind], dtype=np.bool_)
    return np.asarray(log.columns(kind, ["C"])["C"] == core, dtype=np.bool_)


class RecordError(ValueError):
    """A record, or the lack of one, makes it impossible to go on; the text names it and its field."""


def numbers(record: Any, *labels: str) -> list[float]:
    """Return fields of a record. Raises RecordError if a field is missing, or no number."""
    try:
        return [float(getattr(record, label)) for label in labels]
    except (AttributeError, TypeError, ValueError) as error:
        raise RecordError(f"{record.get_type()} lacks a number in {' or '.join(labels)}") from error


def finite(record: Any, *labels: str) -> list[float]:
    """Return fields of a record. Raises RecordError if one is missing, NaN, infinite, or no number."""
    values = numbers(record, *labels)
    for label, value in zip(labels, values, strict=True):
        if not math.isfinite(value):
            raise RecordError(f"{record.get_type()}.{label} is {value}")
    return values


def whole(record: Any, *labels: str) -> list[int]:
    """Return integer fields of a record. Raises RecordError if a field is missing, or no number."""
    return [int(value) for value in finite(record, *labels)]


def instance(record: Any) -> int:
    """Return which of several sensors a record is about. Raises RecordError if it does not say so."""
    return whole(record, "I")[0]


def text(record: Any, label: str) -> str:
    """Return a text of a record. Raises RecordError if the field is missing, or no text."""
    value = getattr(record, label, None)
    if not isinstance(value, str):
        raise RecordError(f"{record.get_type()} lacks a text in {label}")
    return value
