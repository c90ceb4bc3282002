# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of the smoother have in common: a body that sways past a wall of points, and what its sensors tell."""

import numpy as np

from viso.companion.klt.front_end import Ids, Sighting
from viso.companion.klt.outliers import Model
from viso.companion.msckf.window_filter import WindowFilter, default_cov, invariant_cov
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import GRAVITY_MSS, MOUNTINGS
from viso.companion.vio.types import ImuBias, ImuSample, ImuWindow
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

NOISE = ImuNoise()
B_T_C = SE3(MOUNTINGS["forward"], np.array([0.1, 0.0, 0.05]))
SIGMA = 1 / 400
PERIOD_NS = 200_000_000  # of nodes
IMU_PERIOD_NS = 5_000_000
WALL = np.random.default_rng(1).uniform([6.0, -4.0, -3.0], [9.0, 6.0, 3.0], (120, 3))
GRAVITY = np.array([0.0, 0.0, GRAVITY_MSS])

# The body never turns: it flies to the left and sways.
_SPEED = np.array([0.0, 0.8, 0.0])
_SWAY_M = np.array([0.2, 0.15, 0.1])
_SWAY_RAD_S = np.array([2.0, 3.0, 4.0])


def pose_at(t_ns: int) -> SE3:
    t_s = t_ns * 1e-9
    return SE3(np.eye(3), _SPEED * t_s + _SWAY_M * np.sin(_SWAY_RAD_S * t_s))


def velocity_at(t_ns: int) -> Array:
    velocity: Array = _SPEED + _SWAY_M * _SWAY_RAD_S * np.cos(_SWAY_RAD_S * t_ns * 1e-9)
    return velocity


def window(t0_ns: int, t1_ns: int) -> ImuWindow:
    """Return what the IMU measures in flight."""
    first, last = t0_ns // IMU_PERIOD_NS, -(-t1_ns // IMU_PERIOD_NS)
    samples = []
    for t_ns in range(first * IMU_PERIOD_NS, last * IMU_PERIOD_NS + 1, IMU_PERIOD_NS):
        accel = -_SWAY_M * _SWAY_RAD_S**2 * np.sin(_SWAY_RAD_S * t_ns * 1e-9)
        samples.append(ImuSample(t_ns, accel + GRAVITY, np.zeros(3)))
    return ImuWindow(t0_ns, t1_ns, tuple(samples))


def still_window(t0_ns: int, t1_ns: int) -> ImuWindow:
    """Return what the IMU measures at rest."""
    samples = tuple(ImuSample(t_ns, GRAVITY, np.zeros(3)) for t_ns in range(t0_ns, t1_ns + 1, IMU_PERIOD_NS))
    return ImuWindow(t0_ns, t1_ns, samples)


def sight(pose: SE3, seed: int = 0, points: Array = WALL) -> Sighting:
    """Return what a camera sees of points, to half a sigma."""
    local = (pose @ B_T_C).inverse().map(points)
    normalised = local[:, :2] / local[:, 2:]
    normalised += np.random.default_rng(seed).normal(0, 0.5 * SIGMA, normalised.shape)
    ids = np.flatnonzero((np.abs(normalised) < 0.7).all(axis=1))
    return sighting_of(ids, normalised[ids])


def sighting_of(ids: Ids, normalised: Array) -> Sighting:
    count = len(ids)
    return Sighting(ids, normalised, count, 0, 0, count, Model.ESSENTIAL, 2.0, 0.8)


def start(velocity_error: Array | None = None) -> WindowFilter:
    """Return the state at time 0, with the sigmas of a start in flight."""
    R, p = pose_at(0).R, pose_at(0).t
    v = velocity_at(0) + (np.zeros(3) if velocity_error is None else velocity_error)
    cov = default_cov(0.02, 0.05, 0.3, 0.01, 0.1, R)
    return WindowFilter(NOISE, R, p, v, ImuBias.zero(), invariant_cov(cov, R, p, v))
