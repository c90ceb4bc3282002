# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of a log, played at the log's times since boot."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from ap_core.clock import NEVER
from ap_core.dataflash_columns import LogColumns
from ekf_stub.core.vectors import ONE, ZERO, add, conjugate, rotated, times
from ekf_stub.inputs.measurements import Array, GpsSample, ImuReading, InertialDelta
from ekf_stub.inputs.sensors import Sensors
from viso.errors import InputError
from viso.logs.recorded import read_columns
from viso.vehicle.sensors.errors import to_single
from viso.vehicle.sensors.flight import Basis, Event, Flight, Happening, chosen
from viso.vehicle.sensors.flown.estimates import estimates
from viso.vehicle.sensors.flown.events import events_of
from viso.vehicle.sensors.flown.imu_records import imu_records
from viso.vehicle.sensors.flown.replay_records import replay_records
from viso.vehicle.sensors.source import ImuOptions, VehicleSource
from viso.vehicle.sensors.vectors import rotation_vector, turned

READERS: Final[Mapping[Basis, Callable[[LogColumns, int], Flight | None]]] = MappingProxyType(
    {Basis.REPLAY: replay_records, Basis.IMU: imu_records, Basis.ESTIMATE: estimates}
)
"""What makes a flight of a log and the number of a lane, the best first; None where the log lacks what is needed."""

_OF_MOTION: Final = ("IMU", "ATT", "XKF1", "POS")


def lane_in_use(log: LogColumns) -> int:
    """Return the lane by which the vehicle navigated for the longest time while it was armed."""
    lanes, _ = chosen(log, "XKF4", ["TimeUS", "PI"])
    switches = [event for event in events_of(log) if event.what in (Happening.ARMED, Happening.DISARMED)]
    latest = np.searchsorted([event.time_us for event in switches], lanes[:, 0], side="right")
    armed = np.array([False, *(event.what is Happening.ARMED for event in switches)])[latest]
    used = lanes[armed if armed.any() else slice(None), 1].astype(int)
    return int(np.bincount(np.maximum(used, 0)).argmax()) if len(used) else 0


def read_flight(path: Path) -> Flight:
    """Return the flight of a log. Raises InputError if it cannot be read, or has no motion."""
    log = read_columns(path)
    lane = lane_in_use(log)
    for reader in READERS.values():
        flight = reader(log, lane)
        if flight is not None:
            return flight
    counts = ", ".join(f"{log.counts[kind]} {kind}" for kind in _OF_MOTION if log.counts.get(kind))
    if counts:
        raise InputError(f"{path}: too short to fly: {counts}, and 50 ATT with as many XKF1 or POS are the fewest")
    raise InputError(f"{path}: no motion to fly: neither replay records, nor IMU, nor ATT with XKF1 or POS")


