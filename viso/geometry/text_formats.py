# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories in text files, a record a line."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Final

import numpy as np

from viso.geometry.records import CUT_SHORT, Records, TrajectoryError
from viso.geometry.rotation import Array, quat_wxyz_from_rotation
from viso.geometry.trajectory import TIME_END_NS

NANOSECONDS_FROM: Final = 1_000_000_000_000
"""A stamp from this on is one in nanoseconds: in seconds it would be after the year 30,000."""
KITTI_COLUMNS: Final = 12
_ROTATION: Final = 1e-2
_QUAT_NAMES: Final = re.compile(r"\bq[\w.]*([xw])\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Row:
    """The fields of a line, and its number from 1."""

    number: int
    fields: list[str]


@dataclass(frozen=True, slots=True)
class Layout:
    """Which columns hold what, from 0; time is in the first, the position in the next three.

    Attributes:
        quat: the columns of w, x, y, z.
        columns: how many there are at least.
        velocity: where the three columns begin; they may be missing.
        covariance: where the upper triangles of rotation and of position begin, 6 numbers each.
        nanoseconds: whether a time without a decimal point is in ns, however small it is.
    """

    quat: tuple[int, int, int, int]
    columns: int = 8
    velocity: int | None = None
    covariance: int | None = None
    nanoseconds: bool = False


TUM: Final = Layout((7, 4, 5, 6))
OPENVINS: Final = Layout((7, 4, 5, 6), columns=20, covariance=8)
EUROC: Final = Layout((4, 5, 6, 7), velocity=8, nanoseconds=True)
OKVIS: Final = Layout((7, 4, 5, 6), velocity=8, nanoseconds=True)


def read_text(path: Path) -> str:
    """Return what a text file holds. Raises TrajectoryError if it cannot be read or is not text."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"{path}: byte {error.start}: neither text nor a bag") from error
    except (OSError, ValueError) as error:
        raise TrajectoryError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def rows_of(text: str) -> Iterator[Row]:
    """Yield the rows of a text: no blank lines, no comments, no line of headings."""
    first = True
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip() or line.lstrip().startswith(("#", "%")):
            continue
        fields = [field.strip() for field in line.split(",")] if "," in line else line.split()
        if fields[-1] == "":  # VINS ends its lines with a comma
            fields.pop()
        if not first or _is_number(fields[0]):
            yield Row(number, fields)
        first = False


def detect(text: str) -> str | None:
    """Return the name of the format of a text by its headings and its first row; None if it is none known."""
    row = next(rows_of(text), None)
    if row is None:
        return None
    columns = len(row.fields)
    lines = text.split("\n", row.number)
    if "," not in lines[row.number - 1]:
        return {TUM.columns: "tum", OPENVINS.columns: "openvins", KITTI_COLUMNS: "kitti"}.get(columns)
    if columns < EUROC.columns:
        return None
    in_seconds = "." in row.fields[0] and _is_number(row.fields[0]) and float(row.fields[0]) < NANOSECONDS_FROM
    names = _QUAT_NAMES.findall("\n".join(lines[: row.number - 1]).lower())
    w_first = names[0] == "w" if names else not in_seconds
    return "euroc" if w_first else "tum" if in_seconds else "okvis"


def table_records(path: Path, layout: Layout) -> Records:
    """Read a file whose rows hold a time and a pose. Raises TrajectoryError, naming the file, and the line to blame."""
    rows, left_out = _full_rows(path, layout.columns)
    times_ns = [_time_ns(path, row, nanoseconds=layout.nanoseconds) for row in rows]
    table = np.array([_numbers(path, row) for row in rows])
    start = layout.velocity
    velocities = table[:, start : start + 3] if start is not None and table.shape[1] >= start + 3 else None
    covariances = None if layout.covariance is None else _covariances(table[:, layout.covariance :])
    quats = table[:, list(layout.quat)]
    return Records(str(path), times_ns, table[:, 1:4], quats, velocities, covariances, left_out=left_out)


def kitti_records(path: Path, times: Path | None) -> Records:
    """Read rows of 12 numbers, the upper three of a homogeneous matrix, and a file with the time of each in s.

    Raises TrajectoryError, naming the file, and the line where that is to blame.
    """
    if times is None:
        raise TrajectoryError(f"{path}: KITTI's poses have no times: the file that holds them is needed as well")
    times_ns = [_time_ns(times, row) for row in rows_of(read_text(times))]
    rows, left_out = _full_rows(path, KITTI_COLUMNS)
    if len(rows) > len(times_ns) or len(rows) + sum(left_out.values()) < len(times_ns):
        raise TrajectoryError(f"{path}: {len(rows)} poses, but {len(times_ns)} times in {times}")
    table = np.array([_numbers(path, row) for row in rows])[:, :KITTI_COLUMNS].reshape(-1, 3, 4)
    quats = [_quat_wxyz(matrix[:, :3]) for matrix in table]
    return Records(str(path), times_ns[: len(rows)], table[:, :, 3], quats, left_out=left_out)


def _full_rows(path: Path, columns: int) -> tuple[list[Row], dict[str, int]]:
    """Return the rows of a file, at least one and all of a length, and what was left out.

    The last line may be shorter when it has no end: whoever wrote it was stopped in the middle.
    """
    text = read_text(path)
    rows = list(rows_of(text))
    if not rows:
        raise TrajectoryError(f"{path}: no records")
    columns = max(columns, len(rows[0].fields))
    left_out = {}
    if len(rows) > 1 and len(rows[-1].fields) < columns and not text.endswith("\n"):
        rows.pop()
        left_out[CUT_SHORT] = 1
    for row in rows:
        if len(row.fields) != columns:
            raise TrajectoryError(f"{path}:{row.number}: {len(row.fields)} columns, not {columns}")
    return rows, left_out


def _quat_wxyz(matrix: Array) -> Array:
    """Return the quaternion of a matrix as it comes from a file; zeros if that is no rotation."""
    with np.errstate(all="ignore"):
        is_rotation = np.abs(matrix @ matrix.T - np.eye(3)).max() < _ROTATION and np.linalg.det(matrix) > 0
    return quat_wxyz_from_rotation(matrix) if is_rotation else np.zeros(4)


def _covariances(upper: Array) -> Array:
    covariances = np.zeros((len(upper), 6, 6))
    rows, columns = np.triu_indices(3)
    for corner, numbers in ((3, upper[:, :6]), (0, upper[:, 6:12])):
        covariances[:, corner + rows, corner + columns] = covariances[:, corner + columns, corner + rows] = numbers
    return covariances


def _numbers(path: Path, row: Row) -> list[float]:
    try:
        return [float(field) for field in row.fields]
    except ValueError:
        bad = next(field for field in row.fields if not _is_number(field))
        raise TrajectoryError(f"{path}:{row.number}: not a number: {bad[:40]!r}") from None


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _time_ns(path: Path, row: Row, *, nanoseconds: bool = False) -> int:
    """Return the time of a row to the nanosecond, which a float could not hold."""
    text = row.fields[0]
    try:
        time = Decimal(text)
        if 0 <= time < NANOSECONDS_FROM and not (nanoseconds and "." not in text):
            time = time.scaleb(9)
        if 0 <= time < TIME_END_NS:
            return int(time)
    except InvalidOperation:
        pass
    raise TrajectoryError(f"{path}:{row.number}: not a time: {text[:40]!r}")
