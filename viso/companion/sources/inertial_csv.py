# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data in a text file: a line of column names, then numbers between commas.

The columns are ``t_ns`` (whole nanoseconds) or ``t_s`` (seconds), ``gx, gy, gz`` (rotation rate in rad/s) and
``ax, ay, az`` (specific force in m/s^2), in any order; others are passed over, and so are lines that begin with ``#``.
"""

import math
from collections.abc import Iterator, Mapping
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Final

import numpy as np

from viso.companion.sources.base import SourceError
from viso.companion.vio.types import ImuSample

GYRO: Final = ("gx", "gy", "gz")
ACCEL: Final = ("ax", "ay", "az")
UNITS_NS: Final = {"t_ns": Decimal(1), "t_s": Decimal(10**9)}
_END_NS: Final = 1 << 62


def read_inertial_csv(path: Path, start_s: float = 0.0) -> tuple[ImuSample, ...]:
    """Return the samples in a file, in its axes; ``start_s``, when the pictures begin, is taken off all stamps.

    Raises SourceError, naming the file, and the line where that is to blame.
    """
    samples: list[ImuSample] = []
    start_ns = round(start_s * 1e9)
    columns: Mapping[str, int] | None = None
    for number, fields in _lines(path):
        try:
            if columns is None:
                columns = _columns(fields)
                continue
            sample = _sample(fields, columns, start_ns)
            if samples and sample.t_ns <= samples[-1].t_ns:
                raise ValueError("a time not after the one before")
        except ValueError as error:
            raise SourceError(f"{path}:{number}: {error}") from error
        samples.append(sample)
    if not samples:
        raise SourceError(f"{path}: no inertial data")
    return tuple(samples)


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise SourceError(f"{path}: not UTF-8 text") from error
    except (OSError, ValueError) as error:
        raise SourceError(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip() and not line.startswith("#"):
            yield number, [field.strip() for field in line.split(",")]


def _columns(names: list[str]) -> dict[str, int]:
    columns = {name: index for index, name in enumerate(names)}
    missing = [name for name in (*GYRO, *ACCEL) if name not in columns]
    if not UNITS_NS.keys() & columns.keys():
        missing.insert(0, "t_ns or t_s")
    if missing:
        raise ValueError(f"no column {', '.join(missing)}")
    return columns


def _sample(fields: list[str], columns: Mapping[str, int], start_ns: int) -> ImuSample:
    if len(fields) < len(columns):
        raise ValueError(f"{len(fields)} columns, not {len(columns)}")
    accel, gyro = (np.array([_number(fields[columns[name]]) for name in names]) for names in (ACCEL, GYRO))
    return ImuSample.checked(_time_ns(fields, columns) - start_ns, accel, gyro)


def _time_ns(fields: list[str], columns: Mapping[str, int]) -> int:
    name = "t_ns" if "t_ns" in columns else "t_s"
    text = fields[columns[name]]
    try:
        time_ns = Decimal(text) * UNITS_NS[name]  # as a float it would lose what comes after microseconds
        if abs(time_ns) < _END_NS:
            return int(time_ns)
    except (InvalidOperation, ValueError):
        pass
    raise ValueError(f"{name}: {text!r} is no time")


def _number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text!r} is not finite")
    return number