class RecordedSource(VehicleSource):
    """Sensors with the data of a log, at the same times since boot.

    A pass gets what the log's passes since the last one add up to; without any, as before the log's first and after
    its last, there is nothing.
    """

    has_recorded_heights = True

    flight: Flight

    def __init__(self, options: ImuOptions, flight: Flight) -> None:
        super().__init__(options)
        self.flight = flight
        self._times_us = flight.time_us.tolist()
        self._next: int | None = None
        self._next_event = 0
        self._yaw_rad = options.heading_rad
        self._gps: GpsSample | None = None
        self._expected: tuple[bool, bool] | None = None
        told = flight.baro, flight.mag, flight.declination, flight.gps, flight.expected
        newest = np.array([one.newest for one in told if one is not None])
        has_no_reading = (np.diff(newest, axis=1, prepend=-2) == 0).all(axis=0)
        self._alike: list[bool] = has_no_reading.tolist()

    def sense(self, now_us: int) -> Sensors | None:
        """Return the data of the sensors since the last pass, or None if the log has none."""
        times_us, flight = self._times_us, self.flight
        end = start = self._next or 0
        while end < len(times_us) and times_us[end] <= now_us:
            end += 1
        if self._next is None:
            start = max(end - 1, 0)  # what was before the first pass is over
        self._next = end
        if start == end:
            return None
        newest = end - 1
        yaw_rad, self._gps = flight.yaw_rad.at(newest), flight.gps.at(newest)
        if yaw_rad is not None:
            self._yaw_rad = yaw_rad
        if flight.expected is not None:
            self._expected = flight.expected.at(newest)
        mag = flight.mag.at(newest) if self._options.has_compass() else None
        declination = flight.declination.at(newest) or 0.0
        imus = tuple(
            ImuReading(_sum_of(deltas[start:end]), bool(has_gyro[newest]), bool(has_accel[newest]))
            for deltas, has_gyro, has_accel in flight.imus
        )
        delta = imus[0].delta if imus else _sum_of(flight.deltas[start:end])
        return self._model.apply(Sensors(delta, flight.baro.at(newest), mag, declination, imus))

    def ahead(self, times_us: range) -> Array:
        """Return what passes get of which each has one of the log's, up to a reading that differs."""
        start = self._next
        if start is None or self.flight.imus or not self._model.is_ideal:
            return super().ahead(times_us)
        end, log_us, alike = start, self._times_us, self._alike  # some four passes, for which arrays take longer
        last = len(log_us) - 1
        for now_us in times_us:
            if end >= last or not (alike[end] and log_us[end] <= now_us < log_us[end + 1]):
                break
            end += 1
        return self.flight.deltas[start:end]

    def pass_over(self, times_us: range) -> None:
        """Skip passes that got the data of ``ahead``."""
        self._next = (self._next or 0) + len(times_us)
        yaw_rad = self.flight.yaw_rad.at(self._next - 1)
        if yaw_rad is not None:
            self._yaw_rad = yaw_rad

    def is_at_rest(self, until_us: int) -> bool:
        """Return whether the log has no data from now until a time since boot."""
        times_us = self._times_us
        return (self._next or 0) == len(times_us) or times_us[self._next or 0] > until_us

    def yaw_rad(self) -> float:
        """Return the newest yaw of the log's own estimate (ATT) in rad, -pi..pi; without any, the heading given."""
        return self._yaw_rad

    def gps(self) -> GpsSample | None:
        """Return the newest solution of the log's GPS; None without one."""
        return self._gps

    def next_event_us(self) -> int:
        """Return when something happens next, in us since boot."""
        events = self.flight.events
        return events[self._next_event].time_us if self._next_event < len(events) else NEVER

    def expected(self) -> tuple[bool, bool] | None:
        """Return whether a take-off is expected, and whether a touchdown is; None of a log that does not have them."""
        return self._expected

    def events_until(self, now_us: int) -> Iterator[Event]:
        """Yield what has happened since the last call, up to a time."""
        events = self.flight.events
        while self._next_event < len(events) and events[self._next_event].time_us <= now_us:
            self._next_event += 1
            yield events[self._next_event - 1]


def _sum_of(deltas: Array) -> InertialDelta:
    """Add up inertial data of passes, so that the filter gets from the sum what it would have got from the parts.

    That takes a change of velocity to be in the body frame at the end of its pass.
    """
    if len(deltas) == 1:
        (numbers,) = deltas
        return InertialDelta(numbers[:3], numbers[3:6], float(numbers[6]), float(numbers[7]))
    attitude, del_vel = ONE, ZERO
    for vx, vy, vz, x, y, z, *_ in deltas.tolist():
        turn = turned(ONE, (x, y, z))
        attitude, del_vel = times(attitude, turn), add(rotated(conjugate(turn), del_vel), (vx, vy, vz))
    vel_dt, ang_dt = to_single(deltas[:, 6:].sum(axis=0))
    return InertialDelta(to_single(del_vel), to_single(rotation_vector(attitude)), float(vel_dt), float(ang_dt))


def read_recorded_source(argument: str) -> Callable[[ImuOptions], RecordedSource]:
    """Return what makes sources from a log. Raises InputError if the log cannot be used."""
    flight = read_flight(Path(argument))
    return lambda options: RecordedSource(options, flight)
