# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Data types: what they refuse, by the name of the field, and that nobody can change them afterwards."""

import dataclasses
import math
import uuid
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.types import (
    CameraCalibration,
    DistortionModel,
    FeatureQuality,
    ImuBias,
    ImuSample,
    ImuWindow,
    NavCameraFrame,
    VioHealth,
    VioOutput,
    VioState,
    WarmStartPose,
    frame_uuid,
)
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

TIMES_MS = st.integers(0, 2**48 - 1)
SEQUENCES = st.integers(0, 2**12 - 1)
RANDOM = st.integers(0, 2**62 - 1)


def frame(**fields: Any) -> NavCameraFrame:
    pixels = np.zeros((2, 3, 3), np.uint8)
    return NavCameraFrame(
        **{
            "frame_id": frame_uuid(1, 2, 3),
            "sequence": 2,
            "capture_timestamp": 1_000_000,
            "pixels": pixels,
            "camera_id": "nav",
            **fields,
        }
    )


def sample(t_ns: int = 0, **fields: Any) -> ImuSample:
    return ImuSample.checked(**{"t_ns": t_ns, "accel": np.array([0, 0, 9.8]), "gyro": np.zeros(3), **fields})


def bias(**fields: Any) -> ImuBias:
    return ImuBias.checked(**{"accel": np.zeros(3), "gyro": np.zeros(3), **fields})


def calibration(**fields: Any) -> CameraCalibration:
    return CameraCalibration(
        **{
            "camera_id": "nav",
            "unit": "07",
            "width": 640,
            "height": 480,
            "fx": 500.0,
            "fy": 501.0,
            "cx": 319.5,
            "cy": 239.5,
            "distortion_model": DistortionModel.NONE,
            "distortion": np.zeros(0),
            "B_T_C": SE3.identity(),
            **fields,
        }
    )


def warm_start(**fields: Any) -> WarmStartPose:
    return WarmStartPose(
        **{
            "body_T_world": SE3.identity(),
            "velocity_b": np.zeros(3),
            "bias": bias(),
            "covariance": np.eye(15),
            **fields,
        }
    )


def quality(**fields: Any) -> FeatureQuality:
    return FeatureQuality(
        **{
            "tracked": 100,
            "lost": 5,
            "new": 10,
            "inliers": 90,
            "mean_parallax_px": 12.0,
            "mre_px": 0.4,
            "coverage": 0.8,
            **fields,
        }
    )


def output(**fields: Any) -> VioOutput:
    return VioOutput(
        **{
            "frame_id": frame_uuid(2, 3, 4),
            "relative_pose_T": SE3.identity(),
            "pose_covariance_6x6": np.eye(6),
            "imu_bias": bias(),
            "feature_quality": quality(),
            "keyframe_id": frame_uuid(1, 2, 3),
            "is_keyframe": False,
            "velocity_b": np.zeros(3),
            "world_T_body": SE3.identity(),
            **fields,
        }
    )


def not_symmetric(size: int) -> Array:
    matrix = np.eye(size)
    matrix[0, 1] = 0.1
    return matrix


@given(TIMES_MS, SEQUENCES, RANDOM)
def test_identifier_has_the_layout_of_version_7(time_ms: int, sequence: int, random: int) -> None:
    identifier = frame_uuid(time_ms, sequence, random)
    assert (identifier.version, identifier.variant) == (7, uuid.RFC_4122)
    assert int.from_bytes(identifier.bytes[:6], "big") == time_ms
    assert identifier.int >> 64 & 0xFFF == sequence
    assert identifier.int & 2**62 - 1 == random


@given(TIMES_MS, SEQUENCES, RANDOM, TIMES_MS, SEQUENCES, RANDOM)
def test_identifiers_are_in_the_order_of_time_then_sequence(
    time_ms: int, sequence: int, random: int, other_ms: int, other_sequence: int, other_random: int
) -> None:
    earlier, later = sorted([(time_ms, sequence, random), (other_ms, other_sequence, other_random)])
    assert frame_uuid(*earlier) <= frame_uuid(*later)


