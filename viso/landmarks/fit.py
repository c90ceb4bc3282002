# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit of heading, mounting and time errors to the innovations of many pictures, with uncertainties.

A first estimate uses medians, which a few wrong matches do not move: at each delay of a grid, bearings of detections
are compared with those of the landmarks. From the best delay, Gauss-Newton with Cauchy's weights (Triggs et al.,
Bundle Adjustment: A Modern Synthesis, section 3) continues in pixels, and a last step treats the remaining residuals as
normal noise. Uncertainties assume that pixel noise is independent between detections.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.geometry.rotation import Array, quats_from_rotation_vectors, rotations_from_quats, so3_log
from viso.landmarks.observation import (
    camera_R_body,
    rays,
    rotation_about_up,
    to_pixels,
    turned,
    world_R_body,
)
from viso.landmarks.residuals import first_of_each
from viso.landmarks.types import Camera, Detections, Landmark, VehiclePose

EARLIEST_S: Final = -0.3
LATEST_S: Final = 0.7
"""The search range of the delay is from ``EARLIEST_S`` to this."""
LONGEST_GAP_S: Final = 1.0
"""Poses further apart are not interpolated."""
FEWEST_DETECTIONS: Final = 10
LEAST_MOTION_PX_S: Final = 10.0
"""The motion in the picture that a tenth of the landmarks must exceed; less is the noise of a vehicle at rest."""
PRIOR_SIGMA: Final = (1.0, 1.0, 0.5)
"""Prior sigmas of yaw and pitch in rad and delay in s; data that do not halve one leave it undetermined."""
_GRID_S: Final = 0.025
_GRID_DETECTIONS: Final = 4000  # are enough for the first estimate
_STEPS: Final = np.array([1e-5, 1e-5, 5e-3])  # for differences; the last spans some of the poses' corners
_ROBUST_ROUNDS, _LAST_ROUNDS = 30, 6
_CONVERGED: Final = np.array([1e-7, 1e-7, 1e-5])
_CAUCHY: Final = 2.385  # 95 % efficient for normal noise
_INLIER_SIGMAS: Final = 4.0
_SIGMA_OF_MEDIAN: Final = 1.1774  # median length of a normal vector in the plane
_LEAST_NOISE_PX: Final = 1e-3


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """The errors that explain the innovations, each with its standard deviation; both None if undetermined.

    Attributes:
        yaw_offset_rad, yaw_sigma_rad: correction to add to the reported yaw.
        pitch_trim_rad, pitch_sigma_rad: correction to add to the camera's pitch trim.
        delay_s, delay_sigma_s: by how much the stamps of the pictures are late.
        used, rejected: number of detections that agree, and of those that do not or could not be compared.
        rms_px: root mean square of the used innovations' residuals, per axis; None without any.
    """

    yaw_offset_rad: float | None
    yaw_sigma_rad: float | None
    pitch_trim_rad: float | None
    pitch_sigma_rad: float | None
    delay_s: float | None
    delay_sigma_s: float | None
    used: int
    rejected: int
    rms_px: float | None


def fit_pose_errors(
    camera: Camera, poses: Sequence[VehiclePose], landmarks: Sequence[Landmark], pictures: Sequence[Detections]
) -> PoseErrors:
    """Fit yaw offset, pitch trim and delay to pictures of landmarks.

    Pictures that a delay could move outside the time of the poses are left out. Poses may come in any order; of those
    with
    the same time the last counts.
    """
    detections = _matches(landmarks, pictures)
    track = _Track(poses)
    if len(track.t_s) < 2:
        return _nothing(len(detections))
    inside = (detections.t_s - LATEST_S >= track.t_s[0]) & (detections.t_s - EARLIEST_S <= track.t_s[-1])
    compared = detections.where(inside)
    if len(compared) < FEWEST_DETECTIONS:
        return _nothing(len(detections))
    model = _Model(camera, track, compared)
    start, tells_delay = _first_look(model)
    return _result(_refine(model, start, tells_delay), len(detections))


