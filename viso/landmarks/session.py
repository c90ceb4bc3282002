# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From events to scenes: stores events, interpolates the pose of each picture, and keeps the data for a fit."""

import math
from collections import Counter, deque
from collections.abc import Reversible
from dataclasses import dataclass, field, replace
from typing import Any, Final

from viso.geometry.rotation import so3_exp, so3_log
from viso.landmarks.aircraft import STALE_AFTER_S, AircraftTracker
from viso.landmarks.local_frame import FrameMode, to_enu, to_geodetic
from viso.landmarks.receiver import PERIOD_S, ReceiverFilter, estimate_receiver, receiver_record
from viso.landmarks.scene import Scene, Situation, make_scene
from viso.landmarks.types import (
    AircraftReport,
    AircraftState,
    Camera,
    CameraInfo,
    Detections,
    EstimatedPosition,
    Event,
    GeodeticPoint,
    GlobalFix,
    Landmark,
    LandmarkMap,
    VehiclePose,
)

PICTURE_PERIOD_S: Final = 0.2
"""The period of scenes without detections."""
QUIET_S: Final = 1.0
"""The time after the last detections from which on scenes have none."""
LONGEST_GAP_S: Final = 1.5
"""The longest gap between two poses that a picture's pose is interpolated from."""
ALONE_S: Final = 0.1
"""A single pose serves a picture this near to it."""
CLOCK_STEP_S: Final = 5.0
"""A pose this much earlier than the last one means that the clock was set or restarted."""
_ROUNDING_S: Final = 1e-6
MOST_POSES: Final = 200_000
MOST_PICTURES: Final = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings of a session.

    Attributes:
        keeps_intrinsics: whether intrinsics in records are ignored.
        qnh_offset_m: correction of pressure altitudes; None if unknown.
        reference: the local origin on the globe; None for the first fix.
        from_estimate: whether estimated positions predict, where there are any, and not those of the odometry.
        full_attitude: whether roll and pitch of the vehicle are used, if known.
    """

    camera: Camera = field(default_factory=Camera)
    keeps_intrinsics: bool = False
    mode: FrameMode = FrameMode.WGS84
    qnh_offset_m: float | None = None
    reference: GeodeticPoint | None = None
    from_estimate: bool = False
    full_attitude: bool = False


@dataclass(frozen=True, slots=True)
class _Waiting:
    """A picture that waits for the pose after it, with the state at its arrival."""

    seen: Detections
    camera: Camera
    landmarks: tuple[Landmark, ...]
    states: tuple[AircraftState, ...]
    origin: GeodeticPoint | None


class Session:
    """Handles events in order of arrival, and returns a scene for each picture.

    Without detections there is a scene every 0.2 s. A picture waits for the pose after it, so that its own can be
    interpolated; ``finish`` completes all waiting pictures.

    Attributes:
        camera: the present camera model.
        dropped: number of unusable events by reason.
        poses: the newest 200 000.
        pictures: those of the newest 20 000 that had a pose.
        scenes: number of scenes so far.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.camera = settings.camera
        self._tracker = AircraftTracker(settings.mode, settings.qnh_offset_m)
        self._reference = settings.reference
        self._fix: GlobalFix | None = None
        self._estimated: EstimatedPosition | None = None
        self._landmarks: tuple[Landmark, ...] = ()
        self._all_landmarks: dict[str, Landmark] = {}
        self._waiting: deque[_Waiting] = deque()
        self._seen_s = self._scene_s = -math.inf
        self.dropped: Counter[str] = Counter()
        self.poses: deque[VehiclePose] = deque(maxlen=MOST_POSES)
        self.pictures: deque[Detections] = deque(maxlen=MOST_PICTURES)
        self.scenes = 0

    @property
    def landmarks(self) -> tuple[Landmark, ...]:
        """All landmarks ever known, at their last positions."""
        return tuple(self._all_landmarks.values())

    def take(self, event: Event) -> list[Scene]:
        """Handle an event; return the scenes that it completes."""
        match event:
            case VehiclePose():
                return self._take_pose(event)
            case Detections():
                return self._take_picture(event)
            case AircraftReport():
                self._tracker.add(event)
            case GlobalFix():
                self._take_fix(event)
            case EstimatedPosition():
                self._estimated = event
            case LandmarkMap():
                self._landmarks = event.landmarks
                self._all_landmarks.update({landmark.id: landmark for landmark in event.landmarks})
            case CameraInfo():
                self._take_camera(event)
        return []

    def finish(self) -> list[Scene]:
        """Return the scenes of the pictures that still wait."""
        return self._complete(math.inf)

    def _take_pose(self, received: VehiclePose) -> list[Scene]:
        pose = received if self._settings.full_attitude else replace(received, world_R_body=None)
        last_s = self.poses[-1].t_s if self.poses else -math.inf
        if pose.t_s < last_s - CLOCK_STEP_S:
            self.dropped["what came before the clock was set back"] += len(self.poses)
            self._forget()
        elif pose.t_s <= last_s:
            self.dropped["a pose that is not after the one before"] += 1
            return []
        self.poses.append(pose)
        if self._seen_s == -math.inf:
            self._seen_s = pose.t_s
        scenes = self._complete(pose.t_s)
        is_quiet = pose.t_s - self._seen_s >= QUIET_S
        if is_quiet and pose.t_s - self._scene_s >= PICTURE_PERIOD_S - _ROUNDING_S:
            scenes.append(self._scene(self._with_what_is_known(Detections(pose.t_s)), pose, has_detections=False))
        return scenes

    def _forget(self) -> None:
        self.poses.clear()
        self.pictures.clear()
        self._waiting.clear()
        self._seen_s = self._scene_s = -math.inf

    def _take_picture(self, detections: Detections) -> list[Scene]:
        scenes = self._complete(detections.t_s - LONGEST_GAP_S)
        self._seen_s = detections.t_s
        self._waiting.append(self._with_what_is_known(detections))
        return scenes + (self._complete(self.poses[-1].t_s) if self.poses else [])

    def _take_fix(self, fix: GlobalFix) -> None:
        if not fix.point.is_fix:
            self.dropped["no fix: (0, 0)"] += 1
            return
        self._fix = fix
        self._reference = self._reference or fix.point

    def _take_camera(self, info: CameraInfo) -> None:
        if info.fx_px == 0:
            self.dropped["a camera that is not calibrated"] += 1
        elif not self._settings.keeps_intrinsics:
            names = ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")
            try:
                self.camera = replace(self.camera, **{name: getattr(info, name) for name in names})
            except ValueError:
                self.dropped["a camera that cannot be"] += 1

    def _with_what_is_known(self, detections: Detections) -> _Waiting:
        origin = self._origin()
        states = () if origin is None else self._tracker.states(detections.t_s, origin)
        return _Waiting(detections, self.camera, self._landmarks, states, origin)

    def _origin(self) -> GeodeticPoint | None:
        """Return the vehicle's position, with the altitude of the reference."""
        reference = self._reference
        if reference is None:
            return None
        if self._fix is not None:
            return replace(self._fix.point, alt_m=reference.alt_m)
        if not self.poses:
            return None
        pose = self.poses[-1]
        return replace(to_geodetic(self._settings.mode, reference, pose.x_m, pose.y_m, 0.0), alt_m=reference.alt_m)

    def _complete(self, until_s: float) -> list[Scene]:
        """Return the scenes of the pictures up to a time."""
        scenes = []
        while self._waiting and self._waiting[0].seen.t_s <= until_s:
            waiting = self._waiting.popleft()
            pose = pose_at(self.poses, waiting.seen.t_s)
            if pose is None:
                self.dropped["a picture without a pose of its time"] += 1
                continue
            self.pictures.append(waiting.seen)
            scenes.append(self._scene(waiting, pose))
        return scenes

    def _scene(self, known: _Waiting, odometry: VehiclePose, *, has_detections: bool = True) -> Scene:
        self.scenes += 1
        self._scene_s = known.seen.t_s
        pose, has_qnh = self._predicting(odometry), self._settings.qnh_offset_m is not None
        situation = Situation(known.camera, pose, odometry, known.landmarks, known.states, known.origin, has_qnh)
        return make_scene(self.scenes, situation, known.seen, has_detections=has_detections)

    def _predicting(self, odometry: VehiclePose) -> VehiclePose:
        """Return the pose that predicts: the odometry's very object, or one at the east and north of the estimate."""
        estimated, reference = self._estimated, self._reference
        if not self._settings.from_estimate or reference is None or estimated is None or not estimated.point.is_fix:
            return odometry
        place = estimated.point
        enu = to_enu(self._settings.mode, reference, place.latitude_deg, place.longitude_deg, reference.alt_m)
        x_m, y_m, _ = enu.tolist()
        return replace(odometry, x_m=x_m, y_m=y_m)


