# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that stands still: only gravity is felt, and the height stays 0."""

from typing import Final

import numpy as np

from ap_core.location import Location
from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import Quat, quat_of_euler, scaled
from ekf_stub.inputs.measurements import Array, InertialDelta, row_of
from ekf_stub.inputs.sensors import Sensors
from viso.vehicle.sensors.errors import exact_delta
from viso.vehicle.sensors.source import PERIOD_US, ImuOptions, VehicleSource, ideal_field, last_reading_us
from viso.vehicle.sensors.vectors import ZERO, Three, to_body

NOMINAL_US: Final = 2500
SHORTEST_US: Final = NOMINAL_US // 4
LONGEST_US: Final = 4 * NOMINAL_US
MOST_AHEAD: Final = 40


class BenchSource(VehicleSource):
    """Sensors at rest, with a heading; level by default.

    Args:
        options: heading, compass and errors.
        roll_rad, pitch_rad: how the vehicle stands.
    """

    stands_for_ever = True

    def __init__(self, options: ImuOptions, *, roll_rad: float = 0.0, pitch_rad: float = 0.0) -> None:
        super().__init__(options)
        quat = self._quat = quat_of_euler(roll_rad, pitch_rad, options.heading_rad)
        self._accel = to_body(quat, (0.0, 0.0, -GRAVITY_MSS))
        self._quat = quat
        self._field = ideal_field(self.place, quat)
        self._last_us: int | None = None
        self._dt_us = NOMINAL_US
        self._delta = self._move_on(NOMINAL_US)
        self._rows = np.tile(row_of(self._delta), (MOST_AHEAD, 1))
        self._ideal = self._sense_anew(0)

    def stand_at(self, origin: Location) -> None:
        """Let the compass know the origin's declination, and stand there unless a home is given."""
        super().stand_at(origin)
        self._field = ideal_field(self.place, self._quat)

    def sense(self, now_us: int) -> Sensors | None:
        """Return the data of the sensors, or None for a time that has passed."""
        dt_us = NOMINAL_US if self._last_us is None else now_us - self._last_us
        if dt_us <= 0:
            return None
        self._last_us = now_us
        if dt_us != self._dt_us:
            self._dt_us, self._delta = dt_us, self._move_on(dt_us)
            self._rows = np.tile(row_of(self._delta), (MOST_AHEAD, 1))
            self._ideal = self._sense_anew(now_us)
        elif now_us > self._next_reading_us:
            self._ideal = self._sense_anew(now_us)
        return self._model.apply(self._ideal)

    def ahead(self, times_us: range) -> Array:
        """Return what passes get until the next reading, if they are evenly spaced."""
        follows = self._last_us is not None and times_us[0] - self._last_us == self._dt_us == times_us.step
        if not follows:
            return super().ahead(times_us)
        until_us = min(times_us.stop, self._next_reading_us + 1)
        return self._model.ahead(self._rows[: len(range(times_us.start, until_us, times_us.step))])

    def pass_over(self, times_us: range) -> None:
        """Skip passes that got the data of ``ahead``."""
        self._last_us = times_us[-1]
        self._model.pass_over(len(times_us))

    def _move_on(self, dt_us: int) -> InertialDelta:
        dt = 1e-6 * max(SHORTEST_US, min(dt_us, LONGEST_US))
        return exact_delta(scaled(self._accel, dt), (0.0, 0.0, 0.0), dt)

    def _sense_anew(self, now_us: int) -> Sensors:
        reading_us = last_reading_us(now_us)
        if reading_us is None:
            return Sensors(self._delta)
        self._next_reading_us = reading_us + PERIOD_US
        mag = (reading_us, self._field) if self._options.has_compass() else None
        return Sensors(self._delta, (reading_us // 1000, 0.0), mag, self._declination)

    def truth(self, now_us: int) -> tuple[Three, Three, Quat]:
        """Return where the vehicle stands."""
        return ZERO, ZERO, self._quat

    def yaw_rad(self) -> float:
        """Return the heading in rad."""
        return self._options.heading_rad
