# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that is worked on: grey, and small enough."""

from typing import Any, Final, cast

import cv2

from viso.companion.vio.types import Pixels

_CLAHE_LIMIT: Final = 2.0
_CLAHE_TILES: Final = (8, 8)


def shrink_factor(width: int, working_width_px: int) -> int:
    """Return the smallest divisor that brings a width down to the working width or less."""
    return -(-width // working_width_px)


class WorkingImages:
    """Makes working images of pictures.

    Args:
        divisor: of the picture's sides, from :func:`shrink_factor`.
        clahe: whether contrast is equalised (contrast limited, 8 x 8 tiles).
    """

    def __init__(self, divisor: int, *, clahe: bool = False) -> None:
        self._divisor = divisor
        self._clahe = cv2.createCLAHE(_CLAHE_LIMIT, _CLAHE_TILES) if clahe else None

    def make(self, pixels: Pixels) -> Pixels:
        """Return the working image [H', W'] of a picture, BGR [H, W, 3] or grey [H, W]; never the same memory."""
        image: Any = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY) if pixels.ndim == 3 else pixels
        if self._divisor > 1:
            height, width = (side // self._divisor for side in image.shape)
            whole = image[: height * self._divisor, : width * self._divisor]
            image = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
        if self._clahe is not None:
            image = self._clahe.apply(image)
        return cast(Pixels, image.copy() if image is pixels else image)
