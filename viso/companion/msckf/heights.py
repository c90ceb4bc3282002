# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights above the ground, from range finder or barometer: collected from any thread, used with the frames."""

import math
import threading
from collections import deque
from typing import Final

import numpy as np

from viso.companion.msckf.window_filter import ATT, POS, WindowFilter
from viso.companion.vio.types import HeightMeasurement
from viso.geometry.rotation import Array, skew

MAX_AGE_NS: Final = 200_000_000
SIGMA_SHARE: Final = 0.01  # of the height: no sigma is smaller
GATE: Final = 25.0  # 5 sigma
MOST_REFUSED: Final = 3  # in a row: repeated equal values are not outliers, but ground at another height
_LEAST_HEIGHT_M: Final = 1.0
_CAPACITY: Final = 64


class Heights:
    """Stores heights until a frame is near, and updates a filter with them."""

    def __init__(self, least_sigma_m: float) -> None:
        self._least_sigma_m = least_sigma_m
        self._heights: deque[HeightMeasurement] = deque(maxlen=_CAPACITY)
        self._lock = threading.Lock()
        self._disagreeing = 0  # in a row

    def add(self, t_ns: int, height_m: float, sigma_m: float) -> bool:
        """Add a height; return False, and ignore it, if it is invalid. From any thread.

        Args:
            t_ns: when, by the IMU's clock.
            height_m: of the body above the ground.
        """
        good = math.isfinite(height_m) and math.isfinite(sigma_m) and height_m >= 0 and sigma_m >= 0
        if good:
            with self._lock:
                self._heights.append(HeightMeasurement(t_ns, height_m, sigma_m))
        return good

    def take(self, t_ns: int, ground_m: float, velocity_w: Array) -> tuple[float, float] | None:
        """Return the body's height and its sigma in m at a time, from the nearest measurement; each is used once.

        Args:
            t_ns: when, by the IMU's clock.
            ground_m: height of the ground in the world.
            velocity_w: [3] in m/s, of the body in the world.
        """
        height = self._nearest(t_ns)
        if height is None:
            return None
        up_m = ground_m + height.height_m + float(velocity_w[2]) * (t_ns - height.t_ns) * 1e-9
        return up_m, max(self._least_sigma_m, SIGMA_SHARE * height.height_m, height.sigma_m)

    def use(self, state: WindowFilter, t_ns: int, ground_m: float) -> float | None:
        """Update a filter with the height nearest to its time; return the error of a refused one.

        A height more than 5 sigma off is refused, but at most 3 in a row. The error is a share of the height.

        Args:
            t_ns: when, by the IMU's clock.
            ground_m: height of the ground in the filter's world.
        """
        taken = self.take(t_ns, ground_m, state.v)
        if taken is None:
            return None
        off = self.off(state, taken, ground_m)
        if off is None:
            take_height(state, *taken, math.inf)
        return off

    def off(self, state: WindowFilter, taken: tuple[float, float], ground_m: float) -> float | None:
        """Return the error of a height to refuse, as a share of the height; None for an acceptable one.

        Args:
            taken: the body's height and its sigma, from :meth:`take`.
            ground_m: height of the ground in the filter's world.
        """
        agrees = height_nis(state, *taken) <= GATE
        self._disagreeing = 0 if agrees else self._disagreeing + 1
        if agrees or self._disagreeing > MOST_REFUSED:
            return None
        return abs(taken[0] - float(state.p[2])) / max(taken[0] - ground_m, _LEAST_HEIGHT_M)

    def _nearest(self, t_ns: int) -> HeightMeasurement | None:
        with self._lock:
            near = [height for height in self._heights if abs(height.t_ns - t_ns) <= MAX_AGE_NS]
            nearest = min(near, key=lambda height: abs(height.t_ns - t_ns), default=None)
            while nearest is not None and self._heights.popleft() is not nearest:
                pass
            return nearest


def take_height(state: WindowFilter, up_m: float, sigma_m: float, gate: float) -> bool:
    """Update with the body's height in the world; return whether it passes the gate.

    Args:
        up_m: z of the body in m.
        gate: largest normalised innovation squared.
    """
    jacobian, residual = _height_equation(state, up_m)
    if state.nis(jacobian, residual, sigma_m) > gate:
        return False
    state.update(jacobian, residual, sigma_m)
    return True


def height_nis(state: WindowFilter, up_m: float, sigma_m: float) -> float:
    """Return the normalised innovation squared of a height in :func:`take_height`."""
    return state.nis(*_height_equation(state, up_m), sigma_m)


def _height_equation(state: WindowFilter, up_m: float) -> tuple[Array, Array]:
    jacobian = np.zeros((1, len(state.cov)))
    jacobian[:, POS], jacobian[:, ATT] = [0.0, 0.0, 1.0], -skew(state.p)[2]
    return jacobian, np.array([up_m - state.p[2]])
