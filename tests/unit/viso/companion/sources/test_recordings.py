# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Each kind of recording, opened."""

import dataclasses
import itertools
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.acceptance.trial import run_trial
from tests.places import SHARED
from tests.unit.viso.companion.sources.film_maker import write_calibration, write_film, write_inertial_csv
from tests.unit.viso.companion.sources.gopro_maker import movie, seconds_of_flight
from viso.companion.sources.base import Recording, SourceError, SourceOptions
from viso.companion.sources.recordings import KARMA, open_euroc, open_gopro, open_synthetic, open_video
from viso.companion.vio.calibration import load_calibration
from viso.companion.vio.config import AglSource
from viso.companion.vio.types import NavCameraFrame, VioState

CLIP, FLIGHT = SHARED / "euroc_mh01_clip", SHARED / "karma_flight" / "karma.mp4"
needs_clip = pytest.mark.skipif(not CLIP.exists(), reason=f"{CLIP.name} is not there")
needs_karma = pytest.mark.skipif(not FLIGHT.exists(), reason=f"{FLIGHT.parent.name} is not there")


def counted(recording: Recording, limit: int | None = None) -> Counter[str]:
    return Counter(type(event).__name__ for event in itertools.islice(recording.events(), limit))


# Video


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> SourceOptions:
    folder = tmp_path_factory.mktemp("video")
    return SourceOptions(
        str(write_film(folder / "film.avi")),
        calibration=write_calibration(folder / "small.toml"),
        imu=write_inertial_csv(folder / "imu.csv", 1.3),
    )


def test_video_and_its_inertial_data_come_together(video: SourceOptions) -> None:
    recording = open_video(video)
    assert counted(recording) == {"ImuSample": 260, "NavCameraFrame": 12}
    assert (recording.start, recording.poses, recording.world_is_north) == (None, None, False)


def test_video_can_be_played_again(video: SourceOptions) -> None:
    recording = open_video(video)
    assert counted(recording) == counted(recording)


def test_odometry_starts_on_a_video_of_standing_still(video: SourceOptions) -> None:
    recording = open_video(video)
    trial = run_trial(recording, recording.config)
    assert trial.frames[-1].result.state is not VioState.INIT
    assert np.linalg.norm(trial.estimate().positions[-1]) < 1e-2


def test_video_needs_inertial_data(video: SourceOptions) -> None:
    with pytest.raises(SourceError, match=r"a video without inertial data: --imu FILE\.csv"):
        open_video(dataclasses.replace(video, imu=None))


def test_video_needs_a_calibration(video: SourceOptions) -> None:
    with pytest.raises(SourceError, match="a video without calibration: --calibration FILE"):
        open_video(dataclasses.replace(video, calibration=None))


