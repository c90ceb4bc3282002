# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings in EuRoC's layout: both kinds of folder, the order of the data, and what is wrong with a damaged one."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.acceptance.trial import disturbed_start
from viso.companion.sources.base import SourceError
from viso.companion.sources.euroc import EurocRecording, load_euroc
from viso.companion.vio.types import ImuSample, NavCameraFrame
from viso.geometry.rotation import so3_log

cv2 = pytest.importorskip("cv2")

WIDTH, HEIGHT = 32, 24
MS = 1_000_000
START_NS = 1_403_636_580_000_000_000
SENSOR = f"""sensor_type: camera
T_BS:
  data: [0.0, 0.0, 1.0, 0.1, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
camera_model: pinhole
resolution: [{WIDTH}, {HEIGHT}]
intrinsics: [20.0, 20.0, 16.0, 12.0]
distortion_model: radial-tangential
distortion_coefficients: [0.0, 0.0, 0.0, 0.0]
"""
AS_PUBLISHED = {
    "camera": "mav0/cam0/data",
    "sensor": "mav0/cam0/sensor.yaml",
    "imu": "mav0/imu0/data.csv",
    "truth": "mav0/state_groundtruth_estimate0/data.csv",
}
FLAT = {"camera": "cam0", "sensor": "cam0_sensor.yaml", "imu": "imu0.csv", "truth": "groundtruth.tum"}


def x_at(t_ms: float) -> float:
    return 0.002 * t_ms  # 2 m/s


def truth_line(t_ms: int, *, csv: bool) -> str:
    t_ns, x = START_NS + t_ms * MS, x_at(t_ms)
    if csv:
        return f"{t_ns},{x},1.0,2.0,1.0,0.0,0.0,0.0,2.0,0.0,0.0,0,0,0,0,0,0"
    return f"{t_ns // 10**9}.{t_ns % 10**9:09d} {x} 1.0 2.0 0.0 0.0 0.0 1.0"


def write(root: Path, layout: dict[str, str]) -> Path:
    """Write half a second: pictures each 100 ms from 50 ms on, inertial data each 5 ms, the truth each 10 ms."""
    for name in layout.values():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
    (root / layout["camera"]).mkdir(exist_ok=True)
    for index, t_ms in enumerate(range(50, 500, 100)):
        picture = np.full((HEIGHT, WIDTH), 10 * index, np.uint8)
        assert cv2.imwrite(str(root / layout["camera"] / f"{START_NS + t_ms * MS}.png"), picture)
    (root / layout["sensor"]).write_text(SENSOR)
    imu = [f"{START_NS + t_ms * MS},{0.001 * t_ms},0.2,0.3,{t_ms},5.0,9.8" for t_ms in range(0, 501, 5)]
    (root / layout["imu"]).write_text("\n".join(["#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z", *imu]) + "\n")
    is_csv = layout["truth"].endswith(".csv")
    truth = [truth_line(t_ms, csv=is_csv) for t_ms in range(0, 401, 10)]
    (root / layout["truth"]).write_text("\n".join(["# times and poses", *truth]) + "\n")
    return root


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write(tmp_path, FLAT)


@pytest.fixture
def recording(folder: Path) -> EurocRecording:
    return load_euroc(folder)


def at_ms(t_ms: float) -> int:
    return START_NS + round(t_ms * MS)


@pytest.mark.parametrize("layout", [AS_PUBLISHED, FLAT])
def test_either_layout_is_read(tmp_path: Path, layout: dict[str, str]) -> None:
    recording = load_euroc(write(tmp_path, layout))
    assert (recording.calibration.width, recording.calibration.height) == (WIDTH, HEIGHT)
    assert [image.t_ns for image in recording.images] == [at_ms(t_ms) for t_ms in range(50, 500, 100)]
    assert len(recording.samples) == 101
    assert recording.poses is not None
    assert len(recording.poses) == 41


def test_rotation_rate_comes_before_specific_force(recording: EurocRecording) -> None:
    sample = recording.samples[2]
    assert sample.t_ns == at_ms(10)
    assert sample.gyro.tolist() == [0.01, 0.2, 0.3]
    assert sample.accel.tolist() == [10.0, 5.0, 9.8]


def test_frame_comes_after_the_first_sample_that_is_not_before_it(recording: EurocRecording) -> None:
    newest_ns = 0
    frames = 0
    for event in recording.events():
        if isinstance(event, ImuSample):
            before_ns, newest_ns = newest_ns, event.t_ns
        else:
            assert before_ns < event.capture_timestamp <= newest_ns
            frames += 1
    assert frames == 5


def test_frames_are_the_pictures_in_order(recording: EurocRecording) -> None:
    frames = [event for event in recording.events() if isinstance(event, NavCameraFrame)]
    assert [frame.sequence for frame in frames] == list(range(5))
    assert [frame.pixels[0, 0] for frame in frames] == [0, 10, 20, 30, 40]
    assert {frame.camera_id for frame in frames} == {recording.calibration.camera_id}
    assert sorted(frame.frame_id for frame in frames) == [frame.frame_id for frame in frames]


def test_last_frame_is_not_lost_when_no_sample_is_later(recording: EurocRecording) -> None:
    short = dataclasses.replace(recording, samples=recording.samples[:50])
    assert sum(isinstance(event, NavCameraFrame) for event in short.events()) == 5


