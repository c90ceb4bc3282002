# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs the inputs of the estimator from outside, before it judges them (AP_DAL/AP_DAL.cpp, AP_DAL_VisualOdom.cpp)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ap_core.cint import u16, u32
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.sinks import RecordSink
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import FlowMeasurement
from ekf_stub.log.replay_log_structure import RBOH, REPH, REVH, ROFH, RVOH

_UNFILLED: Final = (*(np.float32(0),) * 3, 0)
_NO_HEIGHT: Final = 0.0  # FLOW_HGT_OVR, which rovers have

_Values = Callable[..., tuple[LogValue, ...]]
"""Returns the values of a record for an input."""


@dataclass(frozen=True, slots=True)
class VisualOdomFrame:
    """The camera in one frame of the estimator: position (m, FRD), delay (ms), health, whether enabled."""

    pos_offset: Vector3f
    delay_ms: int
    healthy: bool
    enabled: bool


class ExtNavLog:
    """Writes RVOH, ROFH, REPH, REVH and RBOH, each only when it differs from the one before.

    Nothing is written before the estimator's first frame, nor between the opening of a log and the next frame
    (AP_DAL::start_frame, AP_DAL::WriteLogMessage).

    Args:
        enabled: says whether replay records are wanted (LOG_REPLAY).
        fills_odometry: RBOH has the camera's place and delay; else they are 0 there.
    """

    def __init__(self, logger: RecordSink, enabled: Callable[[], bool], *, fills_odometry: bool = False) -> None:
        self._logger = logger
        self._enabled = enabled
        self._fills_odometry = fills_odometry
        self._last: dict[tuple[str, int], bytes | tuple[_Values, tuple[Any, ...]]] = {}
        self._in_frames = False
        self._awaits_camera = False
        self._is_first = False
        self._camera: VisualOdomFrame | None = None
        self._has_camera: bool | None = None

    @property
    def is_wanted(self) -> bool:
        """Whether replay records are wanted, of every frame."""
        return self._enabled()

    def new_log(self) -> None:
        """Restart with the next frame, as another log begins."""
        self._in_frames = False

    def _write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        if self._in_frames and self._enabled():
            self._logger.write(structure, values)

    def _write_changed(self, structure: LogStructure, values_of: _Values, *given: Any, force: bool = False) -> None:
        key = structure.name, 0
        if not force and not (self._in_frames and self._enabled()):
            self._last[key] = values_of, given  # which may never be needed
            return
        values = values_of(*given)
        payload = structure.pack(values)
        last = self._last.get(key)
        if isinstance(last, tuple):
            before_of, before = last
            last = structure.pack(before_of(*before))
        if force or last != payload:
            self._last[key] = payload
            self._write(structure, values)

    def _begin_frame(self, *, is_first: bool) -> None:
        self._is_first, self._in_frames = is_first, True

    def _end_frame(self) -> None:
        """Log what ends a frame, here nothing; a call that hands in samples comes after it."""

    def frame(self, frame: VisualOdomFrame) -> None:
        """Log the camera's state in a frame of the estimator, which begins now unless it has already.

        A camera that is not enabled in the first frame is never logged (AP_DAL::init_sensors).
        """
        if self._awaits_camera:
            self._awaits_camera = False
        else:
            self._begin_frame(is_first=not self._in_frames)
        if self._is_first or frame is not self._camera:
            self._take_camera(frame)

    def _take_camera(self, frame: VisualOdomFrame) -> None:
        if self._has_camera is None:
            self._has_camera = frame.enabled
        if self._has_camera and (self._is_first or frame != self._camera):
            self._camera = frame
            self._write_changed(RVOH, _camera_values, frame, force=self._is_first)

    def flow(self, measured: FlowMeasurement, time_ms: int) -> None:
        """Log a call of writeOptFlowMeas: ms since boot; the sensor's place is on the vehicle."""
        self._end_frame()
        self._write_changed(ROFH, _flow_values, measured, time_ms)

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
        self._end_frame()
        self._write_changed(REPH, _pose_values, pos, quat, errors, timeStamp_ms, resetTime_ms, delay_ms)

    def velocity(self, vel: Vector3f, err: np.float32, timeStamp_ms: int, delay_ms: int) -> None:
        """Log a call of writeExtNavVelData: m/s NED, ms since boot."""
        self._end_frame()
        self._write_changed(REVH, _velocity_values, vel, err, timeStamp_ms, delay_ms)

    def body_odometry(
        self,
        quality: np.float32,
        delPos: Vector3f,
        delAng: Vector3f,
        delTime: np.float32,
        timeStamp_ms: int,
        delay_ms: int,
        posOffset: Vector3f,
    ) -> None:
        """Log a call of writeBodyFrameOdom."""
        self._end_frame()
        camera = (*posOffset.to_tuple(), u16(delay_ms)) if self._fills_odometry else _UNFILLED
        self._write_changed(RBOH, _odometry_values, quality, delPos, delAng, delTime, timeStamp_ms, camera)


def _camera_values(frame: VisualOdomFrame) -> tuple[LogValue, ...]:
    return *frame.pos_offset.to_tuple(), u32(frame.delay_ms), int(frame.healthy), int(frame.enabled)


def _flow_values(measured: FlowMeasurement, time_ms: int) -> tuple[LogValue, ...]:
    return *measured.flow, *measured.gyro, time_ms, *measured.offset, _NO_HEIGHT, measured.quality


def _pose_values(
    pos: Vector3f, quat: Quaternion, errors: tuple[np.float32, np.float32], time_ms: int, reset_ms: int, delay_ms: int
) -> tuple[LogValue, ...]:
    return *pos.to_tuple(), *quat.to_wxyz(), *errors, time_ms, reset_ms, u16(delay_ms)


def _velocity_values(vel: Vector3f, err: np.float32, time_ms: int, delay_ms: int) -> tuple[LogValue, ...]:
    return *vel.to_tuple(), err, time_ms, u16(delay_ms)


def _odometry_values(
    quality: np.float32,
    del_pos: Vector3f,
    del_ang: Vector3f,
    del_time: np.float32,
    time_ms: int,
    camera: tuple[LogValue, ...],
) -> tuple[LogValue, ...]:
    return quality, *del_pos.to_tuple(), *del_ang.to_tuple(), del_time, time_ms, *camera
