# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that come one by one: the same messages as of a recording, and what restarts or is left out."""

import dataclasses
import math
from types import SimpleNamespace as Content
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ODOMETRY
from viso.geometry.frame_change import FrameChange, parse_axes
from viso.geometry.trajectory_files import FAR_OFF, NO_ROTATION, NOT_FINITE, NOT_LATER, usable
from viso.streams.bag_formats import PoseMessage, collect
from viso.streams.live import NO_TIME, NO_VELOCITY, LiveOptions, LivePoses
from viso.streams.messages import FORMS
from viso.streams.player import Playback, RecordedEngine

CHANGE = FrameChange(*parse_axes("enu_flu"), np.eye(3))
PERIOD_NS = 33_333_333
Three = tuple[float, float, float]


def vector(three: Three) -> Content:
    return Content(x=three[0], y=three[1], z=three[2])


def odometry(
    number: float, position: Three = (0, 0, 1), velocity: Three | None = (1, 0, 0), yaw: float = 0.0
) -> PoseMessage:
    """Return what comes at a number of periods: Odometry, or PoseStamped where no velocity is given."""
    sec, nanosec = divmod(1_700_000_000 * 10**9 + round(number * PERIOD_NS), 10**9)
    header = Content(stamp=Content(sec=sec, nanosec=nanosec), frame_id="odom")
    turned = Content(w=math.cos(yaw / 2), x=0.0, y=0.0, z=math.sin(yaw / 2))
    pose = Content(position=vector(position), orientation=turned)
    if velocity is None:
        return 0, "geometry_msgs/msg/PoseStamped", Content(header=header, pose=pose)
    twist = Content(linear=vector(velocity))
    covariance = (0.01 * np.eye(6)).ravel().tolist()
    content = Content(
        header=header,
        child_frame_id="base_link",
        pose=Content(pose=pose, covariance=covariance),
        twist=Content(twist=twist),
    )
    return 0, "nav_msgs/msg/Odometry", content


def live(**options: Any) -> LivePoses:
    return LivePoses(LiveOptions(CHANGE.apply, **options))


def told(poses: LivePoses, *messages: PoseMessage) -> list[Any]:
    """Return the ODOMETRY that each message is told as, None where it is not."""
    return [taken and taken.messages[0] for taken in map(poses.take, messages)]


def resets(poses: LivePoses, *messages: PoseMessage) -> list[int | None]:
    return [message and message.reset_counter for message in told(poses, *messages)]


def test_they_are_told_as_a_recording_of_them_is() -> None:
    messages = [odometry(number, (0.1 * number, 0.2, 1.0), (3.0, 0.1, -0.2), 0.01 * number) for number in range(5)]
    engine = RecordedEngine(CHANGE.apply(usable(collect("bag", messages))), Playback())
    for one in told(live(), *messages):
        (recorded,) = engine.report()
        assert isinstance(recorded, ODOMETRY)
        assert dataclasses.replace(one, time_usec=0) == dataclasses.replace(recorded, time_usec=0)


def test_the_stamp_is_the_message_s_own() -> None:
    (one,) = told(live(), odometry(3))
    assert one.time_usec == 1_700_000_000_099_999


def test_a_pose_without_a_velocity_has_that_since_the_one_before() -> None:
    poses = live()
    none, one = told(poses, odometry(0, (0, 0, 1), None), odometry(3, (0, 0.2, 1), None))
    assert none is None
    assert poses.left_out == {NO_VELOCITY: 1}
    assert (one.vx, one.vy, one.vz) == pytest.approx((0, -2, 0), abs=1e-6)  # facing east, and north is to the left


def test_a_velocity_of_zeros_is_believed_once_there_was_another() -> None:
    rest, moved = odometry(0, velocity=(0, 0, 0)), odometry(1, (0.1, 0, 1), (0, 0, 0))
    assert [one.vx for one in told(live(), rest, moved)] == pytest.approx([0, 3])
    assert [one.vx for one in told(live(), odometry(-1, (-0.1, 0, 1), (3, 0, 0)), rest, moved)][1:] == [0, 0]


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (odometry(1, (math.nan, 0, 1)), NOT_FINITE),
        (odometry(1, velocity=(math.inf, 0, 0)), NOT_FINITE),
        (odometry(1, yaw=math.nan), NOT_FINITE),
        (odometry(-2), NOT_LATER),
        (odometry(0), NOT_LATER),
        (odometry(1e8), FAR_OFF),
        (odometry(-1e12), NO_TIME),
    ],
)
def test_what_cannot_be_used_is_left_out_and_the_rest_goes_on(bad: PoseMessage, reason: str) -> None:
    poses = live()
    assert resets(poses, odometry(0), bad, odometry(2)) == [0, None, 0]
    assert poses.left_out == {reason: 1}


