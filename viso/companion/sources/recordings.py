# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens each kind of recording."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from viso.companion.sources.base import Recording, SourceError, SourceOptions, Thinning, in_order_of_arrival
from viso.companion.sources.euroc import Image, load_euroc
from viso.companion.sources.gopro import read_telemetry
from viso.companion.sources.inertial_csv import read_inertial_csv
from viso.companion.sources.video import video_frames, video_size
from viso.companion.vio.calibration import load_calibration
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.types import CameraCalibration, SensorEvent
from viso.companion.world.flight import DEFAULT_FRAME_RATE_HZ, SyntheticFlight, nadir_calibration
from viso.geometry.rotation import quat_wxyz_from_rotation
from viso.geometry.trajectory import Trajectory

SYNTHETIC: Final = "synthetic"
KARMA: Final = Path(__file__).with_name("karma_hero5_854x480.toml")
_TRUTH_RATE_HZ: Final = 50


def open_euroc(options: SourceOptions) -> Recording:
    """Open a folder in the layout of the EuRoC data sets. Raises SourceError if a file in it cannot be used."""
    recording = load_euroc(Path(options.name))
    calibration = options.load_calibration() or recording.calibration
    images = _thinned(recording.images, options.fps)
    recording = dataclasses.replace(recording, calibration=calibration, images=images)
    return Recording(calibration, recording.events, recording.poses, recording.start())


def open_gopro(options: SourceOptions) -> Recording:
    """Open a GoPro's video; with a drone's positions, begin with the first frame after the first of these.

    Raises SourceError if the file cannot be used, or there is no calibration for pictures of its size.
    """
    path = Path(options.name)
    telemetry = read_telemetry(path)
    calibration = options.load_calibration() or _known_calibration(path)
    samples, drone = telemetry.samples, telemetry.drone
    start, poses, start_s = None, None, 0.0
    if drone is not None:
        start_s = max(float(drone.t_s[0]), 0.0)
        try:
            start, poses = drone.start_at(start_s, samples), drone.poses()
        except ValueError as error:
            raise SourceError(f"{path}: what the drone told: {error}") from error

    def data() -> Iterator[SensorEvent]:
        frames = video_frames(path, calibration, options.fps, round(start_s * 1e9))
        return in_order_of_arrival(samples, frames, calibration.time_offset_s)

    config = VioConfig(max_features=200)
    return Recording(calibration, data, poses, start, config, world_is_north=drone is not None)


def open_video(options: SourceOptions) -> Recording:
    """Open a video with inertial data in a file of their own.

    Raises SourceError if one of the files cannot be used or is missing.
    """
    path = Path(options.name)
    video_size(path)
    calibration = options.load_calibration()
    if options.imu is None or calibration is None:
        missing = "inertial data: --imu FILE.csv" if options.imu is None else "calibration: --calibration FILE"
        raise SourceError(f"{path}: a video without {missing}")
    samples = read_inertial_csv(options.imu, options.imu_start_s)

    def data() -> Iterator[SensorEvent]:
        return in_order_of_arrival(samples, video_frames(path, calibration, options.fps), calibration.time_offset_s)

    return Recording(calibration, data)


def open_synthetic(options: SourceOptions) -> Recording:
    """Make a flight over generated ground, whose name may hold a seed: ``synthetic:7``.

    Raises SourceError if what stands there is no seed.
    """
    seed = options.name.partition(":")[2] or "0"
    if not (seed.isascii() and seed.isdigit()):
        raise SourceError(f"{options.name}: {seed!r} is no seed")
    flight = SyntheticFlight(
        seed=int(seed),
        calibration=options.load_calibration() or nadir_calibration(),
        frame_rate_hz=options.fps or DEFAULT_FRAME_RATE_HZ,
    )
    config = VioConfig(scene=Scene.PLANAR, agl_source=AglSource.RANGEFINDER)
    return Recording(
        flight.calibration, flight.events, _true_poses(flight), flight.warm_start(), config, world_is_north=True
    )


def _thinned(images: tuple[Image, ...], fps: float | None) -> tuple[Image, ...]:
    periods_ns = np.diff([image.t_ns for image in images])
    thinning = Thinning(fps, float(np.median(periods_ns)) if len(periods_ns) else 0.0)
    return tuple(image for image in images if thinning.wants(image.t_ns))


def _known_calibration(path: Path) -> CameraCalibration:
    known = load_calibration(KARMA)
    size = video_size(path)
    if size != (known.width, known.height):
        raise SourceError(f"{path}: no calibration is known for {size[0]}x{size[1]} pixels: --calibration FILE")
    return known


def _true_poses(flight: SyntheticFlight) -> Trajectory:
    t_s = np.arange(0.0, flight.duration_s + 1.0, 1.0 / _TRUTH_RATE_HZ)
    motion = flight.trajectory.motion(t_s)
    quats = [quat_wxyz_from_rotation(rotation) for rotation in motion.rotation_wb]
    t_ns = flight.start_ns + np.round(t_s * 1e9).astype(np.int64)
    return Trajectory(t_ns, motion.position_w, np.array(quats))
