# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Innovations, observed less predicted pixels, and their statistics."""

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.geometry.rotation import Array
from viso.landmarks.observation import (
    AIRCRAFT_NEAREST_M,
    LANDMARK_NEAREST_M,
    Projection,
    camera_centre,
    project,
)
from viso.landmarks.types import AircraftState, Camera, Detection, Detections, Landmark, VehiclePose

_SIGMA_OF_MAD: Final = 1.4826
"""For normal noise."""

Pixels = tuple[float, float]
"""To the right, and down."""


@dataclass(frozen=True, slots=True)
class Innovation:
    """Of one landmark or aircraft.

    Attributes:
        id: the landmark's, or the aircraft's address.
        predicted_u_px, predicted_v_px: by the pose.
        observed_u_px, observed_v_px: in the picture.
        in_image: whether the prediction is inside the picture.
        range_m: horizontal distance of a landmark from the camera, of an aircraft from the vehicle.
    """

    id: str
    predicted_u_px: float
    predicted_v_px: float
    observed_u_px: float
    observed_v_px: float
    in_image: bool
    range_m: float

    @property
    def du_px(self) -> float:
        """Observed less predicted, to the right."""
        return self.observed_u_px - self.predicted_u_px

    @property
    def dv_px(self) -> float:
        """Observed less predicted, down."""
        return self.observed_v_px - self.predicted_v_px


@dataclass(frozen=True, slots=True)
class Residuals:
    """Of one picture; all ids are in the order of the detections.

    Attributes:
        innovations: of what was seen, is known and has a prediction.
        unmatched: ids that were detected, but are unknown.
        not_projected: known ids that were detected, but are not ahead of the camera, or whose height is unknown.
        duplicates: ids that were detected more than once; only the first of each counts.
    """

    innovations: tuple[Innovation, ...]
    unmatched: tuple[str, ...] = ()
    not_projected: tuple[str, ...] = ()
    duplicates: tuple[str, ...] = ()


def first_of_each(detections: Sequence[Detection]) -> tuple[dict[str, Detection], tuple[str, ...]]:
    """Return the first detection of each id, and the ids that have more than one."""
    first: dict[str, Detection] = {}
    again: dict[str, None] = {}
    for detection in detections:
        if first.setdefault(detection.id, detection) is not detection:
            again[detection.id] = None
    return first, tuple(again)


def landmark_residuals(
    camera: Camera, pose: VehiclePose, landmarks: Sequence[Landmark], detections: Detections
) -> Residuals:
    """Compare the landmarks of a picture with their prediction by the pose when it was taken."""
    xyz = np.array([(landmark.x_m, landmark.y_m, landmark.z_m) for landmark in landmarks]).reshape(-1, 3)
    projection = project(camera, pose, xyz, LANDMARK_NEAREST_M)
    across = xyz[:, :2] - camera_centre(camera, pose)[:2]
    ranges_m = np.hypot(across[:, 0], across[:, 1]).tolist()
    ids = [landmark.id for landmark in landmarks]
    return _residuals(detections.landmarks, ids, projection, ranges_m)


def aircraft_points(states: Sequence[AircraftState], odometry: VehiclePose) -> Array:
    """Return the positions of aircraft, ENU [N, 3] in m; z is NaN if the altitude is unknown.

    East and north are relative to the vehicle's odometry position. Up is that of the state, above the ground that the
    camera's height counts from: no reference altitude is added.
    """
    rows = [
        (odometry.x_m + state.east_m, odometry.y_m + state.north_m, np.nan if state.up_m is None else state.up_m)
        for state in states
    ]
    return np.array(rows).reshape(-1, 3)


def aircraft_residuals(
    camera: Camera,
    pose: VehiclePose,
    states: Sequence[AircraftState],
    detections: Detections,
    odometry: VehiclePose | None = None,
) -> Residuals:
    """Compare the aircraft of a picture with their prediction by a pose.

    Their east and north count from ``odometry``; None if that is ``pose``.
    """
    points = aircraft_points(states, pose if odometry is None else odometry)
    projection = project(camera, pose, points, AIRCRAFT_NEAREST_M)
    ids, ranges_m = [state.report.icao for state in states], [state.range_m for state in states]
    return _residuals(detections.aircraft, ids, projection, ranges_m)


def _residuals(
    detections: Sequence[Detection], ids: Sequence[str], projection: Projection, ranges_m: Sequence[float]
) -> Residuals:
    first, duplicates = first_of_each(detections)
    places = {name: index for index, name in enumerate(ids)}
    predicted, in_image = projection.uv_px.tolist(), projection.in_image.tolist()
    innovations, unmatched, not_projected = [], [], []
    for name, detection in first.items():
        at = places.get(name)
        if at is None:
            unmatched.append(name)
            continue
        u_px, v_px = predicted[at]
        if math.isnan(u_px):
            not_projected.append(name)
        else:
            innovations.append(Innovation(name, u_px, v_px, detection.u_px, detection.v_px, in_image[at], ranges_m[at]))
    return Residuals(tuple(innovations), tuple(unmatched), tuple(not_projected), duplicates)


@dataclass(frozen=True, slots=True)
class InnovationStatistics:
    """Of some innovations, in px.

    Attributes:
        count: how many; with none the rest is NaN.
        mean, median: of them.
        spread: standard deviation.
        robust_spread: the same from the median distance to the median: wrong matches hardly count.
    """

    count: int
    mean: Pixels
    median: Pixels
    spread: Pixels
    robust_spread: Pixels


@dataclass(frozen=True, slots=True)
class Summary:
    """Of many pictures.

    Attributes:
        pictures: how many.
        per_id: of each landmark's or aircraft's, in the order of appearance.
        unmatched, not_projected, duplicates: how often each id was one.
    """

    pictures: int
    overall: InnovationStatistics
    per_id: Mapping[str, InnovationStatistics]
    unmatched: Mapping[str, int]
    not_projected: Mapping[str, int]
    duplicates: Mapping[str, int]


def innovation_statistics(innovations: Sequence[Innovation]) -> InnovationStatistics:
    if not innovations:
        none = (float("nan"), float("nan"))
        return InnovationStatistics(0, none, none, none, none)
    values = np.array([(innovation.du_px, innovation.dv_px) for innovation in innovations])
    median = np.median(values, axis=0)
    mad = np.median(np.abs(values - median), axis=0)
    figures = values.mean(axis=0), median, values.std(axis=0), _SIGMA_OF_MAD * mad
    return InnovationStatistics(len(innovations), *((float(u), float(v)) for u, v in figures))


def summarise(pictures: Collection[Residuals]) -> Summary:
    per_id: defaultdict[str, list[Innovation]] = defaultdict(list)
    everything = [innovation for picture in pictures for innovation in picture.innovations]
    for innovation in everything:
        per_id[innovation.id].append(innovation)
    return Summary(
        len(pictures),
        innovation_statistics(everything),
        {name: innovation_statistics(its) for name, its in per_id.items()},
        Counter(name for picture in pictures for name in picture.unmatched),
        Counter(name for picture in pictures for name in picture.not_projected),
        Counter(name for picture in pictures for name in picture.duplicates),
    )
