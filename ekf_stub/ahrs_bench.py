# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stationary vehicle, level, with a given heading."""

from collections.abc import Callable

import numpy as np

from ap_core.clock import Clock
from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.ext_nav_log import ExtNavLog
from ekf_stub.sources import EkfSources


class BenchAhrs(AhrsBase):
    """The AHRS of a vehicle on the bench: it stands at the EKF origin and does not follow what it is given.

    Args:
        heading_rad: the vehicle's true yaw.
        has_compass: tells whether a compass is in use; without one DCM's yaw is never initialised.
    """

    def __init__(
        self,
        clock: Clock,
        sources: EkfSources,
        log: ExtNavLog,
        *,
        heading_rad: float = 0.0,
        has_compass: Callable[[], bool] = lambda: True,
        start_us: int = AHRS_START_US,
    ) -> None:
        super().__init__(clock, sources, log, start_us=start_us)
        self._yaw = f32(heading_rad)
        self._quat = Quaternion.from_euler(f32(0), f32(0), self._yaw)
        self._has_compass = has_compass

    def dcm_yaw_initialised(self) -> bool:
        """Tell whether there has been a compass heading."""
        return self.started() and self._has_compass()

    def get_yaw_rad(self) -> np.float32:
        """Return the given heading."""
        return self._yaw

    def get_quaternion(self) -> Quaternion | None:
        """Return the level attitude, once the AHRS runs."""
        return self._quat if self.started() else None

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return zero, once the estimator has settled."""
        return Vector3f() if self.initialised() else None
