# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories in files: from the text of TUM, EuRoC, KITTI and others to records, and from records to a trajectory.

Unusable records are left out, and counted by reason. Bags become records in ``viso.streams.bag_formats``.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from mav_handlers.links.packed import open_packed
from viso.geometry.pose import sound_covariance
from viso.geometry.rotation import Array, quat_wxyz_from_rotation
from viso.geometry.trajectory import TIME_END_NS, Trajectory

LARGEST: Final = 1e6
"""No position in m and no velocity in m/s is larger; a larger one is from a damaged file, or has a far origin."""
DAY_NS: Final = 86_400 * 10**9
_UNIT_LENGTH: Final = 0.05

NOT_FINITE: Final = "a number that is not finite"
OUT_OF_RANGE: Final = "a position or velocity out of range"
NO_ROTATION: Final = "an attitude that is no rotation"
FAR_OFF: Final = "a time more than a day from most others"
NOT_LATER: Final = "a time not after the one before"
CUT_SHORT: Final = "a line that was cut short"
BAD_COVARIANCE: Final = "a covariance that is none (the pose is kept)"

NANOSECONDS_FROM: Final = 1_000_000_000_000
"""A stamp from this on is one in nanoseconds: in seconds it would be after the year 30,000."""
KITTI_COLUMNS: Final = 12
_ROTATION: Final = 1e-2
_QUAT_NAMES: Final = re.compile(r"\bq[\w.]*([xw])\b", re.IGNORECASE)


class TrajectoryError(Exception):
    """A file that cannot be read as a trajectory, in one line: which file, which line or record, and why."""

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.split()))


class TooFewRecords(TrajectoryError):
    """Too few records can be used; ``left_out`` counts the others by reason."""

    def __init__(self, text: str, left_out: Mapping[str, int]) -> None:
        super().__init__(text)
        self.left_out = left_out


@dataclass(frozen=True, slots=True, eq=False)
class Records:
    """The records of a file as written, usable or not.

    Attributes:
        source: the file's name.
        times_ns: [N], in the order of the file, each from 0 to ``TIME_END_NS``.
        positions: [N, 3] in m.
        quats_wxyz: [N, 4], of whatever norm.
        velocities: [N, 3] in m/s, in the world; None if the file has none.
        covariances: [N, 6, 6], NaN where there is none; None if the file has none.
        arrivals_ns: [N], when the writer of the file received each record; None if the file does not have it.
        left_out: number of records left out already, by reason.
    """

    source: str
    times_ns: Sequence[int]
    positions: Any
    quats_wxyz: Any
    velocities: Any = None
    covariances: Any = None
    arrivals_ns: Sequence[int] | None = None
    left_out: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))


def usable(records: Records, *, from_anywhere: bool = False, fewest: int = 2) -> Trajectory:
    """Return the trajectory of the usable records; a record without a time has that of its arrival.

    Records that cannot be used are left out, and counted. Velocities that are all 0 or NaN count as unknown, as do
    covariances whose numbers are all 0: programs write that for unknown values. ``from_anywhere`` lets positions lie
    far from the origin, as those of UTM do, if near to each other. Raises TooFewRecords for less than ``fewest``.
    """
    times_ns = records.times_ns
    if records.arrivals_ns is not None:
        times_ns = [time or arrival for time, arrival in zip(times_ns, records.arrivals_ns, strict=True)]
    times = np.array(times_ns, dtype=np.int64)
    count = len(times)
    position = np.array(records.positions, dtype=np.float64).reshape(count, 3)
    quats = np.array(records.quats_wxyz, dtype=np.float64).reshape(count, 4)
    velocities, covariances = records.velocities, records.covariances
    velocity = None if velocities is None else np.array(velocities, dtype=np.float64).reshape(count, 3)
    if velocity is not None and not np.nan_to_num(velocity).any():
        velocity = None
    counts = dict(records.left_out)
    kept = np.arange(count)

    def drop(bad: Any, reason: str) -> None:
        nonlocal kept
        if bad.any():
            counts[reason] = int(bad.sum())
            kept = kept[~bad]

    moving = np.hstack([position] if velocity is None else [position, velocity])
    drop(~np.isfinite(np.hstack([moving, quats])).all(axis=1), NOT_FINITE)
    moving[:, :3] -= np.median(position[kept], axis=0) if from_anywhere and len(kept) else 0.0
    drop((np.abs(moving[kept]) > LARGEST).any(axis=1), OUT_OF_RANGE)
    with np.errstate(over="ignore"):
        drop(np.abs(np.linalg.norm(quats[kept], axis=1) - 1) > _UNIT_LENGTH, NO_ROTATION)
    if len(kept):  # a stamp of 0 before a clock is set, or a damaged one, would make years of silence
        drop(np.abs(times[kept] - int(np.median(times[kept]))) > DAY_NS, FAR_OFF)
    drop(times[kept] <= np.maximum.accumulate(np.concatenate([[-1], times[kept]]))[:-1], NOT_LATER)
    if len(kept) < fewest:
        reasons = "".join(f"; {number} with {reason}" for reason, number in counts.items())
        text = f"{records.source}: {len(kept)} usable records, and a trajectory needs {fewest}{reasons}"
        raise TooFewRecords(text, counts)
    covariance = None if covariances is None else _sound(np.array(covariances, dtype=np.float64)[kept], counts)
    return Trajectory(
        times[kept],
        position[kept],
        quats[kept],
        None if velocity is None else velocity[kept],
        covariance,
        left_out=counts,
    )


def _sound(covariances: Array, counts: dict[str, int]) -> Array | None:
    """Return the covariances, NaN for invalid ones; None if there are none at all."""
    bad = 0
    for covariance in covariances:
        if np.isnan(covariance).any() or not covariance.any():
            covariance[:] = np.nan
            continue
        sound = sound_covariance(covariance) if np.abs(covariance).max() <= LARGEST**2 else None
        bad += sound is None
        covariance[:] = np.nan if sound is None else sound
    if bad:
        counts[BAD_COVARIANCE] = bad
    return None if np.isnan(covariances).all() else covariances


# Text


@dataclass(frozen=True, slots=True)
class Row:
    """The fields of a line, and its number from 1."""

    number: int
    fields: list[str]


@dataclass(frozen=True, slots=True)
class Layout:
    """The columns of a format, from 0; time is in the first, the position in the next three.

    Attributes:
        quat: the columns of w, x, y, z.
        columns: least number of columns.
        velocity: first of its three columns, which may be missing.
        covariance: first columns of the upper triangles of rotation and of position, 6 numbers each.
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
    """Return the content of a text file, packed or not. Raises TrajectoryError if it cannot be read or is no text."""
    try:
        with open_packed(path) as file:
            return file.read().decode("utf-8-sig")
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

    The last line may be shorter if it has no end: its writer was stopped.
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
    """Return the quaternion of a matrix from a file; zeros if it is not a rotation."""
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
