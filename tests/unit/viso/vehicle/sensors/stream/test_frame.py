# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame of a stream of poses, which a jump turns and shifts."""

import math

import pytest

from ekf_stub.core.vectors import Quat, euler_of, quat_of_euler, times
from viso.vehicle.sensors.stream.frame import Pose, StreamFrame
from viso.vehicle.sensors.stream.imagined_vehicle import Movement
from viso.vehicle.sensors.vectors import ZERO, Three


def standing(pos: Three, yaw_deg: float) -> Movement:
    return Movement(pos, ZERO, ZERO, quat_of_euler(0.0, 0.0, math.radians(yaw_deg)), ZERO)


def pose(pos: Three, yaw_deg: float, *, roll_deg: float = 0.0) -> Pose:
    return Pose(0.0, pos, quat_of_euler(math.radians(roll_deg), 0.0, math.radians(yaw_deg)))


def yaw_deg_of(quat: Quat) -> float:
    return math.degrees(euler_of(quat)[2])


@pytest.fixture
def frame() -> StreamFrame:
    """Return a frame whose pose (10, 0, 0) heading east is where the vehicle stands, heading north."""
    return StreamFrame(pose((10.0, 0.0, 0.0), 90.0, roll_deg=5.0), standing(ZERO, 0.0))


def test_first_pose_is_where_the_vehicle_is(frame: StreamFrame) -> None:
    shown = frame.apply(pose((10.0, 0.0, 0.0), 90.0))
    assert shown.pos == pytest.approx(ZERO, abs=1e-12)
    assert yaw_deg_of(shown.quat) == pytest.approx(0.0, abs=1e-9)


def test_ways_are_turned_with_the_yaw(frame: StreamFrame) -> None:
    assert frame.apply(pose((10.0, 2.0, -1.0), 100.0)).pos == pytest.approx((2.0, 0.0, -1.0), abs=1e-12)


def test_what_is_near_changes_nothing(frame: StreamFrame) -> None:
    near = pose((10.3, 0.0, 0.0), 93.0)
    before = frame.apply(near)
    assert not frame.settle_jump(near, standing(ZERO, 0.0), 0.033, is_reset=False)
    assert frame.apply(near) == before
    assert not frame.jumps


@pytest.mark.parametrize(
    ("pos", "yaw_deg", "jumps"),
    [
        ((13.0, 0.0, 0.0), 90.0, {"position": 1}),
        ((10.2, 0.0, 0.0), -90.0, {"yaw": 1}),
        ((13.0, 4.0, 1.0), 0.0, {"position": 1, "yaw": 1}),
    ],
)
def test_jump_is_settled(frame: StreamFrame, pos: Three, yaw_deg: float, jumps: dict[str, int]) -> None:
    far, expected = pose(pos, yaw_deg), standing(ZERO, 0.0)
    assert frame.settle_jump(far, expected, 0.033, is_reset=False)
    assert frame.jumps == jumps
    assert not frame.settle_jump(far, expected, 0.033, is_reset=False)


def test_turn_alone_leaves_the_pose_where_it_was(frame: StreamFrame) -> None:
    turned = pose((10.2, 0.0, 0.0), -90.0)
    before = frame.apply(turned).pos
    frame.settle_jump(turned, standing(ZERO, 0.0), 0.033, is_reset=False)
    assert frame.apply(turned).pos == pytest.approx(before, abs=1e-12)


def test_longer_interval_explains_more(frame: StreamFrame) -> None:
    assert not frame.settle_jump(pose((11.3, 0.0, 0.0), 130.0), standing(ZERO, 0.0), 0.3, is_reset=False)


def test_reset_settles_the_smallest_difference(frame: StreamFrame) -> None:
    near = pose((10.1, 0.0, 0.0), 91.0)
    assert frame.settle_jump(near, standing(ZERO, 0.0), 0.033, is_reset=True)
    assert frame.apply(near).pos == pytest.approx(ZERO, abs=1e-12)
    assert frame.jumps == {"reset": 1}


def test_pose_near_where_the_stream_was_going_is_no_jump(frame: StreamFrame) -> None:
    far = pose((13.0, 0.0, 0.0), 120.0)
    steady = pose((12.9, 0.0, 0.0), 118.0)
    assert not frame.settle_jump(far, standing(ZERO, 0.0), 0.033, steady=steady, is_reset=False)


def test_turn_about_the_vertical_is_told_even_when_pitched_up() -> None:
    up = Pose(0.0, ZERO, quat_of_euler(0.0, math.radians(90.0), 0.0))
    frame = StreamFrame(pose(ZERO, 0.0), standing(ZERO, 0.0))
    expected = Movement(ZERO, ZERO, ZERO, up.quat, ZERO)
    assert not frame.settle_jump(up, expected, 0.033, is_reset=False)
    turned = Pose(0.0, ZERO, times(quat_of_euler(0.0, 0.0, math.radians(40.0)), up.quat))
    assert frame.settle_jump(turned, expected, 0.033, is_reset=False)
    assert frame.jumps == {"yaw": 1}
