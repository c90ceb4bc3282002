# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking of points into the next picture: pyramidal Lucas-Kanade, forward and backward, with a check of the result.

Lucas-Kanade assumes that a point keeps its grey level. If the exposure has changed, the lighter picture is darkened
first, by the means of the whole pictures and then by the surroundings of the points found. It also assumes that a
point's surroundings only shift. If points are expected to rotate or spread, as when the camera rolls or climbs, the
later picture is warped back first.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, cast

import cv2
import numpy as np
import numpy.typing as npt

from viso.companion.klt.grid import Mask, Points
from viso.companion.vio.types import Pixels
from viso.geometry.rotation import Array

Patches = npt.NDArray[np.float32]

BORDER_PX: Final = 5
MIN_CORRELATION: Final = 0.5  # signal and noise are then equally strong
_WINDOW: Final = (21, 21)
_LEVELS, _LEVELS_WIDE, _WIDE_PX = 3, 4, 700
_STOP: Final = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.01)
_BACK_LEVELS: Final = 1  # the backward track begins where it should end
_NOTICED_GAIN: Final = 0.1  # the content of a picture changes its mean as well
_FEWEST_FOR_GAIN: Final = 8
_MOST_GAIN: Final = 4.0  # beyond it the lens is or was covered
_NEARLY_WHITE: Final = 250.0  # grey levels: lighter ones may be clipped
_FEWEST_LEVELS: Final = 10.0  # sigma of what has to be compared to tell a gain from an offset
_MIDDLE: Final = 110.0  # grey level
_SAME_GAIN: Final = 0.05  # a change of exposure that is less does not move points
_SAME_LEVEL: Final = 4.0
_NOTICED_TURN: Final = 0.05  # moves the edge of what surrounds a point by half a pixel
_MOST_TURN: Final = 2.0  # any turn; beyond it nothing is alike
_FEWEST_FOR_TURN: Final = 8
_LEAST_SPREAD_PX: Final = 20.0
_PATCH: Final = np.arange(-BORDER_PX, BORDER_PX + 1, dtype=np.float32)


class KltTracker:
    """Tracks points from picture to picture.

    Args:
        width, height: of the working image.
        fb_threshold_px: largest forward-backward error of a point.
    """

    def __init__(self, width: int, height: int, fb_threshold_px: float) -> None:
        self._width, self._height = width, height
        self._fb_threshold_px = fb_threshold_px
        self._levels = _LEVELS_WIDE if width > _WIDE_PX else _LEVELS

    def track(self, before: Pixels, after: Pixels, pixels: Points, guess: Points) -> tuple[Points, Mask]:
        """Return the positions of points [N, 2] in the later picture, and which of them were found.

        Args:
            before, after: grey, of the same size.
        """
        if len(pixels) == 0:
            return pixels, np.zeros(0, np.bool_)
        turn = _turn_of(pixels, guess)
        if turn is None:
            there, found = self._track(before, after, pixels, guess)
        else:
            there, found = self._track(before, turn.undone(after), pixels, turn.back(guess))
            there = turn.forth(there)
        x, y = there[:, 0], there[:, 1]
        found &= (x >= BORDER_PX) & (y >= BORDER_PX)
        found &= (x < self._width - BORDER_PX) & (y < self._height - BORDER_PX)
        return there, found

    def _track(self, before: Pixels, after: Pixels, pixels: Points, guess: Points) -> tuple[Points, Mask]:
        exposure = _exposure_of(before, after)
        one, other = exposure.undone(before, after)
        there, found = self._flow(one, other, pixels, guess, self._levels)
        better = _exposure_at(before, after, pixels[found], there[found], exposure)
        if not better.is_like(exposure):
            one, other = better.undone(before, after)
            there, found = self._flow(one, other, pixels, np.where(found[:, None], there, guess), self._levels)
        back, returned = self._flow(other, one, there, pixels, _BACK_LEVELS)
        found &= returned & (np.hypot(*(back - pixels).T) < self._fb_threshold_px)
        # In a picture of nothing but noise, points stay where they were expected, and come back.
        found[found] = _alike(_patches(before, pixels[found]), _patches(after, there[found])) >= MIN_CORRELATION
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


@dataclass(frozen=True, slots=True, eq=False)
class _Turn:
    """The map [2, 3] of pixels: rotation and scale, then shift."""

    matrix: Array

    def forth(self, pixels: Points) -> Points:
        there: Points = (pixels @ self.matrix[:, :2].T + self.matrix[:, 2]).astype(np.float32)
        return there

    def back(self, pixels: Points) -> Points:
        there = np.linalg.solve(self.matrix[:, :2], (pixels - self.matrix[:, 2]).T).T
        return there.astype(np.float32)

    def undone(self, image: Pixels) -> Pixels:
        """Return a later picture with rotation, scale and shift undone."""
        size, flags = (image.shape[1], image.shape[0]), cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        return cast(Pixels, cv2.warpAffine(image, self.matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT))