class ReceiverWatch:
    """Estimates the receiver's position every 5 s, from the aircraft that it hears."""

    def __init__(self, mode: FrameMode) -> None:
        self._mode = mode
        self._filter = ReceiverFilter(mode)
        self._reports: dict[str, AircraftReport] = {}
        self._due_s: float | None = None

    def take(self, event: Event) -> tuple[EstimatedPosition, dict[str, Any]] | None:
        """Handle an event; return an estimate and its record if one is due and there are enough aircraft."""
        if isinstance(event, AircraftReport):
            self._reports[event.icao] = event
        if self._due_s is None or event.t_s < self._due_s - 2 * PERIOD_S:  # the first event, or the clock was set
            self._due_s = event.t_s + PERIOD_S
        if event.t_s < self._due_s:
            return None
        self._due_s = event.t_s + PERIOD_S
        estimate = estimate_receiver(self._reports.values(), event.t_s, self._mode)
        if estimate is None:
            return None
        heard = self._reports.items()
        self._reports = {icao: report for icao, report in heard if event.t_s - report.t_s <= STALE_AFTER_S}
        filtered = self._filter.update(estimate)
        record = {"t_s": event.t_s, **receiver_record(estimate, filtered)}
        return EstimatedPosition(event.t_s, filtered.point), record


