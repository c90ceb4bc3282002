# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs what the estimator is given, before it decides about it (AP_DAL/AP_DAL.cpp, AP_DAL_VisualOdom.cpp)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.cint import u16, u32
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.sinks import RecordSink
from ap_core.vector3 import Vector3f
from ekf_stub.log_structure import RBOH, REPH, REVH, RVOH

_UNFILLED: Final = (np.float32(0),) * 3


@dataclass(frozen=True, slots=True)
class VisualOdomFrame:
    """What the estimator knows of the camera in one frame: position (m, FRD), delay (ms), health, whether enabled."""

    pos_offset: Vector3f
    delay_ms: int
    healthy: bool
    enabled: bool


class ExtNavLog:
    """Writes RVOH, REPH, REVH and RBOH, each only when it differs from the one before.

    Args:
        logger: where the records go.
        enabled: tells whether replay records are wanted (LOG_REPLAY).
    """

    def __init__(self, logger: RecordSink, enabled: Callable[[], bool]) -> None:
        self._logger = logger
        self._enabled = enabled
        self._last: dict[str, bytes] = {}

    def new_log(self) -> None:
        """Forget what was written, as another log begins."""
        self._last.clear()

    def _write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        if not self._enabled():
            return
        payload = structure.pack(values)
        if self._last.get(structure.name) != payload:
            self._last[structure.name] = payload
            self._logger.write(structure, values)

    def frame(self, frame: VisualOdomFrame) -> None:
        """Log the camera's state; the firmware has none to log while it is disabled."""
        if frame.enabled:
            state = (u32(frame.delay_ms), int(frame.healthy), int(frame.enabled))
            self._write(RVOH, (*frame.pos_offset.to_tuple(), *state))

    def pose(
        self,
        pos: Vector3f,
        quat: Quaternion,
        errors: tuple[np.float32, np.float32],
        timeStamp_ms: int,
        delay_ms: int,
        resetTime_ms: int,
    ) -> None:
        """Log a call of writeExtNavData: m NED, attitude, (m, rad), ms since boot."""
        times = timeStamp_ms, resetTime_ms, u16(delay_ms)
        self._write(REPH, (*pos.to_tuple(), *quat.to_wxyz(), *errors, *times))

    def velocity(self, vel: Vector3f, err: np.float32, timeStamp_ms: int, delay_ms: int) -> None:
        """Log a call of writeExtNavVelData: m/s NED, ms since boot."""
        self._write(REVH, (*vel.to_tuple(), err, timeStamp_ms, u16(delay_ms)))

    def body_odometry(
        self, quality: np.float32, delPos: Vector3f, delAng: Vector3f, delTime: np.float32, timeStamp_ms: int
    ) -> None:
        """Log a call of writeBodyFrameOdom; the firmware leaves offset and delay of this record unfilled."""
        deltas = (*delPos.to_tuple(), *delAng.to_tuple(), delTime)
        self._write(RBOH, (quality, *deltas, timeStamp_ms, *_UNFILLED, 0))