def test_numbers_too_large_for_an_identifier_do_not_spill_over() -> None:
    assert frame_uuid(2**48 + 1, 2**12 + 2, 2**62 + 3) == frame_uuid(1, 2, 3)


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"sequence": -1}, "sequence"),
        ({"pixels": np.zeros((2, 3))}, "pixels"),
        ({"pixels": [[1, 2]]}, "pixels"),
        ({"pixels": np.zeros(6, np.uint8)}, "pixels"),
        ({"pixels": np.zeros((2, 3, 4), np.uint8)}, "pixels"),
        ({"pixels": np.zeros((0, 3), np.uint8)}, "pixels"),
    ],
)
def test_bad_frame_is_refused_by_the_name_of_its_field(fields: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}: "):
        frame(**fields)


def test_frame_may_be_grey() -> None:
    assert frame(pixels=np.ones((2, 3), np.uint8)).pixels.shape == (2, 3)


def test_frame_shares_its_pixels_and_leaves_only_the_owner_write_them() -> None:
    pixels = np.zeros((2, 3), np.uint8)
    made = frame(pixels=pixels)
    pixels[1, 2] = 7
    assert made.pixels[1, 2] == 7
    with pytest.raises(ValueError, match="read-only"):
        made.pixels[1, 2] = 8


def test_pixels_out_of_order_are_put_in_order() -> None:
    upside_down = np.arange(6, dtype=np.uint8).reshape(2, 3)[::-1]
    made = frame(pixels=upside_down)
    assert made.pixels.flags.c_contiguous
    assert made.pixels.tolist() == [[3, 4, 5], [0, 1, 2]]


@pytest.mark.parametrize("name", ["accel", "gyro"])
@pytest.mark.parametrize("bad", [np.zeros(2), np.array([0, math.nan, 0]), np.array([0, 0, math.inf])])
def test_bad_sample_or_bias_is_refused_by_the_name_of_its_field(name: str, bad: Array) -> None:
    fields: dict[str, Any] = {name: bad}
    for make in (sample, bias):
        with pytest.raises(ValueError, match=f"^{name}: "):
            make(**fields)


def test_norm_of_a_bias_is_that_of_its_six_numbers() -> None:
    assert bias(accel=np.array([1.0, 2, 3]), gyro=np.array([4.0, 5, 6])).norm() == pytest.approx(math.sqrt(91))


def test_no_bias_has_the_norm_zero() -> None:
    assert ImuBias.zero().norm() == 0


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"camera_id": ""}, "camera_id"),
        ({"width": 0}, "width"),
        ({"width": 640.0}, "width"),
        ({"height": -480}, "height"),
        ({"fx": 0.0}, "fx"),
        ({"fx": math.nan}, "fx"),
        ({"fy": -1.0}, "fy"),
        ({"cx": math.inf}, "cx"),
        ({"cy": math.nan}, "cy"),
        ({"time_offset_s": math.nan}, "time_offset_s"),
        ({"time_offset_sigma_s": -1e-3}, "time_offset_sigma_s"),
        ({"rotation_sigma_rad": math.nan}, "rotation_sigma_rad"),
        ({"position_sigma_m": math.inf}, "position_sigma_m"),
        ({"line_time_s": -1e-5}, "line_time_s"),
        ({"imu_rate_hz": math.inf}, "imu_rate_hz"),
        ({"accel_limit_m_s2": 0.0}, "accel_limit_m_s2"),
        ({"gyro_limit_rad_s": math.nan}, "gyro_limit_rad_s"),
        ({"distortion_model": "fisheye"}, "distortion_model"),
        ({"distortion": np.zeros(4)}, "distortion"),
        ({"distortion_model": "radtan", "distortion": np.zeros(3)}, "distortion"),
        ({"distortion_model": "equidistant", "distortion": np.zeros(5)}, "distortion"),
        ({"distortion_model": "radtan", "distortion": np.full(4, math.nan)}, "distortion"),
    ],
)
def test_bad_calibration_is_refused_by_the_name_of_its_field(fields: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}: "):
        calibration(**fields)


