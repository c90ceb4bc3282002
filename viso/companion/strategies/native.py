# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The seam for engines that are compiled: what a native module must offer, and how it is found.

A native module is a Python module, whatever it is written in. It has one function

    ``create(calibration: CameraCalibration, config: VioConfig) -> NativeEngine``

with the calibration of the images that the engine will get: those of the working size. The engine's own options are
``config.native``. It raises RuntimeError or ValueError, with one line, if it cannot make an engine. Nothing of the
module is imported before a strategy that wants it is built, and no part of this project is linked to it.

Conventions of all that crosses the seam: stamps are nanoseconds of the IMU's clock; the world is ENU with gravity
(0, 0, -g), the body FLU with its origin in the IMU; ``A_T_B`` maps from B to A and is a homogeneous matrix [4, 4] of
float64. Arrays that go in must not be kept, those that come out must be new or never change again. Any exception that a
method raises means that the engine has failed: the strategy is then LOST until ``reset``.
"""

import enum
import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

from viso.companion.vio.config import VioConfig
from viso.companion.vio.types import CameraCalibration, Pixels, WarmStartPose
from viso.geometry.se3 import Array

WIRING_ABSENT: Final = "native wiring absent"


class NativeStatus(enum.Enum):
    """How an engine is after an image.

    INITIALISING: there is no state. TRACKING: the image was used. LOST: it could not be used, what the engine says is
    propagated by the IMU alone. FAILED: nothing that it says holds.
    """

    INITIALISING = "INITIALISING"
    TRACKING = "TRACKING"
    LOST = "LOST"
    FAILED = "FAILED"


@dataclass(frozen=True, slots=True, eq=False)
class NativePose:
    """Where the body was at the last image.

    Attributes:
        world_T_body: [4, 4].
        keyframe_T_body: [4, 4], the body in the last keyframe's body; identity for the first image with a state.
        velocity_world: [3] in m/s.
        is_keyframe: whether this image is the keyframe of the images after it; true for the first one with a state.
    """

    world_T_body: Array
    keyframe_T_body: Array
    velocity_world: Array
    is_keyframe: bool


@dataclass(frozen=True, slots=True, eq=False)
class NativeBias:
    """What the engine takes the IMU's bias to be.

    Attributes:
        accel: [3] in m/s^2.
        gyro: [3] in rad/s.
    """

    accel: Array
    gyro: Array


@dataclass(frozen=True, slots=True)
class NativeFeatures:
    """What the engine's front end made of the last image; the fields are those of ``FeatureQuality``, and one more.

    Means are over the inliers: what a robust loss has put aside does not count.

    Attributes:
        mre_px: mean reprojection error of the inliers.
        innovation_ratio: mean of the inliers' normalised residual squared per degree of freedom; 1 where the engine has
            none.
    """

    tracked: int
    lost: int
    new: int
    inliers: int
    mean_parallax_px: float
    mre_px: float
    coverage: float
    innovation_ratio: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class NativeKeyframeUpdate:
    """Where the engine takes a keyframe to be by now, from what came after it or from a place that was seen again.

    Attributes:
        t_ns: stamp of the keyframe's image.
        world_T_keyframe: [4, 4], the body there.
    """

    t_ns: int
    world_T_keyframe: Array


class NativeEngine(Protocol):
    """An engine: inertial data, heights and images in; pose, covariance, bias, features and status out.

    All but ``reset`` and the inputs may be called only while the status is TRACKING or LOST; they tell about the last
    image.

    Attributes:
        starts_at_rest: whether it finds its state while the body stands still. One that needs motion is told its state
            by ``reset`` as soon as the body has stood still.
        takes_height: whether it makes use of heights; without them the scale of a flight over a plane drifts.
    """

    @property
    def starts_at_rest(self) -> bool: ...

    @property
    def takes_height(self) -> bool: ...

    def add_imu(self, t_ns: int, accel: Array, gyro: Array) -> None:
        """Take a sample (m/s^2, rad/s; FLU).

        Stamps increase from one reset to the next. The samples up to an image come before it, and one beyond it.
        """

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        """Take a height of the body above the ground, ahead of the image that it is near; only if it takes heights."""

    def add_image(self, t_ns: int, pixels: Pixels) -> NativeStatus:
        """Work on a grey image [H, W] of the calibration's size; return when its result is there."""

    def pose(self) -> NativePose:
        """Return where the body was."""

    def covariance(self) -> Array | None:
        """Return the covariance [6, 6] of ``keyframe_T_body``: right perturbation, (rx, ry, rz, tx, ty, tz).

        It comes from the joint distribution of both poses, not from their marginals. None where the engine cannot tell:
        it is then made from the drift that the configuration tells.
        """

    def keyframe_updates(self) -> Sequence[NativeKeyframeUpdate]:
        """Return the keyframes whose poses have changed since this was last asked; () if it tells of none.

        Only that of the keyframe that ``pose`` refers to is used: it moves all that comes after it.
        """

    def bias(self) -> NativeBias:
        """Return the IMU's bias."""

    def features(self) -> NativeFeatures:
        """Return what the front end made of the image."""

    def reset(self, start: WarmStartPose | None) -> None:
        """Forget all; start from a state at the next image, or find one without help."""


def load_engine(module: str, calibration: CameraCalibration, config: VioConfig) -> NativeEngine:
    """Return a new engine of a native module.

    Raises:
        ImportError: if there is no such module ("native wiring absent"), or it cannot be imported or make an engine.
    """
    try:
        native: Any = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module:  # it is there, and lacks something itself
            raise
        raise ImportError(WIRING_ABSENT) from error
    try:
        engine: NativeEngine = native.create(calibration, config)
    except (RuntimeError, ValueError) as error:
        raise ImportError(f"{module}: {error}") from error
    return engine
