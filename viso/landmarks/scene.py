# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One moment: predictions and detections, for the picture and for the innovations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.geometry.rotation import Array
from viso.landmarks.aircraft import drawn
from viso.landmarks.observation import (
    AIRCRAFT_NEAREST_M,
    LANDMARK_NEAREST_M,
    Projection,
    back_project,
    camera_centre,
    project,
)
from viso.landmarks.residuals import (
    Residuals,
    aircraft_points,
    aircraft_residuals,
    first_of_each,
    landmark_residuals,
)
from viso.landmarks.types import (
    AircraftState,
    Camera,
    Detection,
    Detections,
    GeodeticPoint,
    Landmark,
    VehiclePose,
)

Pixel = tuple[float, float]
"""Right and down of the picture's corner."""
ODOMETRY_LABEL: Final = "odom"
ESTIMATED_LABEL: Final = "estimated"
_UPRIGHT: Final = 1e-9  # of a horizon from the top of the picture to its bottom


@dataclass(frozen=True, slots=True)
class Mark:
    """A landmark or an aircraft at one moment.

    Attributes:
        id: the landmark's, or the aircraft's address.
        x_m, y_m: east and north of the local origin.
        predicted: predicted pixel; None if it cannot be in the picture.
        actual: actual pixel; None if unknown.
        in_image: whether the prediction is inside the picture.
        range_m: horizontal distance, of a landmark from the camera, of an aircraft from the vehicle.
        seen: whether the actual pixel was detected in the picture; else it is the prediction of raw odometry.
        elevation_rad: above the horizon of the camera; None if the height is not known.
        azimuth_rad: from the view, positive to the left.
        is_baro: whether its height is from uncorrected pressure altitude.
    """

    id: str
    x_m: float
    y_m: float
    predicted: Pixel | None
    actual: Pixel | None
    in_image: bool
    range_m: float
    seen: bool = True
    elevation_rad: float | None = None
    azimuth_rad: float = 0.0
    is_baro: bool = False


@dataclass(frozen=True, slots=True)
class Situation:
    """The known state at one moment.

    Attributes:
        pose: the predicting pose.
        odometry: the reported odometry.
        states: the aircraft.
        origin: origin of the states; None without a fix.
        has_qnh: whether pressure altitudes were corrected.
    """

    camera: Camera
    pose: VehiclePose
    odometry: VehiclePose
    landmarks: tuple[Landmark, ...] = ()
    states: tuple[AircraftState, ...] = ()
    origin: GeodeticPoint | None = None
    has_qnh: bool = False

    @property
    def is_estimated(self) -> bool:
        """Whether the predicting pose is not the odometry."""
        return self.pose is not self.odometry

    @property
    def label(self) -> str:
        """The name of the predicting pose."""
        return ESTIMATED_LABEL if self.is_estimated else ODOMETRY_LABEL

    @property
    def view_yaw_rad(self) -> float:
        """The direction of the camera's view, ENU."""
        return self.pose.yaw_rad + self.camera.heading_offset_rad + self.camera.yaw_trim_rad

    @property
    def camera_xyz(self) -> Array:
        """The camera's position, ENU [3] in m."""
        return camera_centre(self.camera, self.pose)


@dataclass(frozen=True, slots=True)
class Scene:
    """One moment, by the clock of the input.

    Attributes:
        number: from 1.
        aircraft: those that are neither too near nor too far to be drawn.
        has_detections: whether a picture was searched for detections at that moment.
    """

    t_s: float
    number: int
    situation: Situation
    landmarks: tuple[Mark, ...]
    aircraft: tuple[Mark, ...]
    landmark_residuals: Residuals
    aircraft_residuals: Residuals
    has_detections: bool = True


def make_scene(number: int, situation: Situation, detections: Detections, *, has_detections: bool = True) -> Scene:
    """Predict all known landmarks and aircraft, and compare with the detections."""
    camera, pose, odometry = situation.camera, situation.pose, situation.odometry
    return Scene(
        detections.t_s,
        number,
        situation,
        _landmark_marks(situation, detections.landmarks),
        _aircraft_marks(situation, detections.aircraft),
        landmark_residuals(camera, pose, situation.landmarks, detections),
        aircraft_residuals(camera, pose, situation.states, detections, odometry),
        has_detections,
    )