def test_part_of_the_pictures_is_a_recording_as_well(recording: EurocRecording) -> None:
    part = dataclasses.replace(recording, images=recording.images[1::2])
    frames = [event for event in part.events() if isinstance(event, NavCameraFrame)]
    assert [frame.capture_timestamp for frame in frames] == [at_ms(150), at_ms(350)]


def test_truth_is_interpolated(recording: EurocRecording) -> None:
    pose = recording.truth(at_ms(54))
    assert pose is not None
    assert pose.t == pytest.approx([x_at(54), 1.0, 2.0])


@pytest.mark.parametrize("t_ms", [-1, 401])
def test_truth_is_not_known_outside_its_time(recording: EurocRecording, t_ms: int) -> None:
    assert recording.truth(at_ms(t_ms)) is None
    assert recording.truth_velocity_w(at_ms(t_ms)) is None


def test_velocity_is_that_of_the_true_positions(recording: EurocRecording) -> None:
    assert recording.truth_velocity_w(at_ms(100)) == pytest.approx([2.0, 0.0, 0.0])


def test_warm_start_without_errors_is_the_truth_at_the_first_picture(recording: EurocRecording) -> None:
    pose = recording.start()
    assert pose is not None
    assert pose.body_T_world.inverse().t == pytest.approx([x_at(50), 1.0, 2.0])
    assert pose.velocity_b == pytest.approx([2.0, 0.0, 0.0])


def test_warm_start_has_the_errors_of_its_seed(recording: EurocRecording) -> None:
    first, again, other = (disturbed_start(recording, seed) for seed in (1, 1, 2))
    assert first.velocity_b.tolist() == again.velocity_b.tolist()
    assert first.velocity_b.tolist() != other.velocity_b.tolist()
    assert 0 < np.linalg.norm(so3_log(first.body_T_world.R)) < np.radians(6)


def test_recording_may_lack_the_truth(folder: Path) -> None:
    (folder / FLAT["truth"]).unlink()
    recording = load_euroc(folder)
    assert recording.truth(at_ms(100)) is None
    with pytest.raises(SourceError, match=r"50000000\.png: no ground truth at the first picture"):
        disturbed_start(recording, 0)
    assert recording.start() is None


@pytest.mark.parametrize("part", ["sensor", "imu"])
def test_missing_file_is_named(folder: Path, part: str) -> None:
    (folder / FLAT[part]).unlink()
    with pytest.raises(SourceError, match=rf"^{folder}: no .* or {FLAT[part]}$"):
        load_euroc(folder)


def test_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"absent: no "):
        load_euroc(tmp_path / "absent")


def test_folder_without_pictures_is_refused(folder: Path) -> None:
    for path in (folder / "cam0").glob("*.png"):
        path.unlink()
    with pytest.raises(SourceError, match=r"cam0: no pictures \(\*\.png\)$"):
        load_euroc(folder)


def test_picture_not_named_by_a_stamp_is_refused(folder: Path) -> None:
    next((folder / "cam0").glob("*.png")).rename(folder / "cam0" / "left.png")
    with pytest.raises(SourceError, match=r"left\.png: not named by a stamp in ns$"):
        load_euroc(folder)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("1,2,3", "3 columns, not 7"),
        ("x,0,0,0,0,0,9", "invalid literal"),
        ("1403636580001000000,0,0,0,0,y,9", "could not convert"),
        ("1403636580001000000,0,0,0,0,nan,9", "accel: not finite"),
    ],
)
def test_bad_inertial_data_are_refused_with_their_line(folder: Path, line: str, reason: str) -> None:
    path = folder / FLAT["imu"]
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:2], line, *lines[2:]]))
    with pytest.raises(SourceError, match=rf"imu0\.csv:3: {reason}"):
        load_euroc(folder)


def test_inertial_data_out_of_order_are_refused(folder: Path) -> None:
    path = folder / FLAT["imu"]
    path.write_text(path.read_text() + f"{at_ms(500)},0,0,0,0,0,9\n")
    with pytest.raises(SourceError, match=r"imu0\.csv: stamp \d+ is not after the one before$"):
        load_euroc(folder)


def test_empty_inertial_data_are_refused(folder: Path) -> None:
    (folder / FLAT["imu"]).write_text("#timestamp\n")
    with pytest.raises(SourceError, match=r"imu0\.csv: no records$"):
        load_euroc(folder)


@pytest.mark.parametrize("part", ["sensor", "truth"])
def test_what_other_readers_refuse_is_refused(folder: Path, part: str) -> None:
    (folder / FLAT[part]).write_text("nonsense\n")
    with pytest.raises(SourceError, match=FLAT[part].replace(".", r"\.")) as caught:
        load_euroc(folder)
    assert "\n" not in str(caught.value)


def test_broken_picture_is_named(folder: Path) -> None:
    path = sorted((folder / "cam0").glob("*.png"))[3]
    path.write_bytes(path.read_bytes()[:40])
    recording = load_euroc(folder)
    with pytest.raises(SourceError, match=rf"{path.name}: not a picture, or a damaged one$"):
        list(recording.events())


def test_picture_of_another_size_is_named(folder: Path) -> None:
    path = sorted((folder / "cam0").glob("*.png"))[0]
    assert cv2.imwrite(str(path), np.zeros((HEIGHT, WIDTH + 1), np.uint8))
    with pytest.raises(SourceError, match=rf"{path.name}: 33x24 pixels, the calibration is for 32x24$"):
        list(load_euroc(folder).events())


def test_missing_opencv_tells_what_to_install(recording: EurocRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(SourceError, match=r"pip install 'ardupilot-viso\[vio\]'$"):
        list(recording.events())
