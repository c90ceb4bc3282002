# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The records that go into a strategy and come out of it, all frozen.

Times are nanoseconds of the companion's monotonic clock. Frames, calibrations, warm starts and outputs are checked when
they are made, and their arrays are read-only; the constructor raises ``ValueError`` naming the field. Inertial data are
checked where they come from outside (``ImuSample.checked``, ``ImuBias.checked``), and by the buffer, which takes them
in the order of time only.
"""

import enum
import math
import uuid
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

from viso.geometry.pose import SE3, read_only, sound_covariance
from viso.geometry.rotation import Array

Pixels = npt.NDArray[np.uint8]


def frame_uuid(time_ms: int, sequence: int, random: int) -> uuid.UUID:
    """Return a time-ordered identifier (version 7 layout, RFC 9562).

    Args:
        time_ms: Unix or monotonic milliseconds; the lowest 48 bits count.
        sequence: orders what has the same time; the lowest 12 bits count.
        random: the lowest 62 bits count.
    """
    value = (time_ms & (1 << 48) - 1) << 80 | 7 << 76 | (sequence & 0xFFF) << 64 | 2 << 62 | random & (1 << 62) - 1
    return uuid.UUID(int=value)


def _count(value: int, field: str) -> None:
    if value < 0:
        raise ValueError(f"{field}: negative")


def _covariance(value: Any, size: int, field: str) -> Array:
    sound = sound_covariance(read_only(value, (size, size), field))
    if sound is None:
        raise ValueError(f"{field}: not symmetric and positive")
    sound.flags.writeable = False
    return sound


@dataclass(frozen=True, slots=True, eq=False)
class NavCameraFrame:
    """A picture of the navigation camera.

    Attributes:
        frame_id: identifier, time-ordered; increasing within a flight.
        sequence: one more with each captured frame, also for dropped ones.
        capture_timestamp: middle of the exposure.
        pixels: uint8, [H, W, 3] BGR or [H, W] grey.
        camera_id: the calibration's.
    """

    frame_id: uuid.UUID
    sequence: int
    capture_timestamp: int
    pixels: Pixels
    camera_id: str

    def __post_init__(self) -> None:
        _count(self.sequence, "sequence")
        pixels = self.pixels
        if not isinstance(pixels, np.ndarray) or pixels.dtype != np.uint8:
            raise ValueError("pixels: not an array of uint8")
        if not (pixels.ndim == 2 or (pixels.ndim == 3 and pixels.shape[2] == 3)) or pixels.size == 0:
            raise ValueError(f"pixels: shape {pixels.shape}, neither [H, W] nor [H, W, 3]")
        view = np.ascontiguousarray(pixels).view()  # 60 MB at full size: no copy where there need not be one
        view.flags.writeable = False
        object.__setattr__(self, "pixels", view)

    @property
    def t_ns(self) -> int:
        """The stamp, as of other data."""
        return self.capture_timestamp


@dataclass(frozen=True, slots=True)
class HeightMeasurement:
    """A height from a range finder, corrected for the tilt, or from a barometer.

    Attributes:
        t_ns: when.
        height_m: of the body's origin above the ground.
        sigma_m: its standard deviation.
    """

    t_ns: int
    height_m: float
    sigma_m: float


@dataclass(frozen=True, slots=True, eq=False)
class ImuSample:
    """A sample of the IMU.

    Attributes:
        t_ns: when.
        accel: specific force in m/s^2, FLU.
        gyro: rotation rate in rad/s, FLU.
    """

    t_ns: int
    accel: Array
    gyro: Array

    @classmethod
    def checked(cls, t_ns: int, accel: Any, gyro: Any) -> Self:
        """Return a sample from outside. Raises ValueError unless both are three finite numbers; names the field."""
        return cls(t_ns, read_only(accel, (3,), "accel"), read_only(gyro, (3,), "gyro"))


SensorEvent = ImuSample | HeightMeasurement | NavCameraFrame


@dataclass(frozen=True, slots=True, eq=False)
class ImuWindow:
    """The inertial data between two frames.

    Attributes:
        start_t_ns: stamp of the frame before.
        end_t_ns: stamp of this frame.
        samples: in strictly increasing order of time; they bracket the two stamps, unless data are missing.
    """

    start_t_ns: int
    end_t_ns: int
    samples: tuple[ImuSample, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ImuBias:
    """The bias of the IMU.

    Attributes:
        accel: in m/s^2, FLU.
        gyro: in rad/s, FLU.
    """

    accel: Array
    gyro: Array

    @classmethod
    def checked(cls, accel: Any, gyro: Any) -> Self:
        """Return a bias from outside. Raises ValueError unless both are three finite numbers; names the field."""
        return cls(read_only(accel, (3,), "accel"), read_only(gyro, (3,), "gyro"))

    @classmethod
    def zero(cls) -> "ImuBias":
        """Return the bias zero."""
        return cls(np.zeros(3), np.zeros(3))

    def norm(self) -> float:
        """Return the Euclidean norm of the six numbers."""
        return math.sqrt(float(self.accel.dot(self.accel) + self.gyro.dot(self.gyro)))


class DistortionModel(enum.StrEnum):
    """The model of a lens's distortion."""

    NONE = "none"
    RADTAN = "radtan"
    EQUIDISTANT = "equidistant"


