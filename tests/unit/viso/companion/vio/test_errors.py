# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What errors carry and say."""

import numpy as np
import pytest

from viso.companion.vio.errors import (
    StrategyNotAvailableError,
    VioDegradedError,
    VioError,
    VioFatalError,
    VioInitializingError,
)
from viso.companion.vio.types import FeatureQuality, ImuBias, VioOutput, frame_uuid
from viso.geometry.se3 import SE3


def output() -> VioOutput:
    return VioOutput(
        frame_id=frame_uuid(2, 2, 2),
        relative_pose_T=SE3.identity(),
        pose_covariance_6x6=np.eye(6),
        imu_bias=ImuBias.zero(),
        feature_quality=FeatureQuality(0, 0, 0, 0, 0.0, 0.0, 0.0),
        keyframe_id=frame_uuid(1, 1, 1),
        is_keyframe=False,
        velocity_b=np.zeros(3),
        world_T_body=SE3.identity(),
    )


@pytest.mark.parametrize("kind", [VioInitializingError, VioDegradedError, VioFatalError, StrategyNotAvailableError])
def test_every_error_is_a_vio_error(kind: type[Exception]) -> None:
    assert issubclass(kind, VioError)


def test_degraded_error_carries_the_output_and_the_reason() -> None:
    degraded = output()
    error = VioDegradedError("imu_gap", degraded)
    assert error.output is degraded
    assert (error.reason, str(error)) == ("imu_gap", "imu_gap")


def test_fatal_error_has_no_output() -> None:
    assert VioFatalError("concurrent process_frame").output is None


def test_missing_strategy_is_named_with_the_reason() -> None:
    error = StrategyNotAvailableError("okvis2", "flag BUILD_OKVIS2 is off")
    assert (error.name, error.reason) == ("okvis2", "flag BUILD_OKVIS2 is off")
    assert str(error) == "strategy okvis2 is not available: flag BUILD_OKVIS2 is off"