@pytest.mark.parametrize(("model", "count"), [("none", 0), ("radtan", 4), ("radtan", 5), ("equidistant", 4)])
def test_calibration_takes_a_model_by_its_name(model: str, count: int) -> None:
    made = calibration(distortion_model=model, distortion=np.zeros(count))
    assert made.distortion_model is DistortionModel(model)


def test_matrix_maps_normalised_coordinates_to_pixels() -> None:
    assert (calibration().matrix() @ [0.1, -0.2, 1]).tolist() == pytest.approx([369.5, 139.3, 1])


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"velocity_b": np.zeros(2)}, "velocity_b"),
        ({"velocity_b": np.full(3, math.nan)}, "velocity_b"),
        ({"covariance": np.eye(6)}, "covariance"),
        ({"covariance": np.full((15, 15), math.nan)}, "covariance"),
        ({"covariance": not_symmetric(15)}, "covariance"),
        ({"covariance": -np.eye(15)}, "covariance"),
    ],
)
def test_bad_warm_start_is_refused_by_the_name_of_its_field(fields: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}: "):
        warm_start(**fields)


def test_warm_start_needs_no_covariance() -> None:
    assert warm_start(covariance=None).covariance is None


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"tracked": -1}, "tracked"),
        ({"lost": -1}, "lost"),
        ({"new": -1}, "new"),
        ({"inliers": -1}, "inliers"),
        ({"mean_parallax_px": -0.1}, "mean_parallax_px"),
        ({"mean_parallax_px": math.nan}, "mean_parallax_px"),
        ({"mre_px": -0.1}, "mre_px"),
        ({"mre_px": math.nan}, "mre_px"),
        ({"coverage": -0.1}, "coverage"),
        ({"coverage": 1.1}, "coverage"),
        ({"coverage": math.nan}, "coverage"),
    ],
)
def test_bad_quality_is_refused_by_the_name_of_its_field(fields: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}: "):
        quality(**fields)


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"pose_covariance_6x6": np.eye(5)}, "pose_covariance_6x6"),
        ({"pose_covariance_6x6": np.full((6, 6), math.inf)}, "pose_covariance_6x6"),
        ({"pose_covariance_6x6": not_symmetric(6)}, "pose_covariance_6x6"),
        ({"pose_covariance_6x6": -np.eye(6)}, "pose_covariance_6x6"),
        ({"velocity_b": np.full(3, math.nan)}, "velocity_b"),
    ],
)
def test_bad_output_is_refused_by_the_name_of_its_field(fields: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}: "):
        output(**fields)


def test_covariance_of_an_output_is_clipped_to_zero() -> None:
    made = output(pose_covariance_6x6=np.diag([1, 1, 1, 1, 1, -1e-13]))
    assert np.linalg.eigvalsh(made.pose_covariance_6x6)[0] >= 0


@pytest.mark.parametrize(
    "array",
    [
        sample().accel,
        sample().gyro,
        bias().accel,
        bias().gyro,
        calibration(distortion_model="radtan", distortion=np.zeros(4)).distortion,
        warm_start().velocity_b,
        warm_start().covariance,
        output().pose_covariance_6x6,
        output().velocity_b,
        output().imu_bias.gyro,
    ],
)
def test_array_of_a_record_cannot_be_written_to(array: Array) -> None:
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1


def test_record_is_not_changed_through_what_it_was_made_from() -> None:
    gyro = np.zeros(3)
    made = sample(gyro=gyro)
    gyro[0] = 1
    assert made.gyro.tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("record", "field"),
    [
        (frame(), "sequence"),
        (sample(), "t_ns"),
        (ImuWindow(0, 1, ()), "samples"),
        (bias(), "gyro"),
        (calibration(), "fx"),
        (warm_start(), "bias"),
        (quality(), "tracked"),
        (VioHealth(VioState.INIT, 0, 0.0, ""), "state"),
        (output(), "is_keyframe"),
    ],
)
def test_field_of_a_record_cannot_be_set(record: Any, field: str) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(record, field, 1)