_COEFFICIENTS: Final = {DistortionModel.NONE: (0,), DistortionModel.RADTAN: (4, 5), DistortionModel.EQUIDISTANT: (4,)}


@dataclass(frozen=True, slots=True, eq=False)
class CameraCalibration:
    """The calibration of a camera: lens, size of the picture, and mounting.

    Attributes:
        camera_id: the model.
        unit: the serial of this camera.
        width, height: of the image in pixels.
        fx, fy, cx, cy: intrinsics in pixels; the middle of the first pixel is (0, 0).
        distortion_model: of the lens.
        distortion: k1 k2 p1 p2 [k3] (radtan), k1 k2 k3 k4 (equidistant), or nothing.
        B_T_C: from the camera into the body.
        time_offset_s: what must be added to a frame's stamp to get the IMU's time.
        time_offset_sigma_s: of it; 0 where it counts as exact.
        rotation_sigma_rad: of each axis of ``B_T_C``'s rotation; 0 where it counts as exact.
        position_sigma_m: of each axis of the camera's position; 0 where it counts as exact.
        line_time_s: from one row of pixels to the next one below, of a rolling shutter; 0 for a global one.
        imu_rate_hz: samples per second; 0 where it is not known.
        accel_limit_m_s2, gyro_limit_rad_s: what each axis of the IMU can measure; inf where it is not known.
    """

    camera_id: str
    unit: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion_model: DistortionModel
    distortion: Array
    B_T_C: SE3
    time_offset_s: float = 0.0
    time_offset_sigma_s: float = 0.0
    rotation_sigma_rad: float = 0.0
    position_sigma_m: float = 0.0
    line_time_s: float = 0.0
    imu_rate_hz: float = 0.0
    accel_limit_m_s2: float = math.inf
    gyro_limit_rad_s: float = math.inf

    def __post_init__(self) -> None:
        if not self.camera_id:
            raise ValueError("camera_id: empty")
        for field in ("width", "height"):
            if not isinstance(getattr(self, field), int) or getattr(self, field) <= 0:
                raise ValueError(f"{field}: not a positive number of pixels")
        for field in ("fx", "fy", "cx", "cy", "time_offset_s"):
            if not math.isfinite(getattr(self, field)):
                raise ValueError(f"{field}: not finite")
        for field in ("fx", "fy", "accel_limit_m_s2", "gyro_limit_rad_s"):
            if not getattr(self, field) > 0:
                raise ValueError(f"{field}: not positive")
        for field in ("time_offset_sigma_s", "rotation_sigma_rad", "position_sigma_m", "line_time_s", "imu_rate_hz"):
            if not 0 <= getattr(self, field) < math.inf:
                raise ValueError(f"{field}: not a finite number from 0")
        try:
            model = DistortionModel(self.distortion_model)
        except ValueError:
            known = ", ".join(DistortionModel)
            raise ValueError(f"distortion_model: {self.distortion_model!r} is none of {known}") from None
        count = len(self.distortion)
        if count not in _COEFFICIENTS[model]:
            raise ValueError(f"distortion: {count} coefficients, {model} has {_COEFFICIENTS[model][-1]}")
        object.__setattr__(self, "distortion_model", model)
        object.__setattr__(self, "distortion", read_only(self.distortion, (count,), "distortion"))

    def matrix(self) -> Array:
        """Return the matrix [3, 3] from normalised coordinates to pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True, eq=False)
class WarmStartPose:
    """A state to start from.

    Attributes:
        body_T_world: maps world coordinates (ENU) into the body.
        velocity_b: in m/s, in the body (FLU).
        bias: of the IMU.
        covariance: [15, 15] of attitude (rad, body), position (m, world), velocity (m/s, world), gyro bias (rad/s) and
            accelerometer bias (m/s^2); None for the default sigmas.
    """

    body_T_world: SE3
    velocity_b: Array
    bias: ImuBias
    covariance: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocity_b", read_only(self.velocity_b, (3,), "velocity_b"))
        object.__setattr__(self, "bias", ImuBias.checked(self.bias.accel, self.bias.gyro))
        if self.covariance is not None:
            object.__setattr__(self, "covariance", _covariance(self.covariance, 15, "covariance"))


@dataclass(frozen=True, slots=True)
class FeatureQuality:
    """Figures of the front end about a frame.

    Attributes:
        tracked, lost, new, inliers: numbers of features.
        mean_parallax_px: after removing rotation.
        mre_px: mean reprojection error of the inliers.
        coverage: share of grid cells with an inlier, 0 to 1.
    """

    tracked: int
    lost: int
    new: int
    inliers: int
    mean_parallax_px: float
    mre_px: float
    coverage: float

    def __post_init__(self) -> None:
        for field in ("tracked", "lost", "new", "inliers"):
            _count(getattr(self, field), field)
        for field in ("mean_parallax_px", "mre_px"):
            if not getattr(self, field) >= 0:
                raise ValueError(f"{field}: not a number from 0")
        if not 0 <= self.coverage <= 1:
            raise ValueError("coverage: not from 0 to 1")


class VioState(enum.Enum):
    """The state of a strategy."""

    INIT = "INIT"
    TRACKING = "TRACKING"
    DEGRADED = "DEGRADED"
    LOST = "LOST"


@dataclass(frozen=True, slots=True)
class VioHealth:
    """The health of a strategy.

    Attributes:
        state: which of the four.
        consecutive_lost: frames since the last one that could be used.
        bias_norm: of the estimated bias.
        reason: of the last change of state, or the present problem.
    """

    state: VioState
    consecutive_lost: int
    bias_norm: float
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class VioOutput:
    """The pose of a frame, and how well it is known.

    Attributes:
        frame_id: the frame's.
        relative_pose_T: ``K_T_B``, the body in the last keyframe's body.
        pose_covariance_6x6: of it, right perturbation, (rx, ry, rz, tx, ty, tz).
        imu_bias: the estimate.
        feature_quality: figures of the front end.
        keyframe_id: of K, the keyframe that the pose refers to.
        is_keyframe: whether this frame is the keyframe of the outputs after it.
        velocity_b: in m/s, in the body (FLU).
        world_T_body: the body in the strategy's world (ENU), for diagnosis.
        world_T_keyframe: K in that world, where it has changed since K was the keyframe of an output; else None.
        start_covariance_6x6: of the pose that all relative poses since the start compose, as that of a relative pose;
            None if the strategy does not know what they share.
    """

    frame_id: uuid.UUID
    relative_pose_T: SE3
    pose_covariance_6x6: Array
    imu_bias: ImuBias
    feature_quality: FeatureQuality
    keyframe_id: uuid.UUID
    is_keyframe: bool
    velocity_b: Array
    world_T_body: SE3
    world_T_keyframe: SE3 | None = None
    start_covariance_6x6: Array | None = None

    def __post_init__(self) -> None:
        covariance = _covariance(self.pose_covariance_6x6, 6, "pose_covariance_6x6")
        object.__setattr__(self, "pose_covariance_6x6", covariance)
        if self.start_covariance_6x6 is not None:
            since = _covariance(self.start_covariance_6x6, 6, "start_covariance_6x6")
            object.__setattr__(self, "start_covariance_6x6", since)
        object.__setattr__(self, "imu_bias", ImuBias.checked(self.imu_bias.accel, self.imu_bias.gyro))
        object.__setattr__(self, "velocity_b", read_only(self.velocity_b, (3,), "velocity_b"))
