# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Live cameras; a video stands in for one."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.sources.film_maker import write_calibration, write_film
from viso.companion.sources.base import SourceError, SourceOptions
from viso.companion.sources.camera import CameraFrames, LiveCamera, open_camera, sounds_like_camera


class FakeCapture:
    """Gives black pictures, and remembers what was done with it."""

    def __init__(self, pictures: int, undecoded: tuple[int, ...] = ()) -> None:
        self.left, self.grabbed, self.undecoded = pictures, 0, undecoded
        self.released = 0

    def grab(self) -> bool:
        self.grabbed += 1
        self.left -= 1
        return self.left >= 0

    def retrieve(self) -> tuple[bool, Any]:
        return self.grabbed not in self.undecoded, np.zeros((4, 6, 3), np.uint8)

    def release(self) -> None:
        self.released += 1


class Clock:
    """Goes on by 100 ms with each look."""

    def __init__(self) -> None:
        self.t_ns = 0

    def __call__(self) -> int:
        self.t_ns += 100_000_000
        return self.t_ns


def camera(tmp_path: Path, name: str) -> LiveCamera:
    return open_camera(SourceOptions(name, calibration=write_calibration(tmp_path / "small.toml")))


def test_frames_are_stamped_as_they_come() -> None:
    frames = CameraFrames(FakeCapture(3), "small", Clock())
    taken = [frame for frame in (frames.read(), frames.read()) if frame is not None]
    assert [(frame.sequence, frame.capture_timestamp, frame.camera_id) for frame in taken] == [
        (0, 100_000_000, "small"),
        (1, 200_000_000, "small"),
    ]


def test_frames_may_be_fewer() -> None:
    capture = FakeCapture(9)
    frames = CameraFrames(capture, "small", Clock(), fps=3.0)
    taken = [frames.read(), frames.read()]
    assert [frame and frame.capture_timestamp // 1_000_000 for frame in taken] == [100, 500]


def test_picture_that_cannot_be_decoded_is_passed_over() -> None:
    frames = CameraFrames(FakeCapture(3, undecoded=(1,)), "small", Clock())
    frame = frames.read()
    assert frame is not None
    assert (frame.sequence, frame.capture_timestamp) == (0, 200_000_000)


def test_camera_that_gives_nothing_raises() -> None:
    with pytest.raises(OSError, match="gives no picture"):
        CameraFrames(FakeCapture(0), "small", Clock()).read()


def test_closed_camera_ends_and_is_released() -> None:
    capture = FakeCapture(3)
    frames = CameraFrames(capture, "small", Clock())
    frames.close()
    frames.close()
    assert frames.read() is None
    assert (capture.released >= 1, capture.grabbed) == (True, 0)


def test_camera_is_opened_by_its_name(tmp_path: Path) -> None:
    film = write_film(tmp_path / "film.avi")
    frames = camera(tmp_path, str(film)).open(Clock())
    assert frames.read() is not None
    frames.close()


def test_camera_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"camera .*none\.avi: cannot be opened"):
        camera(tmp_path, str(tmp_path / "none.avi")).open(Clock())


def test_camera_of_another_size_is_told(tmp_path: Path) -> None:
    film = write_film(tmp_path / "film.avi", size=(64, 48))
    with pytest.raises(SourceError, match="64x48 pixels, the calibration is for 96x64"):
        camera(tmp_path, str(film)).open(Clock())


def test_camera_without_calibration_is_told() -> None:
    with pytest.raises(SourceError, match="camera 0: --calibration FILE is missing"):
        open_camera(SourceOptions("0"))


@pytest.mark.parametrize(
    ("name", "is_one"),
    [("0", True), ("/dev/video2", True), ("rtsp://10.0.0.2/nav", True), ("film.mp4", False), ("clip", False)],
)
def test_names_of_cameras_are_known(name: str, is_one: bool) -> None:
    assert sounds_like_camera(name) is is_one
