# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera on this computer or in the network; it needs the extra vio. The IMU that goes with it is the autopilot's."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from viso.companion.sources.base import SourceError, SourceOptions, Thinning, make_frame
from viso.companion.sources.video import check_size, opencv
from viso.companion.vio.config import VioConfig
from viso.companion.vio.types import CameraCalibration, NavCameraFrame


@dataclass(frozen=True, slots=True, eq=False)
class LiveCamera:
    """A camera, by its number or URL, that has not been opened; it takes at most ``fps`` frames per second."""

    name: str
    calibration: CameraCalibration
    fps: float | None
    config: VioConfig

    def open(self, clock_ns: Callable[[], int]) -> "CameraFrames":
        """Open the camera; a clock stamps each frame as it arrives.

        What passes before that is for the calibration's time offset. Raises SourceError if it cannot be opened, or its
        pictures have another size than the calibration's.
        """
        cv2 = opencv()
        capture = cv2.VideoCapture(int(self.name) if self.name.isdigit() else self.name)
        if not capture.isOpened():
            raise SourceError(f"camera {self.name}: cannot be opened")
        size = round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        check_size(f"camera {self.name}", size, self.calibration)
        return CameraFrames(capture, self.calibration.camera_id, clock_ns, self.fps)


class CameraFrames:
    """The frames of an open camera (FrameSource), OpenCV's ``capture``."""

    def __init__(self, capture: Any, camera_id: str, clock_ns: Callable[[], int], fps: float | None = None) -> None:
        self._capture, self._camera_id, self._clock_ns = capture, camera_id, clock_ns
        self._thinning = Thinning(fps)
        self._sequence = 0
        self._closed = False
        self._lock = threading.Lock()  # a capture must not be released while it is being read

    def read(self) -> NavCameraFrame | None:
        """Wait for the next frame; None once closed. Raises OSError if the camera gives none."""
        while True:
            with self._lock:
                if self._closed:
                    self._capture.release()
                    return None
                if not self._capture.grab():
                    raise OSError("it gives no picture")
                t_ns = self._clock_ns()
                if not self._thinning.wants(t_ns):
                    continue
                decoded, pixels = self._capture.retrieve()
            if decoded:
                self._sequence += 1
                return make_frame(self._sequence - 1, t_ns, pixels, self._camera_id)

    def close(self) -> None:
        """Release the camera; a read in progress does so when it returns. From any thread, also twice."""
        self._closed = True
        if self._lock.acquire(blocking=False):
            self._capture.release()
            self._lock.release()


def sounds_like_camera(name: str) -> bool:
    """Return whether a name is a number, a URL or a video device."""
    return name.isdigit() or "://" in name or name.startswith("/dev/video")


def open_camera(options: SourceOptions) -> LiveCamera:
    """Return a camera that may be opened. Raises SourceError if there is no calibration."""
    calibration = options.load_calibration()
    if calibration is None:
        raise SourceError(f"camera {options.name}: --calibration FILE is missing")
    return LiveCamera(options.name, calibration, options.fps, VioConfig())
