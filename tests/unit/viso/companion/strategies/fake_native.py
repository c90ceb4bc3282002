# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A native engine that is not native: it counts what it gets and says that the body stands still."""

import copy
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from viso.companion.strategies.native import (
    NativeBias,
    NativeEngine,
    NativeFeatures,
    NativeKeyframeUpdate,
    NativePose,
    NativeStatus,
)
from viso.companion.vio.config import VioConfig
from viso.companion.vio.types import CameraCalibration, Pixels, WarmStartPose
from viso.geometry.se3 import SE3, Array

STILL_GYRO_RAD_S = 0.02
INITIAL_IMAGES = 2


class FakeEngine:
    """Finds its state at the second image, if the body does not turn meanwhile; each third image is a keyframe.

    Args:
        calibration: of the images.

    Attributes:
        imu: the samples' stamps.
        images: the images' stamps.
        resets: what it was reset to.
        heights: what it was told of them.
        status, covariance_6x6, features_told, world, velocity_world, updates: what it will say, where a test sets it.
        starts_at_rest, takes_height: what it can.
        sees_in_the_dark: whether it can do with black images.
    """

    def __init__(self, calibration: CameraCalibration) -> None:
        self._size = calibration.height, calibration.width
        self.imu: list[int] = []
        self.images: list[int] = []
        self.resets: list[WarmStartPose | None] = []
        self.status: NativeStatus | None = None
        self.heights: list[tuple[int, float, float]] = []
        self.starts_at_rest = True
        self.takes_height = False
        self.updates: list[NativeKeyframeUpdate] = []
        self.covariance_6x6: Any = np.diag([1e-6] * 3 + [1e-4] * 3)
        self.features_told = NativeFeatures(120, 3, 5, 100, 4.5, 0.5, 0.8, 1.2)
        self.world: Array = np.eye(4)
        self.sees_in_the_dark = False
        self.velocity_world: Array = np.zeros(3)
        self._has_state = False
        self._still_images = self._since_keyframe = 0
        self._gyro = np.zeros(3)
        self._mean = 0.0

    def add_imu(self, t_ns: int, accel: Array, gyro: Array) -> None:
        assert not self.imu or t_ns > self.imu[-1]
        self.imu.append(t_ns)
        self._gyro = gyro.copy()

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        assert self.takes_height
        self.heights.append((t_ns, height_m, sigma_m))

    def add_image(self, t_ns: int, pixels: Pixels) -> NativeStatus:
        assert pixels.shape == self._size
        self.images.append(t_ns)
        self._mean = float(pixels.mean())
        if not self._has_state:
            is_still = self.starts_at_rest and np.linalg.norm(self._gyro) < STILL_GYRO_RAD_S
            self._still_images = self._still_images + 1 if is_still else 0
            if self._still_images < INITIAL_IMAGES:
                return self.status or NativeStatus.INITIALISING
            self._has_state = True
            self._since_keyframe = 0
        else:
            self._since_keyframe += 1
        return self.status or (NativeStatus.TRACKING if self._sees(pixels) else NativeStatus.LOST)

    def _sees(self, pixels: Pixels) -> bool:
        return self.sees_in_the_dark or bool(pixels.any())

    def pose(self) -> NativePose:
        x = 1e-3 * self._since_keyframe + 1e-6 * self._mean  # so that what is seen shows in what is said
        relative = SE3(np.eye(3), np.array([x, 0.0, 0.0])).matrix()
        is_keyframe = self._since_keyframe % 3 == 0
        return NativePose(self.world.copy(), relative, self.velocity_world.copy(), is_keyframe)

    def covariance(self) -> Array | None:
        told: Array | None = copy.copy(self.covariance_6x6)
        return told

    def keyframe_updates(self) -> list[NativeKeyframeUpdate]:
        told, self.updates = self.updates, []
        return told

    def bias(self) -> NativeBias:
        return NativeBias(np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.01, 0.0]))

    def features(self) -> NativeFeatures:
        return self.features_told

    def reset(self, start: WarmStartPose | None) -> None:
        self.resets.append(start)
        self.imu.clear()
        self._has_state = start is not None
        self._still_images, self._since_keyframe = 0, -1
        if start is not None:
            self.world = start.body_T_world.inverse().matrix()
            self.velocity_world = self.world[:3, :3].dot(start.velocity_b)


class FakeModule(ModuleType):
    """A module that makes fake engines, or does what it is told to.

    Attributes:
        engines: those it has made.
        before: called before it makes one.
        starts_at_rest: whether they do.
    """

    def __init__(self, name: str, *, starts_at_rest: bool = True) -> None:
        super().__init__(name)
        self.starts_at_rest = starts_at_rest
        self.engines: list[FakeEngine] = []
        self.before: Callable[[], object] = lambda: None

    def create(self, calibration: CameraCalibration, config: VioConfig) -> NativeEngine:
        self.before()
        engine = FakeEngine(calibration)
        engine.starts_at_rest = self.starts_at_rest
        self.engines.append(engine)
        return engine


def install(monkeypatch: pytest.MonkeyPatch, name: str, *, starts_at_rest: bool = True) -> FakeModule:
    """Make a fake native module importable under a name."""
    module = FakeModule(name, starts_at_rest=starts_at_rest)
    monkeypatch.setitem(sys.modules, name, module)
    return module