def pose_at(poses: Reversible[VehiclePose], t_s: float) -> VehiclePose | None:
    """Return the pose at a time, interpolated between its neighbours; None if none is near."""
    after: VehiclePose | None = None
    before: VehiclePose | None = None
    for pose in reversed(poses):
        if pose.t_s <= t_s:
            before = pose
            break
        after = pose
    if before is not None and before.t_s == t_s:
        return before
    if before is not None and after is not None and after.t_s - before.t_s <= LONGEST_GAP_S:
        return _between(before, after, t_s)
    near = [pose for pose in (before, after) if pose is not None and abs(pose.t_s - t_s) <= ALONE_S]
    return min(near, key=lambda pose: abs(pose.t_s - t_s), default=None)


def _between(before: VehiclePose, after: VehiclePose, t_s: float) -> VehiclePose:
    share = (t_s - before.t_s) / (after.t_s - before.t_s)
    turn = math.remainder(after.yaw_rad - before.yaw_rad, 2 * math.pi)
    z_m = None if before.z_m is None or after.z_m is None else before.z_m + share * (after.z_m - before.z_m)
    attitude = before.world_R_body
    if attitude is not None and after.world_R_body is not None:
        attitude = attitude.dot(so3_exp(share * so3_log(attitude.T.dot(after.world_R_body))))
    return VehiclePose(
        t_s,
        before.x_m + share * (after.x_m - before.x_m),
        before.y_m + share * (after.y_m - before.y_m),
        before.yaw_rad + share * turn,
        z_m,
        attitude,
    )
