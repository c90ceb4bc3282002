# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Log records of one sample (AP_VisualOdom/AP_VisualOdom_Logging.cpp)."""

import numpy as np

from ap_core.clock import Clock
from ap_core.sinks import RecordSink
from ap_core.vector3 import Vector3f
from ap_visualodom.log_structure import VISO, VISP, VISV


class AP_VisualOdom_Logging:
    """Writes the VISO, VISP and VISV records of a backend, stamped with the time of writing."""

    def __init__(self, logger: RecordSink, clock: Clock) -> None:
        self._logger = logger
        self._clock = clock

    def Write_VisualOdom(
        self,
        time_delta: np.float32,
        angle_delta: Vector3f,
        position_delta: Vector3f,
        confidence: np.float32,
    ) -> None:
        """Write VISO: seconds, radians, metres, confidence 0..100 (AP_VisualOdom_Backend::Write_VisualOdom)."""
        self._logger.write(
            VISO,
            (
                self._clock.micros64(),
                time_delta,
                *angle_delta.to_tuple(),
                *position_delta.to_tuple(),
                confidence,
            ),
        )

    def Write_VisualPosition(
        self,
        remote_time_us: int,
        time_ms: int,
        pos: Vector3f,
        euler_deg: tuple[np.float32, np.float32, np.float32],
        pos_err: np.float32,
        ang_err: np.float32,
        reset_counter: int,
        ignored: bool,
        quality: int,
    ) -> None:
        """Write VISP: metres NED, degrees, errors in m and rad (AP_VisualOdom_Backend::Write_VisualPosition)."""
        self._logger.write(
            VISP,
            (
                self._clock.micros64(),
                remote_time_us,
                time_ms,
                pos.x,
                pos.y,
                pos.z,
                *euler_deg,
                pos_err,
                ang_err,
                reset_counter,
                int(ignored),
                quality,
            ),
        )

    def Write_VisualVelocity(
        self,
        remote_time_us: int,
        time_ms: int,
        vel: Vector3f,
        vel_err: np.float32,
        reset_counter: int,
        ignored: bool,
        quality: int,
    ) -> None:
        """Write VISV: m/s NED (AP_VisualOdom_Backend::Write_VisualVelocity)."""
        self._logger.write(
            VISV,
            (
                self._clock.micros64(),
                remote_time_us,
                time_ms,
                vel.x,
                vel.y,
                vel.z,
                vel_err,
                reset_counter,
                int(ignored),
                quality,
            ),
        )
