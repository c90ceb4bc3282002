# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A synthetic flight before landmarks and aircraft, with errors that are known: for the demonstration and for tests.

A small vehicle sways and turns in front of five landmarks, 3 m above the ground. Poses come at 20 Hz, pictures at 5 Hz,
reports of aircraft once a second. Without noise and planted errors every innovation is exactly 0.
"""

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from viso.landmarks.aircraft import AircraftTracker
from viso.landmarks.local_frame import FrameMode, to_geodetic
from viso.landmarks.residuals import Innovation, aircraft_residuals, landmark_residuals
from viso.landmarks.types import (
    M_PER_FT,
    M_S_PER_FT_MIN,
    M_S_PER_KT,
    AircraftReport,
    Camera,
    Detection,
    Detections,
    Event,
    GeodeticPoint,
    GlobalFix,
    Landmark,
    LandmarkMap,
    VehiclePose,
)

POSE_RATE_HZ: Final = 20
PICTURE_RATE_HZ: Final = 5
_POSES_A_PICTURE: Final = POSE_RATE_HZ // PICTURE_RATE_HZ
HEIGHT_M: Final = 3.0
REFERENCE: Final = GeodeticPoint(47.3977, 8.5456, 488.0)
LANDMARKS: Final = tuple(Landmark(str(index), 10.0 + 5 * index, 5.0 + 3 * index) for index in range(5))
"""East and north of where the vehicle is at the start."""


@dataclass(frozen=True, slots=True)
class Planted:
    """The planted errors of reported yaw, pitch trim and picture stamps, as a fit should find them."""

    yaw_offset_rad: float = 0.0
    pitch_trim_rad: float = 0.0
    delay_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Traffic:
    """An aircraft on a straight or a circular path.

    Attributes:
        start_enu: of the reference, in m.
        speed_m_s, climb_m_s: over ground, and up.
        heading_deg: at the start, clockwise from north.
        turn_deg_s: clockwise.
    """

    icao: str
    start_enu: tuple[float, float, float]
    speed_m_s: float
    heading_deg: float
    climb_m_s: float = 0.0
    turn_deg_s: float = 0.0
    tells_altitude: bool = True

    def heading_rad(self, t_s: float) -> float:
        """Return the heading, clockwise from north, unwrapped."""
        return math.radians(self.heading_deg + self.turn_deg_s * t_s)

    def enu(self, t_s: float) -> tuple[float, float, float]:
        """Return where it is at a time."""
        start, end, turn = self.heading_rad(0.0), self.heading_rad(t_s), math.radians(self.turn_deg_s)
        if turn == 0:
            east, north = t_s * math.sin(start), t_s * math.cos(start)
        else:
            east, north = (math.cos(start) - math.cos(end)) / turn, (math.sin(end) - math.sin(start)) / turn
        x, y, z = self.start_enu
        return x + self.speed_m_s * east, y + self.speed_m_s * north, z + self.climb_m_s * t_s


TRAFFIC: Final = (
    Traffic("3C6481", (2500.0, 2900.0, 850.0), 45.0, 110.0),
    Traffic("4B1803", (5200.0, 1800.0, 1500.0), 60.0, 20.0, climb_m_s=4.0),
    Traffic("4B43AA", (-2500.0, 3000.0, 600.0), 40.0, 250.0, turn_deg_s=3.0),
    Traffic("440172", (-1800.0, -4200.0, 2200.0), 70.0, 300.0, climb_m_s=-3.0),
    Traffic("3E12FF", (1500.0, -2600.0, 300.0), 30.0, 90.0, tells_altitude=False),
    Traffic("A0B1C2", (14_000.0, 9000.0, 10_000.0), 220.0, 270.0),
)


@dataclass(frozen=True, slots=True)
class SyntheticFlight:
    """A flight.

    Attributes:
        camera: the assumed camera; the true one differs by the planted trim.
        noise_px: sigma of each detection, in both axes.
        wrong_share: share of detections with the id of another landmark.
        mode, qnh_offset_m: the reader's local frame and altitude correction for aircraft.
    """

    camera: Camera = field(default_factory=Camera)
    planted: Planted = Planted()
    noise_px: float = 0.0
    wrong_share: float = 0.0
    seed: int = 0
    duration_s: float = 60.0
    traffic: tuple[Traffic, ...] = TRAFFIC
    mode: FrameMode = FrameMode.WGS84
    qnh_offset_m: float | None = None

    def truth(self, t_s: float) -> VehiclePose:
        """Return the true pose at a time."""
        x, y = 2.0 * math.sin(2 * math.pi * t_s / 20), 5.0 * math.sin(2 * math.pi * t_s / 16)
        yaw = 0.5 + 0.22 * math.sin(2 * math.pi * t_s / 12)
        return VehiclePose(t_s, x, y, yaw, HEIGHT_M)

    def reported(self, t_s: float) -> VehiclePose:
        """Return the reported pose."""
        pose = self.truth(t_s)
        return replace(pose, yaw_rad=pose.yaw_rad - self.planted.yaw_offset_rad)

    def events(self) -> Iterator[Event]:
        """Yield the records in the order of arrival; pictures come as late as their stamps say."""
        yield LandmarkMap(0.0, LANDMARKS)
        pictures = self._pictures()
        yield from heapq.merge(self._telemetry(), pictures, key=lambda event: event.t_s)

    def _times_s(self, rate_hz: int) -> Iterator[float]:
        return (index / rate_hz for index in range(math.floor(self.duration_s * rate_hz) + 1))

    def _telemetry(self) -> Iterator[Event]:
        for index, t_s in enumerate(self._times_s(POSE_RATE_HZ)):
            if index % POSE_RATE_HZ == 0:
                yield from self._reports(t_s)
            if index % _POSES_A_PICTURE == 0:
                yield self._fix(t_s)
            yield self.reported(t_s)

    def _fix(self, t_s: float) -> GlobalFix:
        pose = self.truth(t_s)
        return GlobalFix(t_s, _geodetic(pose.x_m, pose.y_m, HEIGHT_M))

    def _reports(self, t_s: float) -> Iterator[AircraftReport]:
        for aircraft in self.traffic:
            point = _geodetic(*aircraft.enu(t_s))
            yield AircraftReport(
                t_s,
                aircraft.icao,
                point.latitude_deg,
                point.longitude_deg,
                point.alt_m / M_PER_FT if aircraft.tells_altitude else None,
                aircraft.speed_m_s / M_S_PER_KT,
                math.degrees(aircraft.heading_rad(t_s)) % 360,
                aircraft.climb_m_s / M_S_PER_FT_MIN,
            )

    def _pictures(self) -> Iterator[Detections]:
        trim_rad = self.camera.pitch_trim_rad + self.planted.pitch_trim_rad
        camera, rng = replace(self.camera, pitch_trim_rad=trim_rad), np.random.default_rng(self.seed)
        tracker = AircraftTracker(self.mode, self.qnh_offset_m)
        alt_m = self._fix(0.0).point.alt_m
        for index, t_s in enumerate(self._times_s(PICTURE_RATE_HZ)):
            if index % PICTURE_RATE_HZ == 0:
                for report in self._reports(t_s):
                    tracker.add(report)
            origin = replace(self._fix(t_s).point, alt_m=alt_m)
            states = tracker.states(t_s, origin)
            pose, everywhere = self.truth(t_s), _everywhere(t_s, [state.report.icao for state in states])
            yield Detections(
                t_s + self.planted.delay_s,
                self._seen(rng, landmark_residuals(camera, pose, LANDMARKS, everywhere).innovations),
                self._seen(rng, aircraft_residuals(camera, pose, states, everywhere).innovations),
            )

    def _seen(self, rng: np.random.Generator, innovations: Sequence[Innovation]) -> tuple[Detection, ...]:
        """Return the detections of a picture, some with a wrong id."""
        inside = [innovation for innovation in innovations if innovation.in_image]
        noise = self.noise_px * rng.standard_normal((len(inside), 2))
        sources = list(range(len(inside)))
        for index in np.flatnonzero(rng.random(len(inside)) < self.wrong_share).tolist():
            sources[index] = (index + int(rng.integers(1, max(len(inside), 2)))) % len(inside)
        return tuple(
            Detection(innovation.id, inside[source].predicted_u_px + du, inside[source].predicted_v_px + dv)
            for innovation, source, (du, dv) in zip(inside, sources, noise.tolist(), strict=True)
        )


def _everywhere(t_s: float, icaos: Sequence[str]) -> Detections:
    """Return dummy detections of everything, used to get its predictions."""
    ids = [landmark.id for landmark in LANDMARKS]
    landmarks, aircraft = (tuple(Detection(name, 0.0, 0.0) for name in names) for names in (ids, icaos))
    return Detections(t_s, landmarks, aircraft)


def _geodetic(x_m: float, y_m: float, z_m: float) -> GeodeticPoint:
    return to_geodetic(FrameMode.SPHERICAL, REFERENCE, x_m, y_m, z_m)
