# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibrations from files, and at another scale."""

import dataclasses
import os
from math import inf
from pathlib import Path

import numpy as np
import pytest

from tests.places import ROOT
from viso.companion.vio import calibration
from viso.companion.vio.calibration import CalibrationError, load_calibration, scaled
from viso.companion.vio.frames import MOUNTINGS
from viso.companion.vio.types import CameraCalibration, DistortionModel
from viso.geometry.pose import SE3

FOLDER = Path(os.environ.get("VISO_DATA", ROOT.parent / "shared" / "data")) / "euroc_mh01_clip"

CAMERA = """\
camera_id = "nav"
unit = "07"
width = 5472
height = 3648
fx = 7200.0
fy = 7201
cx = 2735.5
cy = 1823.5
"""
LENS = """\
distortion_model = "radtan"
distortion = [-0.02, 0.01, 0, 0.001]
"""
PLACE = """\
mounting = "nadir"
position_m = [0.1, 0, -0.05]
"""
SENSOR = """\
T_BS:
  data: [0, 0, 1, 0.1, -1, 0, 0, 0.2, 0, -1, 0, 0.3, 0, 0, 0, 1]
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.6, 457.2, 367.2, 248.3]
distortion_model: equidistant
distortion_coefficients: [0.1, 0.2, 0.3, 0.4]
"""


