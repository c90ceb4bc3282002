# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A session with an engine's program: its set-up, its images, and the check of its answers."""

import dataclasses
import threading
from typing import Final

import cv2
import numpy as np

from viso.companion.engine.child import EXIT_S, EngineChild, EngineFailure, OnLine
from viso.companion.engine.protocol import (
    IMU_SAMPLE,
    VERSION,
    Capability,
    CovarianceKind,
    Estimate,
    Height,
    Hello,
    Image,
    Imu,
    KeyframeUpdate,
    Message,
    Options,
    ProtocolError,
    Ready,
    Reset,
    Setup,
    Status,
    frame_of,
    nothing,
)
from viso.companion.klt.front_end import WorkingImages, shrink_factor
from viso.companion.msckf.window_filter import START_SIGMAS, default_cov
from viso.companion.vio.calibration import scaled
from viso.companion.vio.config import VioConfig
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.types import CameraCalibration, DistortionModel, Pixels, WarmStartPose
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, skew

SMALLEST_WIDTH_PX: Final = 16
MOST: Final = 1e7
"""The largest accepted number, in m, m/s, m/s^2, rad/s and the squares of m and rad."""
MOST_KEYFRAMES: Final = 1000
"""The number of recent keyframes that updates may refer to."""


class EngineSession:
    """A session with a program after the greeting and set-up.

    Args:
        config: the configuration; ``engine`` has the times, ``native`` the options.

    Attributes:
        keyframes_ns: stamps of the last keyframes by the identifiers of their images.
        shares: whether pictures go through shared memory.

    Raises:
        EngineFailure: if the program does not start, or refuses the set-up.
    """

    def __init__(self, command: str, calibration: CameraCalibration, config: VioConfig, on_line: OnLine) -> None:
        self._timeout_s = config.engine.frame_timeout_s
        self._image_id = self._keyframe_id = 0  # of none
        self.keyframes_ns = dict[int, int]()
        self._queue, self._lock = list[bytes](), threading.Lock()
        self.child = EngineChild(command, on_line)
        try:
            self.hello = self._introduced(config.engine.start_timeout_s)
            divisor = 1
            if self.hello.image_width_px:
                divisor = shrink_factor(calibration.width, max(self.hello.image_width_px, SMALLEST_WIDTH_PX))
            self._images = WorkingImages(divisor)
            calibration = scaled(calibration, divisor)
            setup = dataclasses.replace(_setup(calibration, config), mask=_mask(config.engine.mask, calibration))
            first: list[Message] = [setup, Options(text=_options(config))]
            if (memory := self.child.share(calibration.width * calibration.height)) is not None:
                first.append(memory)
            first.append(_reset(None))
            frames = [frame_of(message) for message in first]
            _, ready = self.child.exchange(frames, Ready, config.engine.start_timeout_s)
            self.shares = memory is not None and bool(ready.shared_memory)
        except BaseException:
            self.child.close(grace_s=0)
            raise

    @property
    def name(self) -> str:
        """The program's own name."""
        return self.hello.name.split(b"\0")[0].decode("ascii", "replace")

    @property
    def capabilities(self) -> Capability:
        """The capabilities of the engine."""
        return Capability(self.hello.capabilities)

    @property
    def imu_rate_hz(self) -> float:
        """The least IMU samples per second that it needs; 0 for any."""
        return self.hello.imu_rate_hz

    @property
    def pid(self) -> int:
        """The id of the program's process, which leads a process group."""
        return self.child.pid

    @property
    def dropped_lines(self) -> int:
        """The number of lines of standard error that were not logged."""
        return self.child.dropped_lines

    def _introduced(self, timeout_s: float) -> Hello:
        _, hello = self.child.exchange([], Hello, timeout_s)
        if hello.version != VERSION:
            raise EngineFailure("protocol_errors", f"protocol of version {hello.version}, this is {VERSION}")
        return hello

    def reset(self, start: WarmStartPose | None) -> None:
        """Reset the engine; it starts from a state at the next image or finds one."""
        self._keyframe_id = 0
        self._add(_reset(start))

    def add_imu(self, t_ns: int, accel: Array, gyro: Array) -> None:
        """Send a sample with the next image."""
        self._add(Imu(samples=np.array([(t_ns, accel, gyro)], IMU_SAMPLE).tobytes()))

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        """Send a height with the next image; from any thread."""
        self._add(Height(t_ns=t_ns, height_m=height_m, sigma_m=sigma_m))

    def _add(self, message: Message) -> None:
        with self._lock:
            self._queue.append(frame_of(message))

    def add_image(self, t_ns: int, pixels: Pixels) -> tuple[list[KeyframeUpdate], Estimate]:
        """Send an image; return the engine's estimate.

        Raises:
            EngineFailure: if there is no answer in time, or an impossible one.
        """
        image = np.ascontiguousarray(self._images.make(pixels))
        height, width = image.shape
        self._image_id += 1
        if self.shares:
            self.child.put(image.tobytes())
        with self._lock:
            frames, self._queue = self._queue, []
        message = Image(
            t_ns=t_ns,
            image_id=self._image_id,
            width=width,
            height=height,
            in_shared_memory=int(self.shares),
            zero=0,
            pixels=b"" if self.shares else image.tobytes(),
        )
        before, estimate = self.child.exchange([*frames, frame_of(message)], Estimate, self._timeout_s)
        try:
            self._check(estimate, t_ns)
            updates = [message for message in before if isinstance(message, KeyframeUpdate)]
            for update in updates:
                SE3.from_matrix(update.world_T_keyframe.reshape(4, 4))
            return updates, estimate
        except (ProtocolError, ValueError) as error:
            raise EngineFailure("protocol_errors", f"estimate: {error}") from error

    def _check(self, estimate: Estimate, t_ns: int) -> None:
        if estimate.image_id != self._image_id:
            raise ProtocolError(f"of image {estimate.image_id}, the last one is {self._image_id}")
        status, kind = Status(estimate.status), CovarianceKind(estimate.covariance_kind)
        if status not in (Status.TRACKING, Status.LOST):
            return
        SE3.from_matrix(estimate.world_T_body.reshape(4, 4))
        SE3.from_matrix(estimate.keyframe_T_body.reshape(4, 4))
        poses, motion = (estimate.world_T_body, estimate.keyframe_T_body), (estimate.velocity_world,)
        numbers = (*poses, *motion, estimate.accel_bias, estimate.gyro_bias, *([estimate.covariance] if kind else []))
        if not all(np.abs(array).max() < MOST for array in numbers):
            raise ProtocolError("numbers that cannot be")
        features = ("mean_parallax_px", "mre_px", "coverage", "innovation_ratio")
        if not all(getattr(estimate, name) >= 0 for name in features) or estimate.coverage > 1:
            raise ProtocolError("features that cannot be")
        if estimate.keyframe_id != (self._keyframe_id or self._image_id):
            raise ProtocolError(f"keyframe {estimate.keyframe_id}, the last one is {self._keyframe_id}")
        if estimate.is_keyframe or not self._keyframe_id:
            self._keyframe_id = self._image_id
            self.keyframes_ns[self._image_id] = t_ns
            if len(self.keyframes_ns) > MOST_KEYFRAMES:
                del self.keyframes_ns[next(iter(self.keyframes_ns))]

    def close(self, *, grace_s: float = EXIT_S) -> None:
        """End the program; kill it if it does not exit in time."""
        self.child.close(grace_s=grace_s)


