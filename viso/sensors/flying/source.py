# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of a multicopter that flies as its controller demands."""

from collections import deque
from typing import Final

import numpy as np

from ekf_stub.inputs.inertial import Array, InertialDelta, numbers_of
from ekf_stub.inputs.sensors import Sensors
from viso.sensors.flying.airframe import MOTORS_OFF, AirframeState, Demand, moved
from viso.sensors.options import ImuOptions, UnmovedSource
from viso.sensors.script.script import Truth, delta_between
from viso.sensors.vectors import Three

NOMINAL_US: Final = 2500
LONGEST_STEP_US: Final = 5000
LONGEST_US: Final = 100_000
"""An interval between two passes counts as no longer: the vehicle stood still while its computer did."""


class FlyingSource(UnmovedSource):
    """Sensors of an airframe, which stands on the ground until somebody demands a thrust.

    ``state`` is where it really is, as of the last pass.
    """

    def __init__(self, options: ImuOptions) -> None:
        super().__init__(options)
        self.state = AirframeState(rpy=(0.0, 0.0, options.heading_rad))
        self._demand = MOTORS_OFF
        self._last_us: int | None = None
        self._coming: deque[tuple[int, AirframeState, InertialDelta]] = deque()
        self._delta = delta_between(self.state.seen(), self.state.seen(), 1e-6 * NOMINAL_US)

    def demand(self, demand: Demand) -> None:
        """Hear what is demanded from now on."""
        if demand != self._demand:
            self._demand = demand
            self._coming.clear()

    def sense(self, now_us: int) -> Sensors | None:
        """Return what the sensors say, or None for a time that has been."""
        if self._last_us is not None and now_us <= self._last_us:
            return None
        self._go_to(now_us)
        if now_us > self._next_reading_us:
            self._read(now_us, 0.0 - self.state.pos[2], self.state.seen().quat)
        return self._model.apply(Sensors(self._delta, self._baro, self._mag))

    def _go_to(self, now_us: int) -> None:
        if self._coming and self._coming[0][0] == now_us:
            _, self.state, self._delta = self._coming.popleft()
        else:
            self._coming.clear()
            self.state, self._delta = self._after(self.state, self._last_us, now_us)
        self._last_us = now_us

    def _after(self, state: AirframeState, last_us: int | None, now_us: int) -> tuple[AirframeState, InertialDelta]:
        interval_us = NOMINAL_US if last_us is None else min(now_us - last_us, LONGEST_US)
        after, steps = state, -(-interval_us // LONGEST_STEP_US)
        for _ in range(steps):
            after = moved(after, self._demand, 1e-6 * interval_us / steps)
        return after, delta_between(state.seen(), after.seen(), 1e-6 * interval_us)

    def ahead(self, times_us: range) -> Array:
        """Return what passes get until the next reading."""
        if self._last_us is None:
            return super().ahead(times_us)
        if self._coming and self._coming[0][0] != times_us[0]:
            self._coming.clear()
        times_us = times_us[: len(range(times_us.start, self._next_reading_us + 1, times_us.step))]
        last_us, state = (self._last_us, self.state) if not self._coming else self._coming[-1][:2]
        for time_us in times_us[len(self._coming) :]:
            state, delta = self._after(state, last_us, time_us)
            self._coming.append((time_us, state, delta))
            last_us = time_us
        rows = [numbers_of(delta) for _, (_, _, delta) in zip(times_us, self._coming, strict=False)]
        return self._model.ahead(np.array(rows)) if rows else super().ahead(times_us)

    def pass_over(self, times_us: range) -> None:
        """Leave out passes that got what ``ahead`` had said."""
        for time_us in times_us:
            self._go_to(time_us)
        self._model.pass_over(len(times_us))

    def is_at_rest(self, until_us: int) -> bool:
        """Return whether it stands still with its motors off."""
        return self.state.is_at_rest() and not self._demand.thrust_m_s2

    def yaw_rad(self) -> float:
        """Return the heading in rad, -pi..pi."""
        return self.state.rpy[2]

    def felt(self) -> tuple[Three, Three]:
        """Return what ideal inertial sensors said in the last pass: m/s/s and rad/s, body (FRD)."""
        force, rates = self._delta.del_vel / self._delta.del_vel_dt, self._delta.del_ang / self._delta.del_ang_dt
        return (*force.tolist(),), (*rates.tolist(),)

    def truth(self) -> Truth:
        """Return where the vehicle really is, as of the last pass."""
        quat = self.state.seen().quat
        return Truth(self.state.pos, self.state.vel, (quat.w, quat.x, quat.y, quat.z))