def _turn_of(pixels: Points, guess: Points) -> _Turn | None:
    """Return the expected rotation and scale of points [N, 2]; None if small or unknown."""
    if len(pixels) < _FEWEST_FOR_TURN:
        return None
    middle, other = pixels.mean(axis=0, dtype=np.float64), guess.mean(axis=0, dtype=np.float64)
    fitted, _, _, spread = np.linalg.lstsq(pixels - middle, guess - other, rcond=None)
    if spread[-1] < _LEAST_SPREAD_PX * math.sqrt(len(pixels)):
        return None
    linear = fitted.T
    if not _NOTICED_TURN < np.linalg.norm(linear - np.eye(2), 2) < _MOST_TURN or np.linalg.det(linear) <= 0:
        return None
    return _Turn(np.column_stack([linear, other - linear @ middle]))


@dataclass(frozen=True, slots=True)
class _Exposure:
    """The change of grey levels from one picture to the next: gain and offset."""

    gain: float = 1.0
    offset: float = 0.0

    def is_like(self, other: "_Exposure") -> bool:
        gain, middle = self.gain - other.gain, _MIDDLE * (self.gain - other.gain) + self.offset - other.offset
        return abs(gain) <= _SAME_GAIN * self.gain and abs(middle) <= _SAME_LEVEL

    def undone(self, before: Pixels, after: Pixels) -> tuple[Pixels, Pixels]:
        """Return two pictures at equal exposure; the lighter one is darkened, because white is clipped."""
        if self.is_like(_Exposure()):
            return before, after
        if self.gain > 1:
            return before, _scaled(after, 1 / self.gain, -self.offset / self.gain)
        return _scaled(before, self.gain, self.offset), after


def _scaled(image: Pixels, gain: float, offset: float) -> Pixels:
    lut = np.clip(np.rint(gain * np.arange(256) + offset), 0, 255).astype(np.uint8)
    return cast(Pixels, cv2.LUT(image, lut))


def _exposure_of(before: Pixels, after: Pixels) -> _Exposure:
    """Return the exposure change from the means of two pictures, as a gain."""
    change = abs(math.log(gain := max(cv2.mean(after)[0], 1.0) / max(cv2.mean(before)[0], 1.0)))
    return _Exposure(gain if _NOTICED_GAIN < change < math.log(_MOST_GAIN) else 1.0)


def _exposure_at(before: Pixels, after: Pixels, pixels: Points, there: Points, guess: _Exposure) -> _Exposure:
    """Return the exposure change from the surroundings of points [N, 2]; the guess if there are few."""
    one, other = _patches(before, pixels), _patches(after, there)
    same = _alike(one, other) >= MIN_CORRELATION
    same &= (one.max(axis=1) < _NEARLY_WHITE) & (other.max(axis=1) < _NEARLY_WHITE)
    if np.count_nonzero(same) < _FEWEST_FOR_GAIN:
        return guess
    levels, later = one[same].mean(axis=1), other[same].mean(axis=1)
    if levels.std() > _FEWEST_LEVELS:
        gain = float(later.std() / levels.std())
    else:  # by the contrast, which changes with blur as well
        gain = float(np.median(other[same].std(axis=1) / one[same].std(axis=1)))
    return _Exposure(gain, float(np.median(later - gain * levels)))


def _alike(one: Patches, other: Patches) -> Patches:
    """Return the correlation [N], -1 to 1, of surroundings [N, K], independent of the exposure."""
    one, other = one - one.mean(axis=1, keepdims=True), other - other.mean(axis=1, keepdims=True)
    strength = np.sqrt((one * one).sum(axis=1) * (other * other).sum(axis=1))
    correlation: Patches = (one * other).sum(axis=1) / np.maximum(strength, 1e-3)
    return correlation


def _patches(image: Pixels, pixels: Points) -> Patches:
    """Return the grey levels around points [N, 2]."""
    if not len(pixels):  # which OpenCV refuses to remap
        return np.zeros((0, len(_PATCH) ** 2), np.float32)
    x, y = np.broadcast_arrays(pixels[:, 0, None, None] + _PATCH, pixels[:, 1, None, None] + _PATCH[:, None])
    side = len(_PATCH)
    patches: Any = cv2.remap(image, x.reshape(-1, side), y.reshape(-1, side), cv2.INTER_LINEAR)
    grey: Patches = patches.reshape(-1, side * side).astype(np.float32)
    return grey
