# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording in the layout of the EuRoC data sets (Burri et al., The EuRoC micro aerial vehicle datasets, 2016).

In a folder, or in ``mav0`` within it: pictures of one camera in ``cam0/data`` or ``cam0``, named by their stamps in ns;
its calibration in ``cam0/sensor.yaml`` or ``cam0_sensor.yaml``; inertial data in ``imu0/data.csv`` or ``imu0.csv`` (ns,
rotation rate in rad/s, specific force in m/s^2); and, if there is one, the true trajectory of the IMU in
``state_groundtruth_estimate0/data.csv``, ``groundtruth.csv`` or ``groundtruth.tum``. Pictures need the extra vio.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from viso.companion.sources.base import SourceError, make_frame
from viso.companion.sources.video import check_size, opencv
from viso.companion.vio.calibration import CalibrationError, load_calibration
from viso.companion.vio.types import CameraCalibration, ImuBias, ImuSample, NavCameraFrame, Pixels, WarmStartPose
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array
from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import EUROC, TUM, Row, TrajectoryError, read_text, rows_of, table_records, usable

_CAMERAS: Final = ("cam0/data", "cam0")
_CALIBRATIONS: Final = ("cam0/sensor.yaml", "cam0_sensor.yaml")
_IMUS: Final = ("imu0/data.csv", "imu0.csv")
_TRUTHS: Final = ("state_groundtruth_estimate0/data.csv", "groundtruth.csv", "groundtruth.tum")
_IMU_COLUMNS: Final = 7
_VELOCITY_NS: Final = 10_000_000  # to either side, for a velocity by differences


@dataclass(frozen=True, slots=True)
class Image:
    """A picture that has not been decoded: its stamp and its file."""

    t_ns: int
    path: Path


@dataclass(frozen=True, slots=True, eq=False)
class EurocRecording:
    """A recording, in the order of time; ``poses`` are the true trajectory, None if there is none.

    To use a part of it, or fewer frames, replace ``images``.
    """

    calibration: CameraCalibration
    images: tuple[Image, ...]
    samples: tuple[ImuSample, ...]
    poses: Trajectory | None

    def events(self) -> Iterator[ImuSample | NavCameraFrame]:
        """Yield the data as they arrive, each frame after the first IMU sample that is not before it.

        Raises SourceError if a picture cannot be decoded or has another size than the calibration's.
        """
        samples = iter(self.samples)
        last_ns = -1
        for sequence, image in enumerate(self.images):
            while last_ns < image.t_ns and (sample := next(samples, None)) is not None:
                last_ns = sample.t_ns
                yield sample
            yield make_frame(sequence, image.t_ns, self._decoded(image.path), self.calibration.camera_id)

    def truth(self, t_ns: int) -> SE3 | None:
        """Return world_T_body at a time, interpolated, or None if it is outside the true trajectory."""
        return None if self.poses is None else self.poses.at(t_ns)

    def truth_velocity_w(self, t_ns: int) -> Array | None:
        """Return the velocity [3] in m/s, in the world, by the positions 10 ms before and after, or None."""
        before, after = self.truth(t_ns - _VELOCITY_NS), self.truth(t_ns + _VELOCITY_NS)
        if before is None or after is None:
            return None
        velocity: Array = (after.t - before.t) / (2e-9 * _VELOCITY_NS)
        return velocity

    def start(self) -> WarmStartPose | None:
        """Return the true state at the first picture, None if it is not known; the biases are not known."""
        t_ns = self.images[0].t_ns
        pose, velocity_w = self.truth(t_ns), self.truth_velocity_w(t_ns)
        if pose is None or velocity_w is None:
            return None
        return WarmStartPose(pose.inverse(), pose.R.T.dot(velocity_w), ImuBias.zero())

    def _decoded(self, path: Path) -> Pixels:
        cv2 = opencv()
        pixels: Pixels | None = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if pixels is None:
            raise SourceError(f"{path}: not a picture, or a damaged one")
        height, width = pixels.shape
        check_size(path, (width, height), self.calibration)
        return pixels


def load_euroc(folder: Path) -> EurocRecording:
    """Read all of a recording but the pictures, of which only the names are looked at.

    Raises SourceError, naming the file, and the line where that is to blame.
    """
    root = folder / "mav0" if (folder / "mav0").is_dir() else folder
    truth = _find(root, _TRUTHS)
    try:
        return EurocRecording(
            load_calibration(_required(root, _CALIBRATIONS)),
            _images(_required(root, _CAMERAS)),
            _samples(_required(root, _IMUS)),
            None if truth is None else _poses(truth),
        )
    except (CalibrationError, TrajectoryError) as error:
        raise SourceError(str(error)) from error


def _find(root: Path, names: tuple[str, ...]) -> Path | None:
    return next((root / name for name in names if (root / name).exists()), None)


def _required(root: Path, names: tuple[str, ...]) -> Path:
    found = _find(root, names)
    if found is None:
        raise SourceError(f"{root}: no {' or '.join(names)}")
    return found


def _images(folder: Path) -> tuple[Image, ...]:
    paths = sorted(folder.glob("*.png"), key=lambda path: (len(path.stem), path.stem))
    if not paths:
        raise SourceError(f"{folder}: no pictures (*.png)")
    for path in paths:
        if not (path.stem.isascii() and path.stem.isdigit()):
            raise SourceError(f"{path}: not named by a stamp in ns")
    return tuple(Image(int(path.stem), path) for path in paths)


def _samples(path: Path) -> tuple[ImuSample, ...]:
    samples = tuple(_sample(path, row) for row in rows_of(read_text(path)))
    if not samples:
        raise SourceError(f"{path}: no records")
    for before, after in itertools.pairwise(samples):
        if after.t_ns <= before.t_ns:
            raise SourceError(f"{path}: stamp {after.t_ns} is not after the one before")
    return samples


def _sample(path: Path, row: Row) -> ImuSample:
    if len(row.fields) < _IMU_COLUMNS:
        raise SourceError(f"{path}:{row.number}: {len(row.fields)} columns, not {_IMU_COLUMNS}")
    try:
        values = np.array([float(field) for field in row.fields[1:_IMU_COLUMNS]])
        return ImuSample.checked(int(row.fields[0]), values[3:], values[:3])
    except ValueError as error:
        raise SourceError(f"{path}:{row.number}: {error}") from error


def _poses(path: Path) -> Trajectory:
    return usable(table_records(path, EUROC if path.suffix == ".csv" else TUM))
