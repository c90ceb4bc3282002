# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a covariance. It stays symmetric to the bit, and positive: no mix of errors gets a negative variance.

filterpy's KalmanFilter is what the tests compare with, and not what runs: one of its updates takes 16 us with 22
states, where the gain and `fused` take 4, 200 times per second; and it knows neither gains that leave states alone,
nor variances that must not become negative. Its prediction takes 5 us, as the two products and their mean do here.
"""

import math
from collections.abc import Sequence

import numpy as np

from ekf_stub.filter.inertial import Array
from ekf_stub.filter.states import ACCEL, MIN_ACCEL_VAR, MIN_ACCEL_VAR_RATIO, StateLimits

ROUNDING = 1e-13
_NO_VAR = 1e-30


def diagonal(cov: Array) -> Array:
    """Return the variances of a covariance, to read and to write."""
    return cov.reshape(-1)[:: len(cov) + 1]


def is_positive(cov: Array) -> bool:
    """Return whether no mix of errors has a negative variance, but for rounding."""
    try:
        np.linalg.cholesky(cov + np.diag(ROUNDING * diagonal(cov) + _NO_VAR))
    except np.linalg.LinAlgError:
        return False
    return True


def clear(cov: Array, states: slice, variance: float, limits: StateLimits) -> None:
    """Forget what some errors have to do with others, and give them a variance; the highest if it is not a number."""
    highest = limits.highest_var.item(states.start)
    cov[states] = 0.0
    cov[:, states] = 0.0
    diagonal(cov)[states] = max(variance, 0.0) if variance <= highest else highest


def lower(cov: Array, limits: StateLimits) -> None:
    """Shrink errors whose variance is too large.

    FIRMWARE PARITY: the firmware cuts the variance only. Errors may then seem correlated by more than one, and the
    next fusion makes variances negative. Here covariances shrink too, and correlations stay.
    """
    variances = diagonal(cov)
    are_large = (variances > limits.highest_var).tolist()
    if True not in are_large:  # as nearly always
        return
    for state in (state for state, is_large in enumerate(are_large) if is_large):
        scale = math.sqrt(limits.highest_var[state] / variances[state])
        cov[state] *= scale
        cov[:, state] *= scale
        variances[state] = limits.highest_var[state]


def lift(cov: Array, limits: StateLimits) -> None:
    """Raise variances that are too small; of an axis of the accelerometer's bias, beside the largest of the three."""
    variances = diagonal(cov)
    first = ACCEL.start
    largest = max(cov.item(first, first), cov.item(first + 1, first + 1), cov.item(first + 2, first + 2))
    limits.lowest_var[ACCEL] = max(MIN_ACCEL_VAR_RATIO * largest, MIN_ACCEL_VAR)
    np.maximum(variances, limits.lowest_var, out=variances)


def fused(cov: Array, gain: Array, left_alone: Sequence[int], *, is_sharp: bool) -> Array | None:
    """Return a covariance after a measurement; None if a variance would become negative.

    Args:
        gain: how each error goes with the innovation, in units of the innovation's sigma.
        left_alone: states that the measurement is not to correct.
        is_sharp: so much more is known after it than before that the difference of the two has lost its last digits;
            these are made up for, on the safe side.
    """
    used = gain
    if left_alone:
        used = gain.copy()
        used[left_alone] = 0.0
    after = used[:, np.newaxis] * gain
    np.subtract(cov, after, out=after)
    if left_alone:
        after = 0.5 * (after + after.T)
        if not is_positive(after):
            # FIRMWARE PARITY: the firmware goes on with that. This is the covariance of such a gain.
            left = gain - used
            after = cov - (gain[:, np.newaxis] * gain - left[:, np.newaxis] * left)
    variances = diagonal(after)
    if min(variances.tolist()) < 0.0:
        return None
    if is_sharp:
        variances += ROUNDING * diagonal(cov)
    return after
