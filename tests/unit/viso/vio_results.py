# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The results of a flight straight ahead, a metre and a second a frame."""

from typing import Self

import numpy as np

from tests.unit.viso.companion.vio.strategy_rig import make_result
from viso.companion.run.log import VioLog
from viso.companion.vio.config import VioConfig
from viso.companion.vio.result import Result
from viso.companion.vio.types import FeatureQuality, ImuBias, VioOutput, VioState, frame_uuid
from viso.geometry.pose import SE3

SECOND_NS = 10**9
STEP = SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
START = SE3(np.eye(3), np.array([0.0, 0.0, 2.0]))
COVARIANCE = np.diag([1e-10] * 3 + [1e-2] * 3)


class Flight:
    """Collects results; every frame is a keyframe."""

    def __init__(self) -> None:
        self.results: list[Result] = []
        self._pose = START

    def init(self) -> Self:
        """Add a frame without a state."""
        return self._add(VioState.INIT, "waiting", None)

    def fly(self, count: int, state: VioState = VioState.TRACKING) -> Self:
        """Add frames with an output."""
        for _ in range(count):
            self._pose = self._pose @ STEP
            number = len(self.results)
            output = VioOutput(
                frame_uuid(number, 0, 0),
                STEP,
                COVARIANCE,
                ImuBias.zero(),
                FeatureQuality(100, 3, 5, 90, 12.5, 0.4, 0.7),
                frame_uuid(number - 1, 0, 0),
                True,
                np.array([1.0, 0.0, 0.0]),
                self._pose,
            )
            self._add(state, "all clear", output)
        return self

    def lose(self) -> Self:
        """Add a frame in LOST."""
        return self._add(VioState.LOST, "too_few_inliers", None)

    def _add(self, state: VioState, reason: str, output: VioOutput | None) -> Self:
        number = len(self.results)
        self.results.append(
            make_result(
                state,
                output,
                frame_id=frame_uuid(number, 0, 0),
                sequence=number,
                t_ns=number * SECOND_NS,
                reason=reason,
                resets=1,
                stage_ms={"track": 15.0, "total": 20.0},
                dropped=2,
            )
        )
        return self


def flown(flight: Flight, config: VioConfig | None = None) -> VioLog:
    """Return the log of a flight."""
    log = VioLog(config or VioConfig())
    for result in flight.results:
        log.take(result)
    return log
