# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strategy that believes that the vehicle never moves."""

import numpy as np

from viso.companion import (
    SE3,
    FeatureQuality,
    FrameFacts,
    ImuBias,
    ImuWindow,
    NavCameraFrame,
    Result,
    StrategyBase,
    StrategyEntry,
    VioOutput,
    WarmStartPose,
)

STILL = SE3.identity()
QUALITY = FeatureQuality(100, 0, 0, 100, mean_parallax_px=0.0, mre_px=0.0, coverage=1.0)


class Standstill(StrategyBase):
    """Says of every frame that it was taken where the first one was."""

    name = "standstill"

    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
        output = VioOutput(
            frame.frame_id,
            STILL,
            1e-4 * np.eye(6),
            ImuBias.zero(),
            QUALITY,
            keyframe_id=frame.frame_id,
            is_keyframe=True,
            velocity_b=np.zeros(3),
            world_T_body=STILL,
        )
        return self._conclude(FrameFacts(inliers=100, coverage=1.0, mre_px=0.0, initialised=True), output)

    def _reset(self, start: WarmStartPose | None) -> None:
        """Do nothing: there is no state."""


STANDSTILL = StrategyEntry(Standstill, "believes that the vehicle never moves")
