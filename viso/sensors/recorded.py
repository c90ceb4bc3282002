# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of a log with replay records, played at the log's times since boot.

The log has each pass of its main loop (RFRH to RFRF), and inertial data (RISI), height (RBRI), magnetic field (RMGI)
and declination (RMGH) where they differ from the pass before.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.inertial import Array, InertialDelta, quat_of_rotation, rotation_of_quat
from ekf_stub.inputs.sensors import Sensors
from viso.errors import InputError
from viso.logs.recorded import read_log
from viso.sensors.attitude import rotate_to_body
from viso.sensors.errors import to_single
from viso.sensors.options import ImuOptions, UnmovedSource

_INSTANCE: Final = 0
_RECORDS: Final = ("RFRH", "RFRF", "RISI", "RBRI", "RMGI", "RMGH", "ATT")


class SlowSensors(NamedTuple):
    """What holds over many passes: as in ``Sensors``, and the yaw of the log's own estimate in rad."""

    baro: tuple[int, float] | None = None
    mag: tuple[int, Array] | None = None
    declination: float = 0.0
    yaw_rad: float | None = None


class Recording(NamedTuple):
    """The passes of a log's main loop.

    Attributes:
        time_us: since boot, growing.
        deltas: shape (n, 8): change of velocity (m/s) and rotation (rad) by axis, body, and the seconds of each.
        slow: the other sensors.
    """

    time_us: Sequence[int]
    deltas: Array
    slow: Sequence[SlowSensors]


class _Reader:
    """Takes records in the order of the log; what is not there again holds."""

    def __init__(self) -> None:
        self.time_us: list[int] = []
        self.deltas: list[tuple[float, ...]] = []
        self.slow: list[SlowSensors] = []
        self._now_us = -1
        self._delta: tuple[float, ...] | None = None
        self._slow = SlowSensors()

    def take(self, record: Any) -> None:
        if getattr(record, "I", _INSTANCE) == _INSTANCE:
            getattr(self, f"_take_{record.get_type().lower()}")(record)

    def _take_rfrh(self, record: Any) -> None:
        self._now_us = record.TimeUS

    def _take_rfrf(self, _record: Any) -> None:
        if self._delta is not None and (not self.time_us or self._now_us > self.time_us[-1]):
            self.time_us.append(self._now_us)
            self.deltas.append(self._delta)
            self.slow.append(self._slow)

    def _take_risi(self, record: Any) -> None:
        delta = (record.DVX, record.DVY, record.DVZ, record.DAX, record.DAY, record.DAZ, record.DVDT, record.DADT)
        if all(map(math.isfinite, delta)):
            self._delta = delta

    def _take_rbri(self, record: Any) -> None:
        if math.isfinite(record.Alt):
            self._slow = self._slow._replace(baro=(record.LastUpdate, record.Alt))

    def _take_rmgi(self, record: Any) -> None:
        field_mgauss = np.array([record.FX, record.FY, record.FZ])
        if np.isfinite(field_mgauss).all():
            self._slow = self._slow._replace(mag=(record.LU, field_mgauss))

    def _take_rmgh(self, record: Any) -> None:
        if math.isfinite(record.Dec):
            self._slow = self._slow._replace(declination=record.Dec)

    def _take_att(self, record: Any) -> None:
        if math.isfinite(record.Yaw):
            self._slow = self._slow._replace(yaw_rad=math.remainder(math.radians(record.Yaw), 2.0 * math.pi))


def read_recording(path: Path) -> Recording:
    """Return what the sensors of a log said. Raises InputError if it cannot be read, or has no replay records."""

    def collect(log: Any) -> _Reader:
        reader = _Reader()
        while (record := log.recv_match(type=list(_RECORDS))) is not None:
            reader.take(record)
        return reader

    reader = read_log(path, collect)
    if not reader.time_us:
        raise InputError(f"{path}: holds no inertial data (RFRH, RISI, RFRF); LOG_REPLAY was off")
    return Recording(reader.time_us, np.array(reader.deltas), reader.slow)


class RecordedSource(UnmovedSource):
    """Sensors that say what they said in a log, at the same times since boot.

    A pass gets what the log's passes since the last one add up to; without any, as before the log's first and after
    its last, there is nothing.
    """

    def __init__(self, options: ImuOptions, recording: Recording) -> None:
        super().__init__(options)
        self._recording = recording
        self._next: int | None = None
        self._yaw_rad = options.heading_rad

    def sense(self, now_us: int) -> Sensors | None:
        """Return what the sensors said since the last pass, or None if the log has nothing."""
        time_us, deltas, slow = self._recording
        end = start = self._next or 0
        while end < len(time_us) and time_us[end] <= now_us:
            end += 1
        if self._next is None:
            start = max(end - 1, 0)  # what was before the first pass is over
        self._next = end
        if start == end:
            return None
        baro, mag, declination, yaw_rad = slow[end - 1]
        if yaw_rad is not None:
            self._yaw_rad = yaw_rad
        mag = mag if self._options.has_compass() else None
        return self._model.apply(Sensors(_sum_of(deltas[start:end]), baro, mag, declination))

    def is_at_rest(self, until_us: int) -> bool:
        """Tell whether the log says nothing from now until a time since boot."""
        time_us = self._recording.time_us
        return (self._next or 0) == len(time_us) or time_us[self._next or 0] > until_us

    def yaw_rad(self) -> float:
        """Return the newest yaw of the log's own estimate (ATT) in rad, -pi..pi; without any, the heading given."""
        return self._yaw_rad


def _sum_of(deltas: Array) -> InertialDelta:
    """Add up inertial data of passes, so that the filter gets from the sum what it would have got from the parts.

    That takes a change of velocity to be in the body frame at the end of its pass.
    """
    if len(deltas) == 1:
        (numbers,) = deltas
        return InertialDelta(numbers[:3], numbers[3:6], float(numbers[6]), float(numbers[7]))
    turned, del_vel = quaternion.one, np.zeros(3)
    for delta in deltas:
        turn = quat_of_rotation(delta[3:6])
        turned, del_vel = turned * turn, rotate_to_body(turn, del_vel) + delta[:3]
    vel_dt, ang_dt = to_single(deltas[:, 6:].sum(axis=0))
    return InertialDelta(to_single(del_vel), to_single(rotation_of_quat(turned)), float(vel_dt), float(ang_dt))


def read_recorded_source(argument: str) -> Callable[[ImuOptions], RecordedSource]:
    """Return what makes sources from a log. Raises InputError if the log cannot be used."""
    recording = read_recording(Path(argument))
    return lambda options: RecordedSource(options, recording)
