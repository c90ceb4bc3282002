# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The covariance of a pose that is composed of poses relative to keyframes.

The errors of velocity and bias are common to successive links, so adding the links as independent gives too small a
covariance. The filter keeps the pose that the chain began with, and its covariance contains the common part. What the
filter learnt about a keyframe after that was the last one is not in the chain, and is added.
"""

import numpy as np

from viso.companion.msckf.window_filter import CLONE, MOTION, POSE, WindowFilter
from viso.geometry.rotation import Array


class Chain:
    """The covariance of a composed pose; the errors are those of a filter, rigid motions of its world.

    Args:
        origin: number of the frame whose pose the chain begins with; it must stay in the filter's window.
        keyframe: number of its first keyframe.
    """

    def __init__(self, state: WindowFilter, origin: int, keyframe: int) -> None:
        self.origin = origin
        self._unlearnt: Array = np.zeros((CLONE, CLONE))  # of the keyframes before the last one
        self._stated = self._since(state, _columns(state, keyframe))  # of the last keyframe, at the time it became one

    def covariance(self, state: WindowFilter, keyframe: int, number: int | None = None) -> Array:
        """Return the covariance [6, 6] of the pose now, right perturbation, as composed with the last keyframe's.

        Args:
            keyframe: number of the frame that the pose is relative to.
            number: of the present frame, if it is the next keyframe.
        """
        now = self._since(state, slice(POSE.start, POSE.stop))
        unlearnt = self._unlearnt + _positive(self._stated - self._since(state, _columns(state, keyframe)))
        if number is not None:
            self._unlearnt, self._stated = unlearnt, now
        to_body = state.pose.inverse().adjoint()
        composed: Array = to_body.dot(now + unlearnt).dot(to_body.T)
        return 0.5 * (composed + composed.T)

    def _since(self, state: WindowFilter, pose: slice) -> Array:
        """Return the covariance of the error that a pose and the origin do not share."""
        cov, first = state.cov, _columns(state, self.origin)
        cross = cov[pose, first]
        return cov[pose, pose] + cov[first, first] - cross - cross.T


def _columns(state: WindowFilter, number: int) -> slice:
    first = MOTION + CLONE * state.index_of(number)
    return slice(first, first + CLONE)


def _positive(cov: Array) -> Array:
    """Return a difference of covariances without negative parts from rounding and linearisation."""
    values, vectors = np.linalg.eigh(0.5 * (cov + cov.T))
    positive: Array = (vectors * np.maximum(values, 0.0)).dot(vectors.T)
    return positive
