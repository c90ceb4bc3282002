# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the horizon has reached, and how it is moved from the camera to the IMU."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.filter.inertial import InertialStep

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

NO_ARM = (0.0, 0.0, 0.0)
NO_TURN = np.zeros(3)


def hand_in(parts: "FilterParts", stamp_ms: int, pos: Vector3f, *, err: float = 0.2, reset_ms: int = 0) -> None:
    parts.ingest.write_pose(pos, Quaternion(), (f32(err), f32(0.2)), stamp_ms, 0, reset_ms)


def recall(
    parts: "FilterParts",
    horizon_ms: int,
    *,
    rates: tuple[float, float, float] = NO_ARM,
    lever_arm: tuple[float, float, float] = NO_ARM,
) -> None:
    parts.ingest.horizon_ms = horizon_ms
    step = InertialStep(0, np.zeros(3), np.array(rates), 1.0, 1.0)
    parts.delayed.recall(parts.state, step, lever_arm)


def test_nothing_is_known_at_first(make_parts: MakeParts) -> None:
    parts = make_parts()
    recall(parts, 5000)
    assert (parts.delayed.pose, parts.delayed.velocity) == (None, None)
    assert (parts.delayed.has_pose, parts.delayed.has_velocity) == (False, False)


def test_pose_comes_due_once_and_stays_known(make_parts: MakeParts) -> None:
    parts = make_parts()
    hand_in(parts, 5006, Vector3f(1, 2, 3), err=0.25, reset_ms=7)
    recall(parts, 4999)
    assert not parts.delayed.has_pose
    recall(parts, 5000)
    assert parts.delayed.has_pose
    recall(parts, 5013)
    assert not parts.delayed.has_pose
    pose = parts.delayed.pose
    assert pose is not None
    assert (pose.time_ms, pose.pos.tolist(), pose.err, pose.is_reset) == (5000, [1, 2, 3], 0.25, True)


def test_velocity_comes_due_by_itself(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.ingest.write_velocity(Vector3f(1, 2, 3), f32(0.25), 5006, 0)
    recall(parts, 5000)
    velocity = parts.delayed.velocity
    assert (parts.delayed.has_pose, parts.delayed.has_velocity) == (False, True)
    assert velocity is not None
    assert (velocity.time_ms, velocity.vel.tolist(), velocity.err) == (5000, [1, 2, 3], 0.25)


def test_lever_arm_turns_with_the_vehicle(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.turn_to(yaw=math.pi / 2)
    hand_in(parts, 5006, Vector3f(1, 2, 3))
    recall(parts, 5000, lever_arm=(0.5, 0.0, 0.1))
    assert parts.delayed.pose is not None
    assert parts.delayed.pose.pos == pytest.approx([1, 1.5, 2.9])


def test_camera_away_from_the_imu_sees_velocity_as_the_vehicle_turns(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.ingest.write_velocity(Vector3f(1, 0, 0), f32(0.1), 5006, 0)
    recall(parts, 5000, rates=(0.0, 0.0, 2.0), lever_arm=(0.5, 0.0, 0.0))
    assert parts.delayed.velocity is not None
    assert parts.delayed.velocity.vel == pytest.approx([1, -1, 0])


@pytest.mark.slow
@given(roll=st.floats(-3, 3), pitch=st.floats(-1.5, 1.5), yaw=st.floats(-3, 3), arm=st.tuples(*[st.floats(-5, 5)] * 3))
def test_camera_at_rest_around_a_vehicle_that_only_turns_gives_its_place(
    make_parts: MakeParts, roll: float, pitch: float, yaw: float, arm: tuple[float, float, float]
) -> None:
    parts = make_parts()
    parts.turn_to(roll, pitch, yaw)
    seen = parts.state.rotation @ np.array(arm)
    hand_in(parts, 5006, Vector3f(*seen))
    recall(parts, 5000, lever_arm=arm)
    assert parts.delayed.pose is not None
    assert parts.delayed.pose.pos == pytest.approx([0, 0, 0], abs=1e-5)


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinite_sample_is_told_of_and_not_believed(make_parts: MakeParts, value: float) -> None:
    parts = make_parts()
    hand_in(parts, 5006, Vector3f(1, 2, 3))
    recall(parts, 5000)
    hand_in(parts, 5036, Vector3f(value, 0, 0))
    parts.ingest.write_velocity(Vector3f(0, value, 0), f32(0.1), 5036, 0)
    recall(parts, 5030)
    assert (parts.delayed.has_pose, parts.delayed.has_velocity) == (False, False)
    assert [outcome[:2] for outcome in parts.outcomes if outcome[1] == "model_not_finite"] == [
        ("pose", "model_not_finite"),
        ("velocity", "model_not_finite"),
    ]
    assert parts.delayed.pose is not None
    assert parts.delayed.pose.pos.tolist() == [1, 2, 3]
