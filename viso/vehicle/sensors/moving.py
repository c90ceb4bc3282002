# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of what moves from pass to pass, such as a multicopter that flies as its controller demands."""

from dataclasses import replace
from typing import Any

import numpy as np

from ekf_stub.core.vectors import Quat
from ekf_stub.inputs.measurements import Array, BaroReading, ImuReading, first_healthy, numbers_of, row_of
from ekf_stub.inputs.sensors import Sensors
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.barometers import simulated_barometers
from viso.vehicle.sensors.imus import calibrated, calibrations_of, deltas_of
from viso.vehicle.sensors.motion import Moving, Truth
from viso.vehicle.sensors.source import HOME, ImuOptions, VehicleSource


class MovingSource(VehicleSource):
    """The sensors of something that moves."""

    def __init__(self, options: ImuOptions, motion: Moving[Any]) -> None:
        super().__init__(options)
        self._motion = motion

    def _shown(self, now_us: int) -> tuple[float, Quat]:
        """Return the height in m and the attitude (body to NED) that barometer and compass show in a pass."""
        raise NotImplementedError

    def sense(self, now_us: int) -> Sensors | None:
        """Return the data of the sensors, or None for a time that has passed."""
        if self._motion.last_us is not None and now_us <= self._motion.last_us:
            return None
        delta = self._motion.go_to(now_us)
        if now_us > self._next_reading_us:
            self._read(now_us, *self._shown(now_us))
        return self._model.apply(Sensors(delta, self._baro, self._mag, self._declination))

    def ahead(self, times_us: range) -> Array:
        """Return what passes get until the next reading."""
        times_us = times_us[: len(range(times_us.start, self._next_reading_us + 1, times_us.step))]
        if self._motion.last_us is None or not times_us:
            return super().ahead(times_us)
        return self._model.ahead(np.array([numbers_of(delta) for delta in self._motion.ahead(times_us)]))

    def pass_over(self, times_us: range) -> None:
        """Skip passes that got the data of ``ahead``."""
        for time_us in times_us:
            self._motion.go_to(time_us)
        self._model.pass_over(len(times_us))


class FlyingSource(MovingSource):
    """Sensors of an airframe."""

    airframe: Airframe

    def __init__(self, options: ImuOptions) -> None:
        self.airframe = Airframe(options.heading_rad)
        params = options.params
        self._calibrations = calibrations_of(params) if params is not None and options.with_each_imu else None
        imus = options.errors.imus if self._calibrations is None else float(len(self._calibrations()))
        super().__init__(replace(options, errors=replace(options.errors, imus=imus)), self.airframe)
        self._barometers = None if params is None else simulated_barometers(params, options.seed)
        self._baros: tuple[BaroReading, ...] = ()
        self._baro_read_ms = -1
        self.place = options.home or HOME

    def _shown(self, now_us: int) -> tuple[float, Quat]:
        state = self.airframe.state
        return 0.0 - state.pos[2], state.seen().quat

    def sense(self, now_us: int) -> Sensors | None:
        """Return the data of the sensors, or None for a time that has passed."""
        sensors = super().sense(now_us)
        return None if sensors is None else self._with_each_baro(self._with_each_imu(sensors))

    def _with_each_imu(self, sensors: Sensors) -> Sensors:
        if self._calibrations is None:
            return sensors
        measured = [row_of(reading.delta) for reading in sensors.imus or (ImuReading(sensors.delta),)]
        first, *others = deltas_of(calibrated(np.hstack(measured)[np.newaxis], self._calibrations())[0])
        return replace(sensors, delta=first, imus=tuple(map(ImuReading, (first, *others))))

    def _with_each_baro(self, sensors: Sensors) -> Sensors:
        if self._barometers is None or sensors.baro is None:
            return sensors
        time_ms, height_m = sensors.baro
        if time_ms != self._baro_read_ms:
            self._baro_read_ms = time_ms
            self._baros = tuple(barometer.read(time_ms, height_m) for barometer in self._barometers)
        primary = self._baros[first_healthy(self._baros)].timed_height if self._baros else None
        return replace(sensors, baro=primary, baros=self._baros)

    def ahead(self, times_us: range) -> Array:
        """Return what passes get until the next reading."""
        rows = super().ahead(times_us)
        return rows if self._calibrations is None or not len(rows) else calibrated(rows, self._calibrations())

    def is_at_rest(self, until_us: int) -> bool:
        """Return whether it stands still with its motors off."""
        return self.airframe.is_at_rest()

    def yaw_rad(self) -> float:
        """Return the heading in rad, -pi..pi."""
        return self.airframe.state.rpy[2]

    def truth(self, now_us: int) -> Truth:
        """Return where the vehicle is, as of the last pass."""
        return self.airframe.truth()
