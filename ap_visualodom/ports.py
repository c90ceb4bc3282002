# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface that AP_VisualOdom needs from the AHRS; those of the GCS and the logger are in ``ap_core.sinks``.

The firmware uses singletons (AP::ahrs(), gcs(), AP::logger()); here they are constructor arguments. Method names are
the firmware's.
"""

from typing import Protocol

import numpy as np

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f


class Ahrs(Protocol):
    """The part of AP_AHRS that external navigation uses. Attitudes map body (FRD) to earth (NED)."""

    def initialised(self) -> bool:
        """Return whether the estimator has been running for its settling time."""

    def dcm_yaw_initialised(self) -> bool:
        """Return whether DCM has had a yaw reference."""

    def using_extnav_for_yaw(self) -> bool:
        """Return whether the active estimator takes its yaw from external navigation."""

    def get_yaw_rad(self) -> np.float32:
        """Return the vehicle's yaw in radians, -pi..pi."""

    def get_quaternion(self) -> Quaternion | None:
        """Return the vehicle's attitude, or None while there is none."""

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the position in metres NED from the EKF origin, or None while there is none."""

    def writeExtNavData(
        self,
        pos: Vector3f,
        quat: Quaternion,
        posErr: np.float32,
        angErr: np.float32,
        timeStamp_ms: int,
        delay_ms: int,
        resetTime_ms: int,
    ) -> None:
        """Use a position (m, NED), an attitude and their errors (m, rad); times in ms since boot."""

    def writeExtNavVelData(self, vel: Vector3f, err: np.float32, timeStamp_ms: int, delay_ms: int) -> None:
        """Use a velocity (m/s, NED) and its error (m/s)."""

    def writeBodyFrameOdom(
        self,
        quality: np.float32,
        delPos: Vector3f,
        delAng: Vector3f,
        delTime: np.float32,
        timeStamp_ms: int,
        delay_ms: int,
        posOffset: Vector3f,
    ) -> None:
        """Use a change of position (m) and angle (rad) in the body frame over ``delTime`` seconds."""
