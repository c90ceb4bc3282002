# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The telemetry in a GoPro's video: the camera's own IMU, and the messages of the drone that carries it.

The camera's axes are z up, x to its left, y back, as was found by comparing the gyro with the movement of the picture.
A HERO5 has them in the order z, x, y without stating it; later cameras state the order (ORIN).
"""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from viso.companion.sources.base import SourceError
from viso.companion.sources.gpmf import GpmfError, Stream, streams_of
from viso.companion.sources.karma import DroneTrack, drone_track
from viso.companion.sources.mp4 import Payload, read_payloads
from viso.companion.vio.types import ImuSample
from viso.geometry.rotation import Array

TELEMETRY: Final = b"gpmd"
DEFAULT_AXES: Final = "ZXY"
_COLUMNS: Final = {"ACCL": 3, "GYRO": 3, "ATTD": 4, "LNED": 7}
_LONGEST_S: Final = 1e6
_FLU_FROM_XYZ: Final = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Telemetry:
    """The data beside the pictures, by the time of the video: the camera's IMU, FLU, and the drone's messages."""

    samples: tuple[ImuSample, ...]
    drone: DroneTrack | None


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A stream's rows in a payload, and when that begins and ends in the video."""

    start_s: float
    end_s: float
    stream: Stream


def has_telemetry(path: Path) -> bool:
    """Return whether a file is an MP4 with GoPro's telemetry."""
    try:
        return bool(read_payloads(path, TELEMETRY))
    except SourceError:
        return False


def read_telemetry(path: Path) -> Telemetry:
    """Return the telemetry in a video. Raises SourceError if there is none, or it is damaged."""
    payloads = read_payloads(path, TELEMETRY)
    try:
        parts = _parts(payloads)
        for key in ("ACCL", "GYRO"):
            if not parts[key]:
                raise GpmfError(f"no {key}")
        return Telemetry(tuple(_samples(parts["ACCL"], parts["GYRO"])), _drone(parts["ATTD"], parts["LNED"]))
    except GpmfError as error:
        raise SourceError(f"{path}: not the telemetry of a GoPro, or a damaged one: {error}") from error


def _parts(payloads: Sequence[Payload]) -> dict[str, list[_Part]]:
    found: dict[str, list[_Part]] = {key: [] for key in _COLUMNS}
    for payload in payloads:
        for stream in streams_of(payload.data):
            if stream.key not in found or not len(stream.rows):
                continue
            rows = stream.rows[:, : _COLUMNS[stream.key]]
            if rows.shape[1] < _COLUMNS[stream.key] or not np.isfinite(rows).all():
                raise GpmfError(f"{stream.key}: columns missing, or not finite")
            end_s = payload.start_s + payload.duration_s
            found[stream.key].append(_Part(payload.start_s, end_s, dataclasses.replace(stream, rows=rows)))
    return found


def _samples(accel_parts: list[_Part], gyro_parts: list[_Part]) -> Iterator[ImuSample]:
    """Yield samples at the times of the accelerometer, with the mean of the gyro's around each."""
    accel_s, accel = _times(accel_parts), _flu(accel_parts)
    gyro_s, gyro = _times(gyro_parts), _flu(gyro_parts)
    if len(accel_s) < 2:
        raise GpmfError("ACCL: one sample")
    half_s = 0.5 * float(np.median(np.diff(accel_s)))
    inside = (accel_s - half_s >= gyro_s[0]) & (accel_s + half_s <= gyro_s[-1])
    accel_s, accel = accel_s[inside], accel[inside]
    turn = np.vstack([np.zeros(3), np.cumsum(0.5 * (gyro[1:] + gyro[:-1]) * np.diff(gyro_s)[:, None], axis=0)])
    turned = [
        np.interp(accel_s + half_s, gyro_s, angle) - np.interp(accel_s - half_s, gyro_s, angle) for angle in turn.T
    ]
    rates = np.stack(turned, axis=1) / (2 * half_s)
    for t_s, force, rate in zip(accel_s.tolist(), accel, rates, strict=True):
        yield ImuSample.checked(round(t_s * 1e9), force, rate)


def _times(parts: list[_Part]) -> Array:
    """Return the time of each row: the rate is the camera's clock's, as steady as that, the start the video's."""
    counts = np.array([len(part.stream.rows) for part in parts])
    totals = [part.stream.total for part in parts]
    firsts = np.array(np.cumsum(counts) if None in totals else totals, np.float64) - counts
    firsts -= firsts[0]
    video_s = np.array([part.start_s for part in parts])
    ticks_s = [part.stream.tick_s for part in parts]
    clock_s = video_s if None in ticks_s else np.array(ticks_s, np.float64)
    start_s, period_s = parts[0].start_s, (parts[0].end_s - parts[0].start_s) / counts[0]
    if len(parts) > 1 and (np.diff(firsts) > 0).all():
        period_s, start_s = np.polyfit(firsts, clock_s, 1).tolist()
        start_s -= float(np.median(clock_s - video_s))
    indices = [first + np.arange(count) for first, count in zip(firsts, counts, strict=True)]
    times: Array = start_s + period_s * np.concatenate(indices)
    if not (np.abs(times) < _LONGEST_S).all() or not (np.diff(times) > 0).all():
        raise GpmfError(f"{parts[0].stream.key}: times do not increase")
    return times


def _flu(parts: list[_Part]) -> Array:
    letters = parts[0].stream.axes or DEFAULT_AXES
    if sorted(letters.upper()) != ["X", "Y", "Z"]:
        raise GpmfError(f"axes {letters!r}")
    xyz_from_columns = np.zeros((3, 3))
    for column, letter in enumerate(letters):
        xyz_from_columns["XYZ".index(letter.upper()), column] = 1.0 if letter.isupper() else -1.0
    flu: Array = _rows(parts) @ (_FLU_FROM_XYZ @ xyz_from_columns).T
    return flu


def _drone(attitudes: list[_Part], positions: list[_Part]) -> DroneTrack | None:
    if not attitudes or not positions:
        return None
    spans = [(part.start_s, part.end_s, part.stream.rows[0, 0], part.stream.rows[-1, 0]) for part in positions]
    try:
        return drone_track(_rows(attitudes), _rows(positions), spans)
    except ValueError as error:
        raise GpmfError(str(error)) from error


def _rows(parts: list[_Part]) -> Array:
    return np.concatenate([part.stream.rows for part in parts])
