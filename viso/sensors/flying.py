# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of a multicopter that flies as its controller demands."""

import numpy as np

from ekf_stub.inputs.inertial import Array, numbers_of
from ekf_stub.inputs.sensors import Sensors
from viso.sensors.airframe import Airframe
from viso.sensors.options import ImuOptions
from viso.sensors.source import VehicleSource


class FlyingSource(VehicleSource):
    """Sensors of an airframe."""

    airframe: Airframe

    def __init__(self, options: ImuOptions) -> None:
        super().__init__(options)
        self.airframe = Airframe(options.heading_rad)

    def sense(self, now_us: int) -> Sensors | None:
        """Return what the sensors say, or None for a time that has been."""
        airframe = self.airframe
        if airframe.last_us is not None and now_us <= airframe.last_us:
            return None
        delta = airframe.go_to(now_us)
        if now_us > self._next_reading_us:
            self._read(now_us, 0.0 - airframe.state.pos[2], airframe.state.seen().quat)
        return self._model.apply(Sensors(delta, self._baro, self._mag))

    def ahead(self, times_us: range) -> Array:
        """Return what passes get until the next reading."""
        until_us = self._next_reading_us + 1
        times_us = times_us[: len(range(times_us.start, until_us, times_us.step))]
        if self.airframe.last_us is None or not times_us:
            return super().ahead(times_us)
        return self._model.ahead(np.array([numbers_of(delta) for delta in self.airframe.ahead(times_us)]))

    def pass_over(self, times_us: range) -> None:
        """Leave out passes that got what ``ahead`` had said."""
        for time_us in times_us:
            self.airframe.go_to(time_us)
        self._model.pass_over(len(times_us))

    def is_at_rest(self, until_us: int) -> bool:
        """Return whether it stands still with its motors off."""
        return self.airframe.is_at_rest()

    def yaw_rad(self) -> float:
        """Return the heading in rad, -pi..pi."""
        return self.airframe.state.rpy[2]
