# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of what moves from pass to pass, such as a multicopter that flies as its controller demands."""

from typing import Any

import numpy as np

from ekf_stub.core.vectors import Quat
from ekf_stub.inputs.measurements import Array, numbers_of
from ekf_stub.inputs.sensors import Sensors
from viso.vehicle.sensors.airframe import Airframe
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
        super().__init__(options, self.airframe)
        self.place = options.home or HOME

    def _shown(self, now_us: int) -> tuple[float, Quat]:
        state = self.airframe.state
        return 0.0 - state.pos[2], state.seen().quat

    def is_at_rest(self, until_us: int) -> bool:
        """Return whether it stands still with its motors off."""
        return self.airframe.is_at_rest()

    def yaw_rad(self) -> float:
        """Return the heading in rad, -pi..pi."""
        return self.airframe.state.rpy[2]

    def truth(self, now_us: int) -> Truth:
        """Return where the vehicle is, as of the last pass."""
        return self.airframe.truth()
