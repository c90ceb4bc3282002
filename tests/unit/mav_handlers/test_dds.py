# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Transforms of ROS 2: which of them are taken, and what becomes of those."""

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.internal_error import InternalError
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.verdicts import CONSUMED, DISABLED, QUALITY_BELOW_MIN
from mav_handlers.dds import EMPTY_TEXT, Transform, receive_transforms, time_ms_of, time_u64_micros
from mav_handlers.verdicts import TF_EMPTY, TF_FRAMES, TF_TOO_MANY
from tests.figure_of_eight import figure_of_eight

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

IDENTITY = (0.0, 0.0, 0.0, 1.0)
POSE = Transform("odom", "base_link", 5, 123_456_789, (1.0, 2.0, 3.0), IDENTITY)


def test_position_and_attitude_become_those_of_the_firmware(bench: "Bench") -> None:
    turned = POSE._replace(rotation_xyzw=(0.5, 0.5, 0.5, 0.5))
    assert receive_transforms(bench.vehicle, [turned]) == [CONSUMED]
    [given] = bench.poses
    assert given.pos == Vector3f(1, -2, -3)
    assert given.quat == Quaternion(0.5, 0.5, -0.5, -0.5)


def test_numbers_are_rounded_to_float32_before_all_else(bench: "Bench") -> None:
    receive_transforms(bench.vehicle, [POSE._replace(translation=(0.1, 0.2, 0.3))])
    assert bench.poses[0].pos == Vector3f(f32(0.1), f32(-0.2), f32(-0.3))


def test_attitude_is_scaled_to_length_1(bench: "Bench") -> None:
    receive_transforms(bench.vehicle, [POSE._replace(rotation_xyzw=(0.0, 0.0, 3.0, 4.0))])
    assert bench.poses[0].quat == Quaternion(f32(4) * (f32(1) / f32(5)), 0, 0, f32(-3) * (f32(1) / f32(5)))


def test_attitude_of_length_0_stays_and_is_an_internal_error(bench: "Bench") -> None:
    receive_transforms(bench.vehicle, [POSE._replace(rotation_xyzw=(0.0,) * 4)])
    assert bench.poses[0].quat == Quaternion(0, 0, 0, 0)
    assert bench.vehicle.internal_errors.mask == InternalError.FLOW_OF_CONTROL


def test_what_a_transform_does_not_tell_is_0(bench: "Bench") -> None:
    receive_transforms(bench.vehicle, [POSE])
    [logged] = bench.logged("VISP")
    assert (logged["Rst"], logged["Q"], logged["PErr"]) == (0, 0, f32(0.2))  # the error is at least VISO_POS_M_NSE


def test_quality_of_0_is_below_any_least_quality(make_bench: "MakeBench") -> None:
    assert receive_transforms(make_bench(VISO_QUAL_MIN=1).vehicle, [POSE]) == [QUALITY_BELOW_MIN]


def test_vehicle_without_visual_odometry_takes_none(make_bench: "MakeBench") -> None:
    assert receive_transforms(make_bench(VISO_TYPE=0).vehicle, [POSE]) == [DISABLED]


def test_stamp_is_taken_for_time_since_boot(bench: "Bench") -> None:
    receive_transforms(bench.vehicle, [POSE])
    assert (bench.logged("VISP")[0]["RTimeUS"], bench.poses[0].timeStamp_ms) == (5_123_456, 5123)


@pytest.mark.parametrize(
    ("time_us", "time_ms"),
    [
        (999, 0),
        (20_000_500, 20_000),
        (4_294_967_296_000, 0),  # 2^32 ms
        # A time of day: float32 knows it to 131 s, and 32 bits of ms hold the rest of a division by 50 days.
        (1_760_000_000_000_000, int(np.float32(1.76e15) * np.float32(1e-3)) % 2**32),
    ],
)
def test_time_of_a_sample_is_worked_out_in_float32(time_us: int, time_ms: int) -> None:
    assert time_ms_of(time_us) == time_ms


def test_stamp_before_1970_wraps() -> None:
    assert time_u64_micros(-1, 500_000_000) == 2**64 - 500_000


@pytest.mark.parametrize(
    "frames", [("map", "base_link"), ("odom", "camera"), ("base_link", "odom"), ("/odom", "base_link")]
)
def test_other_frames_are_dropped(bench: "Bench", frames: tuple[str, str]) -> None:
    other = POSE._replace(frame_id=frames[0], child_frame_id=frames[1])
    assert receive_transforms(bench.vehicle, [other, POSE]) == [TF_FRAMES, CONSUMED]
    assert len(bench.poses) == 1


def test_message_without_transforms_is_told(bench: "Bench") -> None:
    texts: list[str] = []
    bench.vehicle.texts.on_text.append(lambda _severity, text: texts.append(text))
    assert receive_transforms(bench.vehicle, []) == [TF_EMPTY]
    assert texts == [EMPTY_TEXT]


def test_message_with_more_than_8_transforms_does_not_decode(bench: "Bench") -> None:
    assert receive_transforms(bench.vehicle, [POSE] * 8) == [CONSUMED] * 8
    assert receive_transforms(bench.vehicle, [POSE] * 9) == [TF_TOO_MANY]


@pytest.mark.parametrize("number", [math.nan, math.inf, -1e300])
def test_no_number_raises(bench: "Bench", number: float) -> None:
    odd = POSE._replace(translation=(number,) * 3, rotation_xyzw=(number,) * 4)
    assert receive_transforms(bench.vehicle, [odd]) == [CONSUMED]
    assert bench.poses[0].quat.is_nan()


@pytest.mark.parametrize("viso_type", [1, 2])
def test_logs_and_hands_over_what_mavlink_would(make_bench: "MakeBench", viso_type: int) -> None:
    by_ros, by_mavlink = make_bench(VISO_TYPE=viso_type), make_bench(VISO_TYPE=viso_type)
    for pose in figure_of_eight(rate_hz=2, seconds=8):
        for bench in (by_ros, by_mavlink):
            bench.run_ms(40.5)
        time_us = by_ros.now_us
        receive_transforms(by_ros.vehicle, [pose.transform(time_us)])
        by_mavlink.client.tell(pose.message(time_us))
    assert len(by_ros.logged("VISP")) == 16
    assert by_ros.logged("VISP") == by_mavlink.logged("VISP")
    assert by_ros.poses == by_mavlink.poses
