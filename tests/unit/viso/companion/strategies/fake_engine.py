# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A session with an engine that is no program: it counts what it gets and says that the body stands still."""

from typing import Any

import numpy as np
import pytest

from viso.companion.engine.protocol import Capability, CovarianceKind, Estimate, KeyframeUpdate, Status, nothing
from viso.companion.strategies import engine
from viso.companion.vio.types import CameraCalibration, Pixels, WarmStartPose
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

STILL_GYRO_RAD_S = 0.02
INITIAL_IMAGES = 2


class FakeSession:
    """Finds its state at the second image, if the body does not turn meanwhile; each third image is a keyframe.

    Args:
        calibration: of the images.

    Attributes:
        imu: the samples' stamps.
        images: the images' stamps.
        resets: what it was reset to.
        heights: that it got.
        status, covariance_6x6, says, world, velocity_world, updates: of its answers, where a test sets them.
    """

    name, pid, dropped_lines, imu_rate_hz, shares = "fake", 0, 0, 0.0, False

    def __init__(self, command: str, calibration: CameraCalibration, *_: object) -> None:
        self._size = calibration.height, calibration.width
        self.capabilities = Capability.STARTS_AT_REST
        self.imu: list[int] = []
        self.images: list[int] = []
        self.keyframes_ns: dict[int, int] = {}
        self.resets: list[WarmStartPose | None] = []
        self.heights: list[tuple[int, float, float]] = []
        self.status: Status | None = None
        self.updates: list[tuple[int, Array]] = []
        self.covariance_6x6: Array | None = np.diag([1e-6] * 3 + [1e-4] * 3)
        self.says: dict[str, Any] = {
            "tracked": 120,
            "lost": 3,
            "fresh": 5,
            "inliers": 100,
            "mean_parallax_px": 4.5,
            "mre_px": 0.5,
            "coverage": 0.8,
            "innovation_ratio": 1.2,
            "accel_bias": np.array([0.1, 0.0, 0.0]),
            "gyro_bias": np.array([0.0, 0.01, 0.0]),
        }
        self.world: Array = np.eye(4)
        self.velocity_world: Array = np.zeros(3)
        self._has_state = False
        self._still_images = self.since_keyframe = 0
        self._gyro = np.zeros(3)

    def add_imu(self, t_ns: int, accel: Array, gyro: Array) -> None:
        assert not self.imu or t_ns > self.imu[-1]
        self.imu.append(t_ns)
        self._gyro = gyro.copy()

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        assert self.capabilities & Capability.TAKES_HEIGHT
        self.heights.append((t_ns, height_m, sigma_m))

    def add_image(self, t_ns: int, pixels: Pixels) -> tuple[list[KeyframeUpdate], Estimate]:
        assert pixels.shape == self._size
        self.images.append(t_ns)
        relative = SE3(np.eye(3), np.array([1e-3 * self._next_keyframe(), 0.0, 0.0])).matrix()
        if self.since_keyframe % 3 == 0 and self._has_state:
            self.keyframes_ns[len(self.images)] = t_ns
        covariance = np.zeros(144)
        if self.covariance_6x6 is not None:
            covariance[:36] = self.covariance_6x6.ravel()
        fields = {
            "t_ns": t_ns,
            "image_id": len(self.images),
            "status": (Status.TRACKING if self._has_state else Status.INITIALISING)
            if self.status is None
            else self.status,
            "world_T_body": self.world.ravel(),
            "keyframe_T_body": relative.ravel(),
            "velocity_world": self.velocity_world.copy(),
            "is_keyframe": int(self.since_keyframe % 3 == 0),
            "covariance": covariance,
            "covariance_kind": CovarianceKind.NONE if self.covariance_6x6 is None else CovarianceKind.RELATIVE,
        }
        updates = [
            KeyframeUpdate(keyframe_id=keyframe_id, world_T_keyframe=pose.ravel(), is_loop_closure=0, zero=0)
            for keyframe_id, pose in self.updates
        ]
        self.updates = []
        return updates, Estimate(**(nothing(Estimate) | fields | self.says))

    def _next_keyframe(self) -> int:
        """Return how many images ago the last keyframe was."""
        if not self._has_state:
            is_still = bool(self.capabilities & Capability.STARTS_AT_REST) and (
                np.linalg.norm(self._gyro) < STILL_GYRO_RAD_S
            )
            self._still_images = self._still_images + 1 if is_still else 0
            self._has_state, self.since_keyframe = self._still_images >= INITIAL_IMAGES, 0
        else:
            self.since_keyframe += 1
        return self.since_keyframe

    def reset(self, start: WarmStartPose | None) -> None:
        self.resets.append(start)
        self.imu.clear()
        self._has_state = start is not None
        self._still_images, self.since_keyframe = 0, -1
        if start is not None:
            self.world = start.body_T_world.inverse().matrix()
            self.velocity_world = self.world[:3, :3].dot(start.velocity_b)

    def close(self, *, grace_s: float = 0.0) -> None:
        pass


def install(monkeypatch: pytest.MonkeyPatch) -> list[FakeSession]:
    """Let engines be fake ones; return those that are started."""
    sessions: list[FakeSession] = []

    def start(*args: Any) -> FakeSession:
        sessions.append(FakeSession(*args))
        return sessions[-1]

    monkeypatch.setattr(engine, "EngineSession", start)
    return sessions
