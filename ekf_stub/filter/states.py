# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The states of the filter in their order, and where they and their variances are kept.

Source: AP_NavEKF3/AP_NavEKF3_core.cpp (ConstrainStates, ConstrainVariances).
"""

from typing import Final

import numpy as np

from ekf_stub.filter.inertial import EKF_TARGET_DT, Array, limited

ATT: Final = slice(0, 4)
VEL: Final = slice(4, 7)
POS: Final = slice(7, 10)
GYRO: Final = slice(10, 13)
ACCEL: Final = slice(13, 16)
EARTH: Final = slice(16, 19)
BODY: Final = slice(19, 22)
STATES: Final = 22

MAX_VEL: Final = 500.0
MAX_POS_NE: Final = 1e6
MAX_HEIGHT: Final = 4e4
MAX_DEPTH: Final = 1e4
MAX_GYRO_BIAS: Final = 0.175
MAX_EARTH_FIELD: Final = 1.0
MAX_BODY_FIELD: Final = 0.5

MAX_ATT_VAR: Final = 1.0
MAX_VEL_VAR: Final = 1e3
MAX_POS_VAR: Final = 1e6
MAX_ACCEL_BIAS_SIGMA: Final = 10.0
MAX_FIELD_VAR: Final = 0.01
MIN_VEL_POS_VAR: Final = 1e-4
MIN_ACCEL_VAR: Final = 5e-9
MIN_ACCEL_VAR_RATIO: Final = 0.01

HIGHEST_VEL: Final = np.full(3, MAX_VEL)
LOWEST_VEL: Final = -HIGHEST_VEL
HIGHEST_POS: Final = np.array([MAX_POS_NE, MAX_POS_NE, MAX_DEPTH])
LOWEST_POS: Final = np.array([-MAX_POS_NE, -MAX_POS_NE, -MAX_HEIGHT])


def but_attitude(states: slice) -> slice:
    """Return where states are in a vector of all but the attitude's."""
    return slice(states.start - ATT.stop, states.stop - ATT.stop)


def within(vector: Array, lowest: Array, highest: Array) -> Array:
    """Return a vector with each component within its limits."""
    return np.minimum(np.maximum(vector, lowest), highest)


class StateLimits:
    """Limits of all states but the attitude, and of all variances.

    Biases are kept for a step of average length, so that their limits depend on it.

    Attributes:
        lowest, highest: shape (18,), of velocity and what follows it.
        lowest_var, highest_var: shape (22,).
    """

    def __init__(self) -> None:
        fields = np.repeat([MAX_EARTH_FIELD, MAX_BODY_FIELD], 3)
        self.lowest: Array = np.concatenate([LOWEST_VEL, LOWEST_POS, np.zeros(6), -fields])
        self.highest: Array = np.concatenate([HIGHEST_VEL, HIGHEST_POS, np.zeros(6), fields])
        self.lowest_var: Array = np.zeros(STATES)
        self.lowest_var[VEL.start : POS.stop] = MIN_VEL_POS_VAR
        self.highest_var: Array = np.full(STATES, MAX_FIELD_VAR)
        self.highest_var[ATT], self.highest_var[VEL], self.highest_var[POS] = MAX_ATT_VAR, MAX_VEL_VAR, MAX_POS_VAR
        self._max_accel_bias = 0.0
        self._set_for: tuple[float, float] | None = None
        self.set_step(EKF_TARGET_DT)

    def set_accel_bias(self, accel_bias_mss: float, dt_ekf_avg: float) -> None:
        """Set the limit of the accelerometer's bias in m/s/s."""
        self._max_accel_bias = limited(accel_bias_mss, 0.0, MAX_ACCEL_BIAS_SIGMA)
        self.set_step(dt_ekf_avg)

    def set_step(self, dt_ekf_avg: float) -> None:
        """Set the average length of a step in s."""
        key = dt_ekf_avg, self._max_accel_bias
        if key == self._set_for:  # the average settles within seconds
            return
        self._set_for = key
        gyro, accel = MAX_GYRO_BIAS * dt_ekf_avg, self._max_accel_bias * dt_ekf_avg
        self.lowest[_GYRO_BIAS], self.highest[_GYRO_BIAS] = -gyro, gyro
        self.lowest[_ACCEL_BIAS], self.highest[_ACCEL_BIAS] = -accel, accel
        self.highest_var[GYRO], self.highest_var[ACCEL] = gyro * gyro, (MAX_ACCEL_BIAS_SIGMA * dt_ekf_avg) ** 2


_GYRO_BIAS: Final = but_attitude(GYRO)
_ACCEL_BIAS: Final = but_attitude(ACCEL)
