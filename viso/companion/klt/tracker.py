# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where points of one picture are in the next one: pyramidal Lucas-Kanade, there and back, and a look at the result."""

from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from viso.companion.klt.grid import Mask, Points
from viso.companion.vio.types import Pixels

BORDER_PX: Final = 5
MIN_CORRELATION: Final = 0.5  # what is seen and its noise are then equally strong
_WINDOW: Final = (21, 21)
_LEVELS, _LEVELS_WIDE, _WIDE_PX = 3, 4, 700
_STOP: Final = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.01)
_BACK_LEVELS: Final = 1  # the way back begins where it should end
_PATCH: Final = np.arange(-BORDER_PX, BORDER_PX + 1, dtype=np.float32)


class KltTracker:
    """Follows points from picture to picture.

    Args:
        width, height: of the working image.
        fb_threshold_px: how far from its start a point may come back to.
    """

    def __init__(self, width: int, height: int, fb_threshold_px: float) -> None:
        self._width, self._height = width, height
        self._fb_threshold_px = fb_threshold_px
        self._levels = _LEVELS_WIDE if width > _WIDE_PX else _LEVELS

    def track(self, before: Pixels, after: Pixels, pixels: Points, guess: Points) -> tuple[Points, Mask]:
        """Return where points [N, 2] of the picture before are in the one after, and which of them were found.

        Args:
            before, after: grey, of the same size.
            pixels: the points before.
            guess: where they are expected.
        """
        if len(pixels) == 0:
            return pixels, np.zeros(0, np.bool_)
        there, found = self._flow(before, after, pixels, guess, self._levels)
        back, returned = self._flow(after, before, there, pixels, _BACK_LEVELS)
        x, y = there[:, 0], there[:, 1]
        found &= returned & (np.hypot(*(back - pixels).T) < self._fb_threshold_px)
        found &= (x >= BORDER_PX) & (y >= BORDER_PX)
        found &= (x < self._width - BORDER_PX) & (y < self._height - BORDER_PX)
        # In a picture of nothing but noise, points stay where they were expected, and come back.
        found[found] = _correlation(before, after, pixels[found], there[found]) >= MIN_CORRELATION
        return there, found

    def _flow(self, before: Pixels, after: Pixels, pixels: Points, guess: Points, levels: int) -> tuple[Points, Mask]:
        # The guess is written to, so it is a copy.
        flow: Any = cv2.calcOpticalFlowPyrLK(
            before,
            after,
            pixels.reshape(-1, 1, 2),
            guess.reshape(-1, 1, 2).copy(),
            winSize=_WINDOW,
            maxLevel=levels,
            criteria=_STOP,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        there, status, _ = flow
        return there.reshape(-1, 2), status.ravel() == 1


def _correlation(before: Pixels, after: Pixels, pixels: Points, there: Points) -> npt.NDArray[np.float32]:
    """Return how well the surroundings of points [N, 2] agree, from -1 to 1, whatever the exposure."""
    if not len(pixels):  # which OpenCV refuses to remap
        return np.zeros(0, np.float32)
    one, other = _surroundings(before, pixels), _surroundings(after, there)
    strength = np.sqrt((one * one).sum(axis=1) * (other * other).sum(axis=1))
    correlation: npt.NDArray[np.float32] = (one * other).sum(axis=1) / np.maximum(strength, 1e-3)
    return correlation


def _surroundings(image: Pixels, pixels: Points) -> npt.NDArray[np.float32]:
    """Return the grey levels around points [N, 2], less their mean."""
    x, y = np.broadcast_arrays(pixels[:, 0, None, None] + _PATCH, pixels[:, 1, None, None] + _PATCH[:, None])
    side = len(_PATCH)
    patches: Any = cv2.remap(image, x.reshape(-1, side), y.reshape(-1, side), cv2.INTER_LINEAR)
    grey = patches.reshape(-1, side * side).astype(np.float32)
    centred: npt.NDArray[np.float32] = grey - grey.mean(axis=1, keepdims=True)
    return centred