def written(folder: Path, text: str, name: str = "nav.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_keys_are_the_fields(tmp_path: Path) -> None:
    more = "time_offset_s = -0.002\nline_time_s = 2e-5\nimu_rate_hz = 400\ngyro_limit_rad_s = 34.9\n"
    read = load_calibration(written(tmp_path, CAMERA + LENS + PLACE + more))
    assert (read.camera_id, read.unit, read.width, read.height) == ("nav", "07", 5472, 3648)
    assert (read.fx, read.fy, read.cx, read.cy, read.time_offset_s) == (7200, 7201, 2735.5, 1823.5, -0.002)
    assert (read.line_time_s, read.imu_rate_hz, read.gyro_limit_rad_s, read.accel_limit_m_s2) == (2e-5, 400, 34.9, inf)
    assert read.distortion_model is DistortionModel.RADTAN
    assert read.distortion.tolist() == [-0.02, 0.01, 0, 0.001]


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_mounting_and_position_make_the_camera_s_place(tmp_path: Path, mounting: str) -> None:
    read = load_calibration(written(tmp_path, CAMERA + PLACE.replace("nadir", mounting)))
    assert np.array_equal(read.B_T_C.R, MOUNTINGS[mounting])
    assert read.B_T_C.t.tolist() == [0.1, 0, -0.05]


def test_matrix_is_the_camera_s_place(tmp_path: Path) -> None:
    rows = "B_T_C = [[0, 0, 1, 0.1], [-1, 0, 0, 0.2], [0, -1, 0, 0.3], [0, 0, 0, 1]]\n"
    assert load_calibration(written(tmp_path, CAMERA + rows)).B_T_C.map(np.array([0, 0, 2.0])).tolist() == [
        2.1,
        0.2,
        0.3,
    ]


def test_what_is_left_out_is_none_and_zero(tmp_path: Path) -> None:
    read = load_calibration(written(tmp_path, CAMERA + 'mounting = "forward"\n'))
    assert read.distortion_model is DistortionModel.NONE
    assert (read.distortion.tolist(), read.B_T_C.t.tolist(), read.time_offset_s) == ([], [0, 0, 0], 0)


def test_example_in_the_documentation_can_be_read(tmp_path: Path) -> None:
    documentation = calibration.__doc__ or ""
    example = documentation.split("::\n")[1].split("\nA ``sensor.yaml``")[0]
    read = load_calibration(written(tmp_path, "\n".join(line.strip() for line in example.splitlines())))
    assert (read.camera_id, read.distortion_model) == ("nav", DistortionModel.RADTAN)


@pytest.mark.parametrize("suffix", [".yaml", ".yml"])
def test_sensor_yaml_names_its_camera_by_the_file(tmp_path: Path, suffix: str) -> None:
    read = load_calibration(written(tmp_path, SENSOR, f"left{suffix}"))
    assert (read.camera_id, read.unit, read.width, read.height) == ("left", "0", 752, 480)
    assert (read.fx, read.fy, read.cx, read.cy) == (458.6, 457.2, 367.2, 248.3)
    assert (read.distortion_model, read.distortion.tolist()) == (DistortionModel.EQUIDISTANT, [0.1, 0.2, 0.3, 0.4])
    assert read.B_T_C.t.tolist() == [0.1, 0.2, 0.3]


def test_ends_of_lines_may_be_those_of_windows(tmp_path: Path) -> None:
    path = tmp_path / "left.yaml"
    path.write_bytes(SENSOR.replace(", -1, ", ",\n -1, ").replace("\n", "\r\n").encode())
    assert load_calibration(path).B_T_C.t.tolist() == [0.1, 0.2, 0.3]


@pytest.mark.skipif(not FOLDER.is_dir(), reason="needs the data set euroc_mh01_clip")
def test_recorded_sensor_yaml_can_be_read() -> None:
    read = load_calibration(FOLDER / "cam0_sensor.yaml")
    assert (read.width, read.height, read.fx, read.cy) == (752, 480, 458.654, 248.375)
    assert read.distortion.tolist() == [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
    assert read.B_T_C.t.tolist() == [-0.0216401454975, -0.064676986768, 0.00981073058949]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CAMERA + PLACE + "gain = 3\n", "gain: unknown"),
        (CAMERA.replace("fx", "focal") + PLACE, "focal: unknown"),
        (CAMERA.replace("fx = 7200.0", "") + PLACE, "fx: missing"),
        (CAMERA.replace("7200.0", '"long"') + PLACE, "fx: not a number"),
        (CAMERA.replace("7200.0", "true") + PLACE, "fx: not a number"),
        (CAMERA.replace("7200.0", "-1") + PLACE, "fx: not positive"),
        (CAMERA.replace("7200.0", "nan") + PLACE, "fx: not finite"),
        (CAMERA.replace("5472", "5472.0") + PLACE, "width: not a whole number"),
        (CAMERA.replace("5472", "true") + PLACE, "width: not a whole number"),
        (CAMERA.replace('"07"', "7") + PLACE, "unit: not a text"),
        (CAMERA, "B_T_C: missing, and so is mounting"),
        (CAMERA + "B_T_C = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "B_T_C: not four rows of four numbers"),
        (CAMERA + "B_T_C = 4", "B_T_C: not four rows of four numbers"),
        (CAMERA + "B_T_C = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]", "B_T_C: R: not orthonormal"),
        (CAMERA + PLACE + "B_T_C = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "mounting: not beside B_T_C"),
        (CAMERA + 'mounting = "up"', "mounting: 'up' is none of forward, nadir"),
        (CAMERA + "mounting = [1]", "mounting: not a text"),
        (CAMERA + PLACE.replace(", -0.05", ""), "position_m: not three numbers"),
        (CAMERA + PLACE.replace("[0.1, 0, -0.05]", '"here"'), "position_m: not a list of numbers"),
        (CAMERA + PLACE + LENS.replace("radtan", "fisheye"), "distortion_model: 'fisheye' is none of"),
        (CAMERA + PLACE + LENS.replace("-0.02, ", ""), "distortion: 3 coefficients"),
        (CAMERA + PLACE + LENS.replace("-0.02", '"k1"'), "distortion: not a number"),
        ("camera_id = " + "[" * 5000, "nested too deeply"),
        ("camera_id = nav", "not TOML: Invalid value (at line 1, column 13)"),
    ],
)
def test_bad_file_is_one_line_with_file_and_field(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(CalibrationError) as caught:
        load_calibration(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_bad_sensor_yaml_is_one_line_with_file_and_field(tmp_path: Path) -> None:
    path = written(tmp_path, SENSOR.replace("pinhole", "omni"), "left.yaml")
    with pytest.raises(CalibrationError) as caught:
        load_calibration(path)
    assert str(caught.value) == f"{path}: camera_model: 'omni', not pinhole"


def test_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError) as caught:
        load_calibration(tmp_path / "none.toml")
    assert str(caught.value) == f"{tmp_path / 'none.toml'}: No such file or directory"


def test_file_that_is_no_text_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "nav.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(CalibrationError, match=f"^{path}: "):
        load_calibration(path)


def test_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"nav\.json: neither \.toml nor \.yaml$"):
        load_calibration(written(tmp_path, "{}", "nav.json"))


def camera(width: int = 5472, height: int = 3648) -> CameraCalibration:
    lens = DistortionModel.RADTAN, np.array([0.1, 0.2, 0, 0])
    return CameraCalibration("nav", "07", width, height, 7200.0, 7000.0, 2735.5, 1800.0, *lens, SE3.identity(), 0.01)


def test_scaling_follows_the_half_pixel_rule() -> None:
    small = scaled(camera(), 4)
    assert (small.width, small.height, small.fx, small.fy) == (1368, 912, 1800, 1750)
    assert (small.cx, small.cy) == (683.5, 449.625)


def test_middle_of_a_block_becomes_the_middle_of_its_pixel() -> None:
    direction = np.array([0.0, 0, 1])
    large, small = camera().matrix() @ direction, scaled(camera(), 3).matrix() @ direction
    # Pixels 3 i to 3 i + 2 are averaged to pixel i, whose middle is at 3 i + 1.
    assert np.allclose(large[:2], 3 * small[:2] + 1)


def test_scaling_leaves_the_lens_the_place_and_the_clock() -> None:
    large = camera()
    small = scaled(large, 4)
    assert small.distortion.tolist() == large.distortion.tolist()
    assert small.distortion_model is large.distortion_model
    assert small.B_T_C is large.B_T_C
    assert small.time_offset_s == 0.01


def test_row_of_blocks_takes_as_long_as_its_rows() -> None:
    assert scaled(dataclasses.replace(camera(), line_time_s=2e-5), 4).line_time_s == 8e-5


def test_what_fills_no_block_is_left_out() -> None:
    small = scaled(camera(11, 10), 4)
    assert (small.width, small.height) == (2, 2)


@pytest.mark.parametrize("divisor", [0, -1, 11])
def test_divisor_that_leaves_no_picture_is_refused(divisor: int) -> None:
    with pytest.raises(ValueError, match=r"^divisor: "):
        scaled(camera(12, 10), divisor)