@dataclass(frozen=True, slots=True, eq=False)
class _Matches:
    """Detections of known landmarks: times [N], pixels [N, 2], places [N, 3]."""

    t_s: Array
    uv_px: Array
    xyz: Array

    def __len__(self) -> int:
        return len(self.t_s)

    def where(self, chosen: npt.NDArray[np.bool_] | slice) -> "_Matches":
        return _Matches(self.t_s[chosen], self.uv_px[chosen], self.xyz[chosen])


def _matches(landmarks: Sequence[Landmark], pictures: Sequence[Detections]) -> _Matches:
    places = {landmark.id: (landmark.x_m, landmark.y_m, landmark.z_m) for landmark in landmarks}
    rows = [
        (picture.t_s, detection.u_px, detection.v_px, *places[name])
        for picture in pictures
        for name, detection in first_of_each(picture.landmarks)[0].items()
        if name in places
    ]
    table = np.array(rows).reshape(-1, 6)
    return _Matches(table[:, 0], table[:, 1:3], table[:, 3:])


class _Track:
    """Poses over time, with interpolation."""

    def __init__(self, poses: Sequence[VehiclePose]) -> None:
        by_time = {pose.t_s: pose for pose in poses}
        ordered = [by_time[t_s] for t_s in sorted(by_time)]
        self.t_s = np.array([pose.t_s for pose in ordered])
        self._xyz = np.array([(pose.x_m, pose.y_m, pose.z_m or 0.0) for pose in ordered]).reshape(-1, 3)
        self._yaw_rad = np.unwrap([pose.yaw_rad for pose in ordered])
        self._attitudes = np.array([world_R_body(pose) for pose in ordered]).reshape(-1, 3, 3)
        self._turns = np.array([so3_log(one.T @ other) for one, other in pairwise(self._attitudes)]).reshape(-1, 3)

    def at(self, t_s: Array) -> tuple[Array, Array, Array]:
        """Return positions [N, 3], NaN without near poses on both sides, yaws [N] and attitudes [N, 3, 3]."""
        before = np.clip(np.searchsorted(self.t_s, t_s, side="right") - 1, 0, len(self.t_s) - 2)
        gap_s = self.t_s[before + 1] - self.t_s[before]
        share = (t_s - self.t_s[before]) / gap_s
        known = (gap_s <= LONGEST_GAP_S) & (share >= 0) & (share <= 1)
        share = np.where(known, share, 0.0)
        xyz = self._xyz[before] + share[:, np.newaxis] * (self._xyz[before + 1] - self._xyz[before])
        xyz[~known] = np.nan
        yaw_rad = self._yaw_rad[before] + share * (self._yaw_rad[before + 1] - self._yaw_rad[before])
        since = rotations_from_quats(quats_from_rotation_vectors(share[:, np.newaxis] * self._turns[before]))
        return xyz, yaw_rad, self._attitudes[before] @ since


