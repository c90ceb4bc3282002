# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a video file; they need the extra vio."""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, cast

from viso.companion.sources.base import SourceError, Thinning, make_frame
from viso.companion.vio.types import CameraCalibration, NavCameraFrame, Pixels
from viso.extras import pip_install

_NS_PER_MS: Final = 1e6
_SILENT: Final = "-8"
"""What is wrong with a file is ours to tell; FFmpeg would write to standard error on its own."""


def opencv() -> Any:
    """Return the module cv2. Raises SourceError if it is not installed; says what to install."""
    try:
        import cv2
    except ModuleNotFoundError as error:
        raise SourceError(f"pictures need OpenCV: {pip_install('vio')}") from error
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", _SILENT)
    return cv2


def video_size(path: Path) -> tuple[int, int]:
    """Return width and height of a video in pixels. Raises SourceError if it cannot be opened."""
    cv2 = opencv()
    with _opened(path) as capture:
        return round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))


def video_frames(
    path: Path, calibration: CameraCalibration, fps: float | None = None, start_ns: int = 0
) -> Iterator[NavCameraFrame]:
    """Yield the frames of a video from a time on, ``fps`` of them a second, stamped with the time since its start.

    Raises SourceError if the file cannot be opened, holds no frame, or frames of another size than the calibration's.
    """
    check_size(path, video_size(path), calibration)
    sequence = 0
    with _opened(path) as capture:
        for t_ns in _chosen(capture, fps, start_ns):
            decoded, pixels = capture.retrieve()
            if decoded:
                yield make_frame(sequence, t_ns, cast(Pixels, pixels), calibration.camera_id)
                sequence += 1
    if sequence == 0:
        raise SourceError(f"{path}: no frame that can be decoded")


def check_size(name: object, size: tuple[int, int], calibration: CameraCalibration) -> None:
    """Raise SourceError if pictures of a file or device have another width and height than the calibration's."""
    if size != (calibration.width, calibration.height):
        expected = f"{calibration.width}x{calibration.height}"
        raise SourceError(f"{name}: {size[0]}x{size[1]} pixels, the calibration is for {expected}")


def _chosen(capture: Any, fps: float | None, start_ns: int) -> Iterator[int]:
    """Grab frame by frame; yield the times of those that are wanted."""
    cv2 = opencv()
    thinning = Thinning(fps, 1e9 / max(capture.get(cv2.CAP_PROP_FPS), 1e-3))
    last_ns = start_ns - 1
    while capture.grab():
        t_ms = capture.get(cv2.CAP_PROP_POS_MSEC)
        t_ns = round(t_ms * _NS_PER_MS) if math.isfinite(t_ms) else -1
        if t_ns > last_ns and thinning.wants(t_ns):
            yield t_ns
        last_ns = max(last_ns, t_ns)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    if not path.is_file():
        raise SourceError(f"{path}: {'not a file' if path.exists() else 'No such file or directory'}")
    capture = opencv().VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise SourceError(f"{path}: not a video, or a damaged one")
        yield capture
    finally:
        capture.release()
