# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared parts of all sources of recorded data."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from viso.companion.vio.calibration import CalibrationError, load_calibration
from viso.companion.vio.config import VioConfig
from viso.companion.vio.frames import FLU_TO_FRD
from viso.companion.vio.types import (
    CameraCalibration,
    ImuBias,
    ImuSample,
    NavCameraFrame,
    Pixels,
    SensorEvent,
    WarmStartPose,
    frame_uuid,
)
from viso.geometry.frame_change import axes_matrix
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, inverse, product, quat_wxyz_from_rotation
from viso.geometry.trajectory import Trajectory

LEAD_NS: Final = 100_000_000
"""The time before the first frame from which on inertial data are used."""


class SourceError(Exception):
    """A source that cannot be used; the text is one line with the file and the reason."""

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.split()))


@dataclass(frozen=True, slots=True, eq=False)
class SourceOptions:
    """The name of a source, and how to read it.

    Attributes:
        name: a file, a folder, a device or another name that a kind of source accepts.
        calibration, imu: files of the camera's and with inertial data; None for those that the source contains.
        imu_start_s: time of that file at which the pictures begin.
        fps: frames to use per second; None for all.
        imu_axes: directions of the IMU's x, y and z, such as FLU; None for the default of the kind of source.
        mounting: [3, 3], what is left to turn, from FRD axes as the letters say to the vehicle's; None for nothing.
    """

    name: str
    calibration: Path | None = None
    imu: Path | None = None
    imu_start_s: float = 0.0
    fps: float | None = None
    imu_axes: str | None = None
    mounting: Array | None = None

    def load_calibration(self) -> CameraCalibration | None:
        """Return the calibration that was given, or None. Raises SourceError if the file is none."""
        try:
            return None if self.calibration is None else load_calibration(self.calibration)
        except CalibrationError as error:
            raise SourceError(str(error)) from error


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Data of a flight that can be replayed any number of times; the body is FLU, the world ENU or at least z up.

    Attributes:
        data: yields the data in order of arrival, each time from the start; raises SourceError.
        poses: world_T_body from another source; None if unknown.
        start: the state at the first frame; None if it is not known.
        config: the default configuration for these data.
        world_is_north: whether the world of ``start`` has an absolute yaw.
    """

    calibration: CameraCalibration
    data: Callable[[], Iterator[SensorEvent]]
    poses: Trajectory | None = None
    start: WarmStartPose | None = None
    config: VioConfig = field(default_factory=VioConfig)
    world_is_north: bool = False

    def events(self) -> Iterator[SensorEvent]:
        """Yield the data in the order in which they arrive, from shortly before the first frame on (EventSource)."""
        return _since_first_frame(self.data())

    def turned(self, body_R_imu: Array) -> "Recording":
        """Return the same data in the axes of another body with the same origin."""
        if np.array_equal(body_R_imu, np.eye(3)):
            return self
        to_body = SE3(body_R_imu, np.zeros(3))
        calibration = dataclasses.replace(self.calibration, B_T_C=to_body @ self.calibration.B_T_C)

        def data() -> Iterator[SensorEvent]:
            for event in self.data():
                if isinstance(event, ImuSample):
                    event = ImuSample(event.t_ns, body_R_imu.dot(event.accel), body_R_imu.dot(event.gyro))
                yield event

        poses = self.poses and _turned_poses(self.poses, body_R_imu)
        start = self.start and _turned_start(self.start, to_body)
        return dataclasses.replace(self, calibration=calibration, data=data, poses=poses, start=start)


class Thinning:
    """Limits the frames per second.

    Args:
        fps: the limit; None for all.
        period_ns: between two frames: so much less than half early is early enough.
    """

    def __init__(self, fps: float | None, period_ns: float = 0.0) -> None:
        self._step_ns = 0.0 if fps is None else 1e9 / fps
        self._tolerance_ns = 0.5 * period_ns
        self._due_ns: float | None = None

    def wants(self, t_ns: int) -> bool:
        """Return whether to use the frame of a time, which is later than that of the last call."""
        if self._due_ns is None:
            self._due_ns = t_ns
        if t_ns + self._tolerance_ns < self._due_ns:
            return False
        # A late frame does not bring the later ones closer together.
        self._due_ns = max(self._due_ns, t_ns - self._tolerance_ns) + self._step_ns
        return True


def body_rotation(letters: str, mounting: Array | None = None) -> Array:
    """Return the matrix [3, 3] from an IMU's axes to the body's, of ``imu_axes`` and ``mounting`` of SourceOptions.

    Raises ValueError if the letters are no three perpendicular directions, or make a mirror.
    """
    to_frd = axes_matrix(letters)
    if np.linalg.det(to_frd) < 0:
        raise ValueError(f"{letters!r} are left-handed")
    rotation: Array = FLU_TO_FRD.dot(to_frd if mounting is None else mounting.dot(to_frd))
    return rotation


def in_order_of_arrival(
    samples: Iterable[ImuSample], frames: Iterable[NavCameraFrame], camera_offset_s: float
) -> Iterator[SensorEvent]:
    """Yield samples and frames, each frame after the first sample not before it; both inputs are ordered by time.

    The offset is added to a frame's stamp to get the samples' time.
    """
    offset_ns, waiting = round(camera_offset_s * 1e9), iter(samples)
    newest_ns: int | None = None
    for frame in frames:
        while newest_ns is None or newest_ns < frame.capture_timestamp + offset_ns:
            sample = next(waiting, None)
            if sample is None:
                break
            newest_ns = sample.t_ns
            yield sample
        yield frame
    yield from waiting


def make_frame(sequence: int, t_ns: int, pixels: Pixels, camera_id: str) -> NavCameraFrame:
    """Return a frame with an identifier that is the same each time."""
    return NavCameraFrame(frame_uuid(max(t_ns, 0) // 1_000_000, sequence, 0), sequence, t_ns, pixels, camera_id)


def _since_first_frame(events: Iterator[SensorEvent]) -> Iterator[SensorEvent]:
    early: list[SensorEvent] = []
    for event in events:
        if isinstance(event, NavCameraFrame):
            first_ns = event.capture_timestamp - LEAD_NS
            yield from (item for item in early if isinstance(item, NavCameraFrame) or item.t_ns >= first_ns)
            yield event
            break
        early.append(event)
    yield from events


def _turned_poses(poses: Trajectory, body_R_imu: Array) -> Trajectory:
    return dataclasses.replace(
        poses, quats_wxyz=product(poses.quats_wxyz, inverse(quat_wxyz_from_rotation(body_R_imu)))
    )


def _turned_start(start: WarmStartPose, to_body: SE3) -> WarmStartPose:
    turn, covariance = to_body.R, start.covariance
    if covariance is not None:
        turns = np.eye(15)  # position and velocity are the world's
        turns[:3, :3] = turns[9:12, 9:12] = turns[12:, 12:] = turn
        covariance = turns.dot(covariance).dot(turns.T)
    bias = ImuBias(turn.dot(start.bias.accel), turn.dot(start.bias.gyro))
    return WarmStartPose(to_body @ start.body_T_world, turn.dot(start.velocity_b), bias, covariance)