class _Model:
    """Innovations and bearings as a function of yaw offset, pitch trim and delay."""

    def __init__(self, camera: Camera, track: _Track, matches: _Matches) -> None:
        self._camera = camera
        self._track = track
        self.matches = matches

    def thinned(self, count: int) -> "_Model":
        """Return a model with about ``count`` detections, spread over the whole time."""
        step = max(len(self.matches) // count, 1)
        return _Model(self._camera, self._track, self.matches.where(slice(None, None, step)))

    def innovations_px(self, errors: Array) -> Array:
        """Return observed less predicted pixels [N, 2]; NaN without a prediction."""
        yaw_rad, pitch_rad, delay_s = errors.tolist()
        camera = replace(self._camera, pitch_trim_rad=self._camera.pitch_trim_rad + pitch_rad)
        to_landmarks, attitudes = self._lines_of_sight(yaw_rad, delay_s)
        in_body = turned(np.swapaxes(attitudes, 1, 2), turned(rotation_about_up(-yaw_rad), to_landmarks))
        return self.matches.uv_px - to_pixels(camera, turned(camera_R_body(camera), in_body)).uv_px

    def bearing_errors_rad(self, delay_s: float) -> tuple[Array, Array]:
        """Return bearing and elevation [N] of the landmarks less those of the detections, at a delay alone."""
        to_landmarks, attitudes = self._lines_of_sight(0.0, delay_s)
        seen = turned(camera_R_body(self._camera).T, rays(self._camera, self.matches.uv_px))
        azimuth, elevation = _angles(to_landmarks)
        seen_azimuth, seen_elevation = _angles(turned(attitudes, seen))
        return _wrapped(azimuth - seen_azimuth), elevation - seen_elevation

    def _lines_of_sight(self, yaw_rad: float, delay_s: float) -> tuple[Array, Array]:
        xyz, yaws_rad, attitudes = self._track.at(self.matches.t_s - delay_s)
        c, s = np.cos(yaws_rad + yaw_rad), np.sin(yaws_rad + yaw_rad)
        forward, left = self._camera.offset_forward_m, self._camera.offset_left_m
        offset = np.column_stack([c * forward - s * left, s * forward + c * left, np.zeros(len(c))])
        return self.matches.xyz - xyz - offset - (0.0, 0.0, self._camera.height_m), attitudes


def _angles(vectors: Array) -> tuple[Array, Array]:
    x, y, z = vectors.T
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


def _wrapped(angles_rad: Array) -> Array:
    wrapped: Array = np.remainder(angles_rad + math.pi, 2 * math.pi) - math.pi
    return wrapped


@dataclass(frozen=True, slots=True, eq=False)
class _Fitted:
    """Errors [3], their covariance [3, 3], and the innovations used [M, 2]."""

    errors: Array
    covariance: Array
    innovations_px: Array


def _first_look(model: _Model) -> tuple[Array, bool]:
    """Return initial errors [3], and whether there is enough motion to determine a delay."""
    few = model.thinned(_GRID_DETECTIONS)
    at_once = _medians(few, 0.0)[0]
    if not _moves(few, at_once):
        return at_once, False
    looks = (_medians(few, delay_s) for delay_s in np.arange(EARLIEST_S, LATEST_S + 0.5 * _GRID_S, _GRID_S).tolist())
    return min(looks, key=lambda look: look[1])[0], True


def _medians(model: _Model, delay_s: float) -> tuple[Array, float]:
    """Return the median errors [3] at a delay, and the median deviation from them in rad."""
    azimuths, elevations = model.bearing_errors_rad(delay_s)
    known = np.isfinite(azimuths)
    if not known.any():
        return np.array([0.0, 0.0, delay_s]), math.inf
    azimuths, elevations = azimuths[known], elevations[known]
    # Angles wrap, so the median is taken about their mean direction.
    middle = math.atan2(np.sin(azimuths).sum(), np.cos(azimuths).sum())
    azimuths = _wrapped(azimuths - middle)
    yaw_rad, pitch_rad = float(np.median(azimuths)), float(np.median(elevations))
    distance = np.median(np.abs(azimuths - yaw_rad)) + np.median(np.abs(elevations - pitch_rad))
    return np.array([math.remainder(middle + yaw_rad, 2 * math.pi), pitch_rad, delay_s]), float(distance)


def _moves(model: _Model, errors: Array) -> bool:
    speeds_px_s = np.hypot(*_slopes(model, errors)[:, :, 2].T)
    known = speeds_px_s[np.isfinite(speeds_px_s)]
    return bool(len(known)) and bool(np.quantile(known, 0.9) > LEAST_MOTION_PX_S)


def _slopes(model: _Model, errors: Array) -> Array:
    """Return the change of predictions [N, 2, 3] with each error."""
    steps = np.diag(_STEPS)
    changes = [model.innovations_px(errors - step) - model.innovations_px(errors + step) for step in steps]
    return np.stack([change / (2 * step.sum()) for change, step in zip(changes, steps, strict=True)], axis=-1)


def _refine(model: _Model, start: Array, tells_delay: bool) -> _Fitted | None:
    """Return the best fit with Cauchy's weights, then with least squares over its inliers."""
    errors, sigma_px = start, _LEAST_NOISE_PX
    for _ in range(_ROBUST_ROUNDS):
        innovations, slopes = _linear(model, errors, tells_delay)
        if len(innovations) < FEWEST_DETECTIONS:
            return None
        lengths = np.hypot(*innovations.T)
        sigma_px = max(float(np.median(lengths)) / _SIGMA_OF_MEDIAN, _LEAST_NOISE_PX)
        weights = 1 / (1 + (lengths / (_CAUCHY * sigma_px)) ** 2)
        step, _ = _solve(errors, innovations, slopes, weights / sigma_px**2)
        errors = errors + step
        if (np.abs(step) < _CONVERGED).all():
            break
    return _least_squares(model, errors, sigma_px, tells_delay)


def _least_squares(model: _Model, errors: Array, sigma_px: float, tells_delay: bool) -> _Fitted | None:
    covariance, kept = np.diag(np.square(PRIOR_SIGMA)), np.empty((0, 2))
    for _ in range(_LAST_ROUNDS):
        innovations, slopes = _linear(model, errors, tells_delay)
        agree = np.hypot(*innovations.T) < _INLIER_SIGMAS * sigma_px
        kept, slopes = innovations[agree], slopes[agree]
        if len(kept) < FEWEST_DETECTIONS:
            return None
        sigma_px = max(math.sqrt(float(np.square(kept).sum()) / (2 * len(kept) - 3)), _LEAST_NOISE_PX)
        step, covariance = _solve(errors, kept, slopes, np.full(len(kept), 1 / sigma_px**2))
        errors = errors + step
    return _Fitted(errors, covariance, kept)


def _linear(model: _Model, errors: Array, tells_delay: bool) -> tuple[Array, Array]:
    """Return the finite innovations [M, 2] and their slopes [M, 2, 3]."""
    innovations, slopes = model.innovations_px(errors), _slopes(model, errors)
    known = np.isfinite(innovations).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2))
    innovations, slopes = innovations[known], slopes[known]
    if not tells_delay:
        slopes[:, :, 2] = 0.0
    return innovations, slopes


