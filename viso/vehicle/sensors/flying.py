# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of a multicopter that flies as its controller demands."""

from ekf_stub.core.vectors import Quat
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.moving import MovingSource
from viso.vehicle.sensors.options import ImuOptions


class FlyingSource(MovingSource):
    """Sensors of an airframe."""

    airframe: Airframe

    def __init__(self, options: ImuOptions) -> None:
        self.airframe = Airframe(options.heading_rad)
        super().__init__(options, self.airframe)

    def _shown(self, now_us: int) -> tuple[float, Quat]:
        state = self.airframe.state
        return 0.0 - state.pos[2], state.seen().quat

    def is_at_rest(self, until_us: int) -> bool:
        """Return whether it stands still with its motors off."""
        return self.airframe.is_at_rest()

    def yaw_rad(self) -> float:
        """Return the heading in rad, -pi..pi."""
        return self.airframe.state.rpy[2]
