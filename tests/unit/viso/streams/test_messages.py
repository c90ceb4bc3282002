# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a pose to each message."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    ODOMETRY,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
)
from viso.companion.vio.config import CovarianceEncoding
from viso.geometry.rotation import quat_wxyz_from_rotation, so3_exp
from viso.geometry.trajectory import Pose
from viso.streams.messages import (
    FORMS,
    MAX_DELTA_US,
    Report,
    att_pos_mocap,
    odometry,
    vision_position_delta,
    vision_position_estimate,
    vision_with_speed,
)

# Heading east: a quarter turn clockwise from north.
EAST = so3_exp(np.array([0.0, 0.0, math.pi / 2]))
POSE = Pose(np.array([1.0, 2.0, -3.0]), quat_wxyz_from_rotation(EAST), np.array([0.0, 5.0, 1.0]), None, 0)
REPORT = Report(42, POSE, reset_counter=7, quality=80)
COVARIANCE = np.diag(np.arange(1.0, 7.0))


def only(messages: tuple[Any, ...]) -> Any:
    (message,) = messages
    return message


def with_covariance(report: Report = REPORT) -> Report:
    return replace(report, pose=replace(report.pose, covariance=COVARIANCE))


def test_odometry_is_in_the_frames_that_the_autopilot_takes() -> None:
    message = only(odometry(REPORT))
    assert isinstance(message, ODOMETRY)
    assert (message.frame_id, message.child_frame_id, message.estimator_type) == (20, 12, 3)
    assert (message.time_usec, message.reset_counter, message.quality) == (42, 7, 80)
    assert (message.x, message.y, message.z) == (1.0, 2.0, -3.0)
    assert message.q == pytest.approx((math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))


def test_velocity_of_odometry_is_in_the_body() -> None:
    message = only(odometry(REPORT))
    assert (message.vx, message.vy, message.vz) == pytest.approx((5.0, 0.0, 1.0))


def test_rates_that_are_not_known_are_nan() -> None:
    message = only(odometry(REPORT))
    assert all(map(math.isnan, (message.rollspeed, message.pitchspeed, message.yawspeed)))
    assert math.isnan(message.velocity_covariance[0])


def test_vision_has_euler_angles() -> None:
    rotation = so3_exp(np.array([0.0, 0.0, 0.5])) @ so3_exp(np.array([0.0, 0.4, 0.0])) @ so3_exp(np.array([0.3, 0, 0]))
    pose = replace(POSE, quat_wxyz=quat_wxyz_from_rotation(rotation))
    message = only(vision_position_estimate(replace(REPORT, pose=pose)))
    assert isinstance(message, VISION_POSITION_ESTIMATE)
    assert (message.roll, message.pitch, message.yaw) == pytest.approx((0.3, 0.4, 0.5))
    assert (message.usec, message.x, message.y, message.z, message.reset_counter) == (42, 1.0, 2.0, -3.0, 7)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_vision_stands_a_vehicle_on_its_nose(pitch: float) -> None:
    pose = replace(POSE, quat_wxyz=quat_wxyz_from_rotation(so3_exp(np.array([0.0, pitch, 0.0]))))
    assert only(vision_position_estimate(replace(REPORT, pose=pose))).pitch == pytest.approx(pitch)


def test_speed_is_in_ned_with_a_covariance_that_is_unknown() -> None:
    pose, speed = vision_with_speed(REPORT)
    assert isinstance(pose, VISION_POSITION_ESTIMATE)
    assert isinstance(speed, VISION_SPEED_ESTIMATE)
    assert (speed.usec, speed.x, speed.y, speed.z, speed.reset_counter) == (42, 0.0, 5.0, 1.0, 7)
    assert math.isnan(speed.covariance[0])


def test_mocap_is_the_pose_alone() -> None:
    message = only(att_pos_mocap(REPORT))
    assert isinstance(message, ATT_POS_MOCAP)
    assert (message.time_usec, message.x, message.y, message.z) == (42, 1.0, 2.0, -3.0)
    assert message.q == tuple(POSE.quat_wxyz)


def test_delta_is_in_the_body_as_it_is_turned_now() -> None:
    before = replace(POSE, position=np.array([1.0, 1.5, -3.0]), quat_wxyz=np.array([1.0, 0.0, 0.0, 0.0]))
    report = replace(REPORT, time_us=50_042, previous=Report(42, before))
    message = only(vision_position_delta(report))
    assert isinstance(message, VISION_POSITION_DELTA)
    assert (message.time_usec, message.time_delta_usec, message.confidence) == (50_042, 50_000, 80.0)
    assert message.angle_delta == pytest.approx((0.0, 0.0, math.pi / 2))
    assert message.position_delta == pytest.approx((0.5, 0.0, 0.0))


@pytest.mark.parametrize("elapsed_us", [0, -1, MAX_DELTA_US + 1])
def test_delta_over_no_time_or_too_long_a_time_is_not_sent(elapsed_us: int) -> None:
    report = replace(REPORT, time_us=5_000_000, previous=replace(REPORT, time_us=5_000_000 - elapsed_us))
    assert vision_position_delta(report) == ()


def test_first_delta_needs_a_second_pose() -> None:
    assert vision_position_delta(REPORT) == ()


def test_failed_quality_is_no_negative_confidence() -> None:
    report = replace(REPORT, time_us=43, previous=REPORT, quality=-1)
    assert only(vision_position_delta(report)).confidence == 0.0


@pytest.mark.parametrize("name", ["odometry", "vision", "vision+speed", "mocap"])
def test_covariance_is_the_upper_triangle_and_nan_when_unknown(name: str) -> None:
    known, unknown = (FORMS[name].encode(report)[0] for report in (with_covariance(), REPORT))
    field = "pose_covariance" if name == "odometry" else "covariance"
    triangle = getattr(known, field)
    assert len(triangle) == 21
    assert [triangle[place] for place in (0, 6, 11, 15, 18, 20)] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert math.isnan(getattr(unknown, field)[0])


def test_covariance_may_be_encoded_for_the_autopilot() -> None:
    report = replace(with_covariance(), encoding=CovarianceEncoding.ARDUPILOT_ERROR)
    triangle = only(odometry(report)).pose_covariance
    variance = np.mean([1.0, 2.0, 3.0])
    assert math.cbrt(sum(triangle[place] ** 2 for place in (0, 6, 11))) == pytest.approx(math.sqrt(variance))


@pytest.mark.parametrize("name", FORMS)
def test_every_form_goes_over_the_wire(name: str) -> None:
    report = replace(with_covariance(), time_us=50_042, previous=REPORT)
    sender, receiver = Codec(1, 197), Codec(1, 1)
    for message in FORMS[name].encode(report):
        receiver.feed(sender.encode(message))
        received = receiver.next_received()
        assert isinstance(received, Received)
        assert type(received.message) is type(message)