def test_calibration_that_is_none_is_told(video: SourceOptions, tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("fx = 1\n")
    with pytest.raises(SourceError, match=r"bad\.toml: "):
        open_video(SourceOptions(video.name, calibration=bad, imu=video.imu))


# GoPro


def test_shipped_calibration_is_one() -> None:
    calibration = load_calibration(KARMA)
    assert (calibration.width, calibration.height, calibration.camera_id) == (854, 480, "karma_hero5")


def test_gopro_without_telemetry_is_told(tmp_path: Path) -> None:
    film = write_film(tmp_path / "film.avi")
    with pytest.raises(SourceError, match=r"film\.avi: "):
        open_gopro(SourceOptions(str(film)))


def test_gopro_whose_pictures_cannot_be_read_is_told(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(movie(seconds_of_flight(1, (981, 0, 0), (0, 0, 0))))
    with pytest.raises(SourceError, match=r"film\.mp4: not a video, or a damaged one"):
        open_gopro(SourceOptions(str(path)))


@needs_karma
def test_karma_begins_where_its_drone_is_known() -> None:
    recording = open_gopro(SourceOptions(str(FLIGHT), fps=10 / 3))
    first = next(event for event in recording.events() if isinstance(event, NavCameraFrame))
    assert 33_000_000 <= first.capture_timestamp < 100_000_000
    assert recording.start is not None
    assert recording.poses is not None
    assert recording.poses.path_length_m == pytest.approx(81.3, abs=0.1)
    assert recording.world_is_north


@needs_karma
def test_other_size_needs_a_calibration(tmp_path: Path) -> None:
    small = write_calibration(tmp_path / "small.toml")
    recording = open_gopro(SourceOptions(str(FLIGHT), calibration=small))
    with pytest.raises(SourceError, match="854x480 pixels, the calibration is for 96x64"):
        list(recording.events())


@pytest.mark.slow
@needs_karma
def test_karma_is_tracked_at_3_frames_a_second_and_never_lost() -> None:
    recording = open_gopro(SourceOptions(str(FLIGHT), fps=10 / 3))
    assert recording.config.max_features == 200
    trial = run_trial(recording, recording.config, recording.start)
    tracked = [frame.result.output.feature_quality.tracked for frame in trial.frames if frame.result.output]
    assert np.median(tracked) >= 150
    assert VioState.LOST not in trial.states()
    assert len(trial.frames) == 41


# EuRoC


@pytest.mark.slow
@needs_clip
def test_euroc_starts_from_the_truth() -> None:
    recording = open_euroc(SourceOptions(str(CLIP)))
    assert recording.poses is not None
    assert recording.start is not None
    first = recording.poses.at(min(int(path.stem) for path in (CLIP / "cam0").glob("*.png")))
    assert first is not None
    np.testing.assert_allclose(recording.start.body_T_world.inverse().t, first.t)
    assert 0.3 < np.linalg.norm(recording.start.velocity_b) < 1.0


@pytest.mark.slow
@needs_clip
def test_euroc_may_have_fewer_frames() -> None:
    all_of_it, fewer = (open_euroc(SourceOptions(str(CLIP), fps=fps)) for fps in (None, 5.0))
    assert counted(all_of_it, 400)["NavCameraFrame"] == pytest.approx(2 * counted(fewer, 400)["NavCameraFrame"], abs=1)


def copy_clip_without_pictures(folder: Path) -> None:
    """Copy the camera's calibration and the beginning of the inertial data."""
    shutil.copy(CLIP / "cam0_sensor.yaml", folder)
    lines = (CLIP / "imu0.csv").read_text().splitlines(keepends=True)
    (folder / "imu0.csv").write_text("".join(lines[:20]))


@needs_clip
def test_euroc_without_truth_waits_for_stillness(tmp_path: Path) -> None:
    copy_clip_without_pictures(tmp_path)
    (tmp_path / "cam0").symlink_to(CLIP / "cam0")
    recording = open_euroc(SourceOptions(str(tmp_path)))
    assert (recording.start, recording.poses) == (None, None)


def test_folder_that_is_no_recording_is_told(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"no cam0/sensor\.yaml or cam0_sensor\.yaml"):
        open_euroc(SourceOptions(str(tmp_path)))


@needs_clip
def test_picture_that_is_damaged_is_told(tmp_path: Path) -> None:
    copy_clip_without_pictures(tmp_path)
    (tmp_path / "cam0").mkdir()
    (tmp_path / "cam0" / "1403636585063555584.png").write_bytes(b"none")
    with pytest.raises(SourceError, match=r"1403636585063555584\.png: not a picture"):
        list(open_euroc(SourceOptions(str(tmp_path))).events())


# Synthetic


@pytest.fixture(scope="module")
def synthetic() -> Recording:
    return open_synthetic(SourceOptions("synthetic:3"))


@pytest.mark.slow
def test_synthetic_flight_knows_its_truth_and_its_height(synthetic: Recording) -> None:
    recording = synthetic
    assert recording.poses is not None
    pose = recording.poses.at(1_000_000_000)
    assert pose is not None
    assert pose.t[2] == pytest.approx(40, abs=5)
    assert recording.config.agl_source is AglSource.RANGEFINDER
    assert counted(recording, 300)["HeightMeasurement"] >= 4


@pytest.mark.slow
def test_seed_tells_flights_apart(synthetic: Recording) -> None:
    other = open_synthetic(SourceOptions("synthetic"))
    assert synthetic.start is not None
    assert other.start is not None
    assert not np.allclose(synthetic.start.velocity_b, other.start.velocity_b)


def test_seed_that_is_none_is_told() -> None:
    with pytest.raises(SourceError, match="synthetic:-1: '-1' is no seed"):
        open_synthetic(SourceOptions("synthetic:-1"))