def _solve(errors: Array, innovations: Array, slopes: Array, weights: Array) -> tuple[Array, Array]:
    """Return the step of Gauss-Newton [3] and the covariance [3, 3] of the result."""
    prior = np.diag(1 / np.square(PRIOR_SIGMA))
    rows, lefts = slopes.reshape(-1, 3), innovations.reshape(-1)
    weighted = rows * np.repeat(weights, 2)[:, np.newaxis]
    covariance: Array = np.linalg.inv(weighted.T.dot(rows) + prior)
    return covariance.dot(weighted.T.dot(lefts) - prior.dot(errors)), covariance


def _result(fitted: _Fitted | None, count: int) -> PoseErrors:
    if fitted is None:
        return _nothing(count)
    used = len(fitted.innovations_px)
    sigmas = np.sqrt(fitted.covariance.diagonal()).tolist()
    yaw_rad, pitch_rad, delay_s = fitted.errors.tolist()
    yaw, yaw_sigma = _told(math.remainder(yaw_rad, 2 * math.pi), sigmas[0], PRIOR_SIGMA[0])
    pitch, pitch_sigma = _told(pitch_rad, sigmas[1], PRIOR_SIGMA[1])
    delay, delay_sigma = _told(delay_s, sigmas[2], PRIOR_SIGMA[2])
    rms_px = math.sqrt(float(np.square(fitted.innovations_px).mean()))
    return PoseErrors(yaw, yaw_sigma, pitch, pitch_sigma, delay, delay_sigma, used, count - used, rms_px)


def _told(value: float, sigma: float, prior_sigma: float) -> tuple[float | None, float | None]:
    return (value, sigma) if sigma < 0.5 * prior_sigma else (None, None)


def _nothing(count: int) -> PoseErrors:
    return PoseErrors(None, None, None, None, None, None, 0, count, None)