def horizon(situation: Situation) -> tuple[Pixel, Pixel] | None:
    """Return the ends of the horizon at the left and the right edge of the picture; None if it is not in it.

    It is computed from the plane of horizontal directions, so it leans with the vehicle if its roll is known.
    """
    camera = situation.camera
    cx, cy, fx, fy = camera.cx_px, camera.cy_px, camera.fx_px, camera.fy_px
    up = back_project(camera, situation.pose, [(cx, cy), (cx + fx, cy), (cx, cy + fy)])[:, 2].tolist()
    # Up to their lengths, which are taken out, the directions are linear in the pixels.
    across, down = up[1] * math.sqrt(2) - up[0], up[2] * math.sqrt(2) - up[0]
    if abs(down) < _UPRIGHT:
        return None
    ends = [(u, cy - fy * (up[0] + across * (u - cx) / fx) / down) for u in (0.0, float(camera.width_px))]
    (left_u, left_v), (right_u, right_v) = ends
    is_inside = min(left_v, right_v) <= camera.height_px and max(left_v, right_v) >= 0
    return ((left_u, left_v), (right_u, right_v)) if is_inside else None


def _landmark_marks(situation: Situation, detections: Sequence[Detection]) -> tuple[Mark, ...]:
    camera_x, camera_y, _ = situation.camera_xyz.tolist()
    points = np.array([(landmark.x_m, landmark.y_m, landmark.z_m) for landmark in situation.landmarks]).reshape(-1, 3)
    predicted, inside = _pixels(project(situation.camera, situation.pose, points, LANDMARK_NEAREST_M))
    actual = _places(detections)
    return tuple(
        Mark(
            landmark.id,
            landmark.x_m,
            landmark.y_m,
            predicted[index],
            actual.get(landmark.id),
            inside[index],
            math.hypot(landmark.x_m - camera_x, landmark.y_m - camera_y),
        )
        for index, landmark in enumerate(situation.landmarks)
    )


def _aircraft_marks(situation: Situation, detections: Sequence[Detection]) -> tuple[Mark, ...]:
    camera = situation.camera
    states = [state for state in situation.states if drawn(state)]
    points = aircraft_points(states, situation.odometry)
    predicted, inside = _pixels(project(camera, situation.pose, points, AIRCRAFT_NEAREST_M))
    by_odometry: list[Pixel | None] = [None] * len(states)
    if situation.is_estimated:
        by_odometry, _ = _pixels(project(camera, situation.odometry, points, AIRCRAFT_NEAREST_M))
    actual = _places(detections)
    rows = zip(states, points, predicted, inside, by_odometry, strict=True)
    return tuple(
        Mark(
            state.report.icao,
            float(point[0]),
            float(point[1]),
            pixel,
            actual.get(state.report.icao, raw),
            is_inside,
            state.range_m,
            state.report.icao in actual,
            *_in_the_sky(situation, point),
            state.report.is_baro and not situation.has_qnh,
        )
        for state, point, pixel, is_inside, raw in rows
    )


def _in_the_sky(situation: Situation, point: Array) -> tuple[float | None, float]:
    """Return elevation, None where the height is not known, and azimuth from the view."""
    east, north, up = (point - situation.camera_xyz).tolist()
    elevation = None if math.isnan(up) else math.atan2(up, math.hypot(east, north))
    return elevation, math.remainder(math.atan2(north, east) - situation.view_yaw_rad, 2 * math.pi)


def _pixels(projection: Projection) -> tuple[list[Pixel | None], list[bool]]:
    pixels = [None if math.isnan(u) else (u, v) for u, v in projection.uv_px.tolist()]
    return pixels, projection.in_image.tolist()


def _places(detections: Sequence[Detection]) -> dict[str, Pixel]:
    return {name: (detection.u_px, detection.v_px) for name, detection in first_of_each(detections)[0].items()}
