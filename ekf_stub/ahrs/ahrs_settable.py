# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An AHRS whose answers are set, and which keeps the calls that it gets: for tests and recorded scenarios."""

from dataclasses import dataclass, field

import numpy as np

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f


@dataclass(frozen=True, slots=True)
class ExtNav:
    """One call of writeExtNavData: metres NED, errors in m and rad, times in ms since boot."""

    pos: Vector3f
    quat: Quaternion
    posErr: np.float32
    angErr: np.float32
    timeStamp_ms: int
    delay_ms: int
    resetTime_ms: int


@dataclass(frozen=True, slots=True)
class ExtNavVel:
    """One call of writeExtNavVelData: m/s NED, times in ms since boot."""

    vel: Vector3f
    err: np.float32
    timeStamp_ms: int
    delay_ms: int


@dataclass(frozen=True, slots=True)
class BodyFrameOdom:
    """One call of writeBodyFrameOdom: m, rad, seconds, times in ms since boot."""

    quality: np.float32
    delPos: Vector3f
    delAng: Vector3f
    delTime: np.float32
    timeStamp_ms: int
    delay_ms: int
    posOffset: Vector3f


ExtNavCall = ExtNav | ExtNavVel | BodyFrameOdom


@dataclass(slots=True)
class RememberedCalls:
    """The write calls of an AHRS, each appended to ``calls``."""

    calls: list[ExtNavCall] = field(default_factory=list)

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
        """Remember the call."""
        self.calls.append(ExtNav(pos, quat, posErr, angErr, timeStamp_ms, delay_ms, resetTime_ms))

    def writeExtNavVelData(self, vel: Vector3f, err: np.float32, timeStamp_ms: int, delay_ms: int) -> None:
        """Remember the call."""
        self.calls.append(ExtNavVel(vel, err, timeStamp_ms, delay_ms))

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
        """Remember the call."""
        self.calls.append(BodyFrameOdom(quality, delPos, delAng, delTime, timeStamp_ms, delay_ms, posOffset))


@dataclass(slots=True)
class SettableAhrs(RememberedCalls):
    """Every answer is an attribute; every write call is remembered.

    ``yaw`` is in radians, ``pos`` in metres NED from the EKF origin.
    """

    is_initialised: bool = False
    is_dcm_yaw_initialised: bool = False
    is_using_extnav_for_yaw: bool = False
    yaw: np.float32 = field(default_factory=lambda: f32(0))
    quat: Quaternion | None = None
    pos: Vector3f | None = None

    def initialised(self) -> bool:
        """Return ``is_initialised``."""
        return self.is_initialised

    def dcm_yaw_initialised(self) -> bool:
        """Return ``is_dcm_yaw_initialised``."""
        return self.is_dcm_yaw_initialised

    def using_extnav_for_yaw(self) -> bool:
        """Return ``is_using_extnav_for_yaw``."""
        return self.is_using_extnav_for_yaw

    def get_yaw_rad(self) -> np.float32:
        """Return ``yaw``."""
        return self.yaw

    def get_quaternion(self) -> Quaternion | None:
        """Return ``quat``."""
        return self.quat

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return ``pos``."""
        return self.pos
