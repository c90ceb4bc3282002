# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a strategy says, made up: outputs of a chain of frames, and the IMU of a body at rest."""

import uuid
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.types import FeatureQuality, ImuBias, ImuSample, VioOutput, frame_uuid
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

GOOD = FeatureQuality(100, 0, 0, 100, 10.0, 0.3, 0.6)


@dataclass
class Strategy:
    """Gives outputs in a row; every frame is the keyframe of those after it unless said otherwise."""

    pose_covariance: Array = field(default_factory=lambda: np.diag([1e-6] * 3 + [1e-4] * 3))
    world_T_body: SE3 = field(default_factory=SE3.identity)

    def __post_init__(self) -> None:
        self._count = 0
        self.keyframe_id = self._new_id()
        self.world_T_keyframe = self.world_T_body
        self._told: SE3 | None = None

    def _new_id(self) -> uuid.UUID:
        self._count += 1
        return frame_uuid(0, self._count, 0)

    def restart(self, world_T_body: SE3) -> None:
        """Forget everything, and be somewhere."""
        self.keyframe_id = self._new_id()
        self.world_T_body = self.world_T_keyframe = world_T_body

    def change_mind(self, motion: SE3) -> None:
        """Take the last keyframe and the body to be elsewhere, by a motion in the world; the next output tells."""
        self.world_T_body = motion @ self.world_T_body
        self._told = self.world_T_keyframe = motion @ self.world_T_keyframe

    def move(
        self,
        step: SE3 | None = None,
        *,
        is_keyframe: bool = True,
        velocity_b: tuple[float, float, float] = (0.0, 0.0, 0.0),
        bias: ImuBias | None = None,
    ) -> VioOutput:
        """Return the output after a movement of the body, given in the body."""
        self.world_T_body = self.world_T_body @ (step or SE3.identity())
        frame_id = self._new_id()
        output = VioOutput(
            frame_id,
            self.world_T_keyframe.inverse() @ self.world_T_body,
            self.pose_covariance,
            bias or ImuBias.zero(),
            GOOD,
            self.keyframe_id,
            is_keyframe,
            np.array(velocity_b),
            self.world_T_body,
            self._told,
        )
        self._told = None
        if is_keyframe:
            self.keyframe_id, self.world_T_keyframe = frame_id, self.world_T_body
        return output


@pytest.fixture
def make_strategy() -> Callable[..., Strategy]:
    """Return a function that makes a strategy."""
    return Strategy


@pytest.fixture
def strategy() -> Strategy:
    """Return a strategy at the origin of its world."""
    return Strategy()


@pytest.fixture
def at_rest() -> Callable[[int], ImuSample]:
    """Return a function that gives what an IMU at rest measures at a time in ns."""
    return lambda t_ns: ImuSample(t_ns, np.array([0.0, 0.0, GRAVITY_MSS]), np.zeros(3))