def test_an_attitude_that_is_no_rotation_is_left_out() -> None:
    message, poses = odometry(0), live()
    message[2].pose.pose.orientation.w = 0.5
    assert told(poses, message) == [None]
    assert poses.left_out == {NO_ROTATION: 1}


@given(data=st.data())
@settings(max_examples=10)
def test_whatever_comes_raises_nothing_and_is_told_in_finite_numbers(data: st.DataObject) -> None:
    poses, anything = live(), st.floats()
    for number in range(2):
        message = data.draw(st.builds(odometry, st.floats(-1e9, 1e9), *[st.tuples(anything, anything, anything)] * 2))
        message[2].pose.pose.orientation.x = data.draw(anything)
        message[2].pose.covariance = data.draw(st.lists(anything, min_size=36, max_size=36))
        for one in filter(None, told(poses, odometry(number), message)):
            assert np.isfinite([one.x, one.y, one.z, *one.q, one.vx, one.vy, one.vz]).all()
            assert Codec(1, 197).encode(one)


def test_a_jump_counts_as_a_reset_and_fast_flight_does_not() -> None:
    fast = [odometry(number, (number, 0, 1), (30, 0, 0)) for number in range(3)]
    assert resets(live(), *fast) == [0, 0, 0]
    assert resets(live(), *fast, odometry(3, (3, 0.7, 1), (30, 0, 0))) == [0, 0, 0, 1]
    assert resets(live(reset_jump_m=1.0), *fast, odometry(3, (3, 0.7, 1), (30, 0, 0))) == [0, 0, 0, 0]


def test_a_turn_at_once_counts_as_a_reset_and_fast_turning_does_not() -> None:
    turning = [odometry(number, yaw=0.25 * number) for number in range(2)]
    assert resets(live(), odometry(0), odometry(1, yaw=0.15), odometry(2, yaw=0.38)) == [0, 0, 0]
    assert resets(live(), *turning) == [0, 1]


def test_without_velocities_the_first_pose_after_a_reset_is_not_told() -> None:
    there = [odometry(number, (5.0 * (number > 1), 0, 1), None) for number in range(4)]
    assert resets(live(), *there) == [None, 0, None, 1]


def test_a_message_that_tells_no_velocity_needs_none() -> None:
    assert resets(live(form=FORMS["vision"]), odometry(0, velocity=None)) == [0]


def test_stamps_that_begin_again_begin_anew_after_one_pose() -> None:
    """As those of a bag that is played in a loop."""
    assert resets(live(), *(odometry(number) for number in (100, 101, 0, 1, 2))) == [0, 0, None, 1, 1]


def test_poses_that_overtake_each_other_do_not_begin_anew() -> None:
    assert resets(live(), *(odometry(number) for number in (10, 8, 9, 11))) == [0, None, None, 0]


def test_a_sender_that_begins_anew_counts_once() -> None:
    poses = live()
    poses.begin_anew()
    assert resets(poses, odometry(0)) == [0]
    poses.begin_anew()
    poses.begin_anew()
    assert resets(poses, odometry(0)) == [1]


def test_from_zero_takes_off_the_first_position_for_good() -> None:
    far = [odometry(number, (4e6 + 0.1 * number, 5e6, 100.0)) for number in range(3)]
    assert [one.y for one in told(live(from_zero=True), *far)] == pytest.approx([0, 0.1, 0.2], abs=1e-6)


def test_velocities_may_be_taken_from_positions_whatever_is_told() -> None:
    poses = LivePoses(LiveOptions(lambda recorded: CHANGE.apply(recorded.without_velocities())))
    none, one = told(poses, odometry(0, (0, 0, 1), (9, 9, 9)), odometry(1, (0.1, 0, 1), (9, 9, 9)))
    assert none is None
    assert (one.vx, one.vy, one.vz) == pytest.approx((3, 0, 0), abs=1e-5)
