# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of videos."""

import dataclasses
import os
import sys
from pathlib import Path

import pytest

from tests.unit.viso.companion.sources.film_maker import HEIGHT, WIDTH, write_calibration, write_film
from viso.companion.sources.base import SourceError
from viso.companion.sources.video import opencv, video_frames, video_size
from viso.companion.vio.calibration import load_calibration
from viso.companion.vio.types import CameraCalibration


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return write_film(tmp_path / "film.avi")


@pytest.fixture
def calibration(tmp_path: Path) -> CameraCalibration:
    return load_calibration(write_calibration(tmp_path / "small.toml"))


def test_frames_are_stamped_and_numbered(film: Path, calibration: CameraCalibration) -> None:
    frames = list(video_frames(film, calibration))
    assert [frame.capture_timestamp for frame in frames] == [100_000_000 * index for index in range(12)]
    assert [frame.sequence for frame in frames] == list(range(12))
    assert {(frame.pixels.shape, frame.camera_id) for frame in frames} == {((HEIGHT, WIDTH, 3), "small")}


def test_frames_may_be_fewer(film: Path, calibration: CameraCalibration) -> None:
    frames = list(video_frames(film, calibration, fps=3.3))
    assert [frame.capture_timestamp // 1_000_000 for frame in frames] == [0, 300, 600, 900]
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3]


def test_frames_before_the_start_are_left_out(film: Path, calibration: CameraCalibration) -> None:
    first = next(video_frames(film, calibration, start_ns=250_000_000))
    assert first.capture_timestamp == 300_000_000


def test_size_is_known(film: Path) -> None:
    assert video_size(film) == (WIDTH, HEIGHT)


def test_frames_of_another_size_are_refused(film: Path, calibration: CameraCalibration) -> None:
    other = dataclasses.replace(calibration, width=WIDTH + 2)
    with pytest.raises(SourceError, match=rf"film\.avi: {WIDTH}x{HEIGHT} pixels, the calibration is for {WIDTH + 2}x"):
        next(video_frames(film, other))


def test_file_that_is_no_video_is_told(tmp_path: Path, calibration: CameraCalibration) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(b"hello")
    with pytest.raises(SourceError, match=r"film\.mp4: not a video, or a damaged one"):
        next(video_frames(path, calibration))


@pytest.mark.parametrize(("name", "what"), [("none.mp4", "No such file or directory"), ("", "not a file")])
def test_what_is_no_file_is_told(tmp_path: Path, name: str, what: str) -> None:
    with pytest.raises(SourceError, match=what):
        video_size(tmp_path / name)


def test_library_is_told_to_be_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENCV_FFMPEG_LOGLEVEL", raising=False)
    opencv()
    assert os.environ["OPENCV_FFMPEG_LOGLEVEL"] == "-8"


def test_missing_library_is_told_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(SourceError, match=r"pip install 'ardupilot-viso\[vio\]'"):
        opencv()
