# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The counter that tells the autopilot that the estimate has jumped."""

import math
from typing import Final

from viso.companion.vio.se3 import Array

JUMP_SIGMAS: Final = 3.0
JUMP_M: Final = 0.5


class ResetCounter:
    """Counts modulo 256 what the autopilot must not take for movement; starts at 0."""

    def __init__(self) -> None:
        self.value = 0
        self._started = False

    def start(self) -> None:
        """Note an initialisation, static or by warm start; the first one is none of the autopilot's business."""
        if self._started:
            self._step()
        self._started = True

    def correct(self, moved_m: Array, covariance: Array) -> None:
        """Note a correction: it counts if it moves the pose by more than 3 sigma and 0.5 m at once.

        Args:
            moved_m: from where the pose was to where it is now, at the same instant.
            covariance: [3, 3] of the position as it was stated before, in m^2, in the same axes.
        """
        distance_m = math.sqrt(moved_m.dot(moved_m))
        if distance_m <= JUMP_M:
            return
        along = moved_m / distance_m
        if distance_m > JUMP_SIGMAS * math.sqrt(along.dot(covariance).dot(along)):
            self._step()

    def _step(self) -> None:
        self.value = (self.value + 1) % 256
