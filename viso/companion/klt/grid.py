# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid of cells that features are spread over, and the corner detector."""

import math
from typing import Any, Final, cast

import cv2
import numpy as np
import numpy.typing as npt

from viso.companion.vio.types import Pixels

Points = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

ROWS: Final = 6
COLUMNS: Final = 8
MIN_DISTANCE_PX: Final = 12
_QUALITY: Final = 0.01
_BLOCK: Final = 3
_CROWD: Final = 3  # shares
_NOTHING: Final = np.zeros((0, 2), np.float32)


class FeatureGrid:
    """Spreads features over the cells of a picture.

    Args:
        width, height: of the working image.
    """

    def __init__(self, width: int, height: int, max_features: int) -> None:
        self._width, self._height = width, height
        self._max_features = max_features
        self._share = math.ceil(max_features / (ROWS * COLUMNS))
        self._x_edges = np.linspace(0, width, COLUMNS + 1).astype(int)
        self._y_edges = np.linspace(0, height, ROWS + 1).astype(int)

    def coverage(self, pixels: Points) -> float:
        """Return the share of cells that hold at least one of the points [N, 2]."""
        return float(np.count_nonzero(self._counts(pixels))) / (ROWS * COLUMNS)

    def uncrowded(self, pixels: Points) -> Mask:
        """Return which of the points [N, 2] to keep, so that no cell has more than three times its share.

        The first points of a cell are kept. Tracked points crowd together where the camera recedes.
        """
        cells = self._cells(pixels)
        order = np.argsort(cells, kind="stable")
        ordered = cells[order]
        rank = np.arange(len(cells)) - np.searchsorted(ordered, ordered)
        stays: Mask = np.zeros(len(cells), np.bool_)
        stays[order] = rank < _CROWD * self._share
        return stays

    def detect(self, image: Pixels, pixels: Points) -> Points:
        """Return new corners [M, 2] in the cells that have too few points (Shi and Tomasi, 1994).

        Args:
            image: grey, of the size given.
            pixels: [N, 2], the existing points; new ones are at least 12 px away from them.
        """
        mask = self._mask(pixels)
        found = [_NOTHING]
        grants = self._grants(self._counts(pixels), self._max_features - len(pixels))
        for cell in np.flatnonzero(grants).tolist():
            row, column = divmod(cell, COLUMNS)
            found.append(self._corners(image, mask, row, column, int(grants[cell])))
        return np.concatenate(found)

    def _grants(self, counts: npt.NDArray[np.int64], wanted: int) -> npt.NDArray[np.int64]:
        """Return the number of new points for each cell; each point goes to the emptiest cell below its share."""
        missing = np.maximum(self._share - counts, 0)
        cells = np.repeat(np.arange(len(missing)), missing)
        firsts = np.repeat(np.cumsum(missing) - missing, missing)
        level = counts[cells] + np.arange(len(cells)) - firsts
        return np.bincount(cells[np.argsort(level, kind="stable")][: max(wanted, 0)], minlength=len(missing))

    def _corners(self, image: Pixels, mask: Pixels, row: int, column: int, count: int) -> Points:
        x0, x1 = self._x_edges[column : column + 2].tolist()
        y0, y1 = self._y_edges[row : row + 2].tolist()
        corners: Any = cv2.goodFeaturesToTrack(
            image[y0:y1, x0:x1], count, _QUALITY, MIN_DISTANCE_PX, mask=mask[y0:y1, x0:x1], blockSize=_BLOCK
        )
        if corners is None:
            return _NOTHING
        points = cast(Points, corners.reshape(-1, 2) + np.array([x0, y0], np.float32))
        for x, y in points.tolist():  # the neighbouring cells keep away as well
            cv2.circle(mask, (round(x), round(y)), MIN_DISTANCE_PX, 0, -1)
        return points

    def _counts(self, pixels: Points) -> npt.NDArray[np.int64]:
        return np.bincount(self._cells(pixels), minlength=ROWS * COLUMNS)

    def _cells(self, pixels: Points) -> npt.NDArray[np.int64]:
        rows = np.clip(np.searchsorted(self._y_edges, pixels[:, 1], "right") - 1, 0, ROWS - 1)
        columns = np.clip(np.searchsorted(self._x_edges, pixels[:, 0], "right") - 1, 0, COLUMNS - 1)
        cells: npt.NDArray[np.int64] = rows * COLUMNS + columns
        return cells

    def _mask(self, pixels: Points) -> Pixels:
        mask = np.full((self._height, self._width), 255, np.uint8)
        for x, y in pixels.tolist():
            cv2.circle(mask, (round(x), round(y)), MIN_DISTANCE_PX, 0, -1)
        return mask