def stated_covariance(estimate: Estimate) -> Array | None:
    """Return the covariance [6, 6] of ``keyframe_T_body`` that an engine states; None if it states none."""
    if estimate.covariance_kind == CovarianceKind.NONE:
        return None
    if estimate.covariance_kind == CovarianceKind.RELATIVE:
        return estimate.covariance[:36].reshape(6, 6)
    relative = SE3.from_matrix(estimate.keyframe_T_body.reshape(4, 4))
    keyframe_R = estimate.world_T_body.reshape(4, 4)[:3, :3] @ relative.R.T
    return relative_covariance(estimate.covariance.reshape(12, 12), relative, keyframe_R)


def relative_covariance(joint: Array, keyframe_T_body: SE3, keyframe_R: Array) -> Array:
    """Return the covariance [6, 6] of a pose relative to a keyframe from that of both poses together.

    Args:
        joint: [12, 12] of keyframe and body, each (rotation, right perturbation; position, in the world).
        keyframe_R: the keyframe's rotation into the world.
    """
    R, p = keyframe_T_body.R, keyframe_T_body.t
    jacobian = np.zeros((6, 12))
    jacobian[:3, :3], jacobian[:3, 6:9] = -R.T, np.eye(3)
    jacobian[3:, :3] = R.T @ skew(p)
    jacobian[3:, 9:] = R.T @ keyframe_R.T
    jacobian[3:, 3:6] = -jacobian[3:, 9:]
    covariance: Array = jacobian @ joint @ jacobian.T
    return covariance


def _setup(camera: CameraCalibration, config: VioConfig) -> Setup:
    noise = config.imu_noise
    return Setup(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        distortion=camera.distortion,
        body_T_camera=camera.B_T_C.matrix(),
        body_T_camera_sigma=np.array([camera.rotation_sigma_rad, camera.position_sigma_m]),
        time_offset_s=camera.time_offset_s,
        time_offset_sigma_s=camera.time_offset_sigma_s,
        line_time_s=camera.line_time_s,
        gyro_noise=noise.gyro,
        accel_noise=noise.accel,
        gyro_walk=noise.gyro_walk,
        accel_walk=noise.accel_walk,
        imu_rate_hz=camera.imu_rate_hz,
        gyro_limit=camera.gyro_limit_rad_s,
        accel_limit=camera.accel_limit_m_s2,
        gravity=GRAVITY_MSS,
        width=camera.width,
        height=camera.height,
        distortion_model=list(DistortionModel).index(camera.distortion_model),
        max_features=config.max_features,
        threads=config.threads,
        seed=config.seed,
        mask=b"",
    )


def _mask(file: str, camera: CameraCalibration) -> bytes:
    if not file:
        return b""
    picture = cv2.imread(file, cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise EngineFailure("failures", f"vio.engine.mask: {file}: no picture")
    return cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_NEAREST).tobytes()


def _options(config: VioConfig) -> bytes:
    lines = []
    for name, value in config.native.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        if "=" in name or "\n" in name + text:
            raise EngineFailure("protocol_errors", f"vio.native.{name}: a line break, or = in the name")
        lines.append(f"{name}={text}\n")
    return "".join(lines).encode()


def _reset(start: WarmStartPose | None) -> Reset:
    reset = Reset(**nothing(Reset))
    if start is None:
        return reset
    pose = start.body_T_world.inverse()
    return dataclasses.replace(
        reset,
        has_state=1,
        world_T_body=pose.matrix(),
        velocity_world=pose.R.dot(start.velocity_b),
        accel_bias=start.bias.accel,
        gyro_bias=start.bias.gyro,
        covariance=default_cov(*START_SIGMAS, pose.R) if start.covariance is None else start.covariance,
    )
