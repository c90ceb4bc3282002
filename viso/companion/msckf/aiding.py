# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements that come from no camera: standing still, and the height above ground."""

import math
from typing import Final

import numpy as np

from viso.companion.msckf.window_filter import ATT, GYRO, POS, VEL, WindowFilter
from viso.geometry.rotation import Array, skew

STILL_VELOCITY_SIGMA_M_S: Final = 0.02
STILL_GYRO_SIGMA_RAD_S: Final = 0.003

_GATE: Final = 16.3  # of 3 degrees of freedom, 99.9 %


def stand_still(state: WindowFilter, mean_gyro: Array, share: float = 1.0) -> bool:
    """Take in that the body does not move, and that what its gyro shows is bias; say whether that can be.

    A body at a great height may move without its camera seeing it.

    Args:
        mean_gyro: [3] in rad/s, FLU.
        share: of the gyro's mean that is new, above 0; it counts for as much.
    """
    size = len(state.cov)
    by_velocity = np.zeros((3, size))
    by_velocity[:, VEL], by_velocity[:, ATT] = np.eye(3), -skew(state.v)
    if state.nis(by_velocity, -state.v, STILL_VELOCITY_SIGMA_M_S) > _GATE:
        return False
    state.update(by_velocity, -state.v, STILL_VELOCITY_SIGMA_M_S)
    by_bias = np.zeros((3, size))
    by_bias[:, GYRO] = np.eye(3)
    state.update(by_bias, mean_gyro - state.gyro_bias, STILL_GYRO_SIGMA_RAD_S / math.sqrt(share))
    return True


def take_height(state: WindowFilter, up_m: float, sigma_m: float, gate: float) -> bool:
    """Take in how high the body is in the world; say whether that can be.

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
    """Return the normalised innovation squared of a height, as :func:`take_height` has it."""
    return state.nis(*_height_equation(state, up_m), sigma_m)


def _height_equation(state: WindowFilter, up_m: float) -> tuple[Array, Array]:
    jacobian = np.zeros((1, len(state.cov)))
    jacobian[:, POS], jacobian[:, ATT] = [0.0, 0.0, 1.0], -skew(state.p)[2]
    return jacobian, np.array([up_m - state.p[2]])
