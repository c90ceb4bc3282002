# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares with an uncertainty that holds for correlated residuals."""

from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

BLOCKS: Final = 20
FEWEST_BLOCKS: Final = 6
_OUTLIER: Final = 5.0  # standard deviations
_SIGMA_OF_MEDIAN: Final = 1.4826  # of a normal distribution


def blocks_of(time_s: Array, shortest_s: float) -> npt.NDArray[np.intp]:
    """Return each sample's block number by its increasing time; no block is shorter than ``shortest_s``."""
    if not len(time_s):
        return np.zeros(0, np.intp)
    span_s = float(time_s[-1] - time_s[0])
    count = int(np.clip(span_s / shortest_s, 1, BLOCKS))
    place = (time_s - time_s[0]) / max(span_s, 1e-9) * count
    numbers: npt.NDArray[np.intp] = np.minimum(place.astype(np.intp), count - 1)
    return numbers


def fit(design: Array, residuals: Array, blocks: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the step that makes residuals least, and its covariance.

    The covariance is the sandwich of White, A heteroskedasticity-consistent covariance matrix estimator (1980), over
    blocks of samples, so that neither overlapping windows nor coloured noise make it too small.

    Args:
        design: derivative of the model by each parameter, [N, M, P].
        residuals: measured less modelled values, [N, M].
        blocks: number of each sample's block, [N].

    Returns:
        The step [P] and the covariance [P, P]; infinite where samples do not determine it.
    """
    parameters = design.shape[-1]
    normal = np.einsum("nmp,nmq->pq", design, design)
    count = int(blocks.max()) + 1 if len(blocks) else 0
    # A parameter's unit must not affect what counts as singular.
    size = np.sqrt(normal.diagonal())
    if count < FEWEST_BLOCKS or not size.all() or np.linalg.cond(normal / np.outer(size, size)) > 1e9:
        return np.zeros(parameters), np.full((parameters, parameters), np.inf)
    inverse = np.linalg.inv(normal)
    step = inverse @ np.einsum("nmp,nm->p", design, residuals)
    left = residuals - design @ step
    scores = np.zeros((count, parameters))
    np.add.at(scores, blocks, np.einsum("nmp,nm->np", design, left))
    return step, inverse @ (scores.T @ scores) @ inverse * count / (count - 1)


def mean_and_sigma(values: Array, blocks: npt.NDArray[np.intp]) -> tuple[float, float]:
    """Return the mean of values [N] and its standard deviation; infinite for too few blocks."""
    step, covariance = fit(np.ones((len(values), 1, 1)), values[:, None], blocks)
    return float(step[0]), float(np.sqrt(covariance[0, 0]))


def inliers(lengths: Array) -> npt.NDArray[np.bool_]:
    """Return which residuals, by their lengths [N], are not outliers, such as from a jump of the heading."""
    if not len(lengths):
        return np.zeros(0, bool)
    limit = _OUTLIER * _SIGMA_OF_MEDIAN * float(np.median(lengths))
    return lengths <= max(limit, 1e-9)
