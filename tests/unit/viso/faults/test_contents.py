# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of frames, quality, covariance, and numbers that are none."""

import math

import pytest

from mav_handlers.wire.messages import Message
from tests.unit.viso.faults.rig import (
    BEAT,
    after,
    after_one,
    delta,
    distance,
    encoded,
    flow,
    mocap,
    odometry,
    passed_over,
    position,
    speed,
)


def test_frame_ids_are_those_given() -> None:
    assert after_one("kind: frame_ids", odometry()) == odometry(frame_id=1, child_frame_id=8)
    heard = after_one("kind: frame_ids, frame_id: 20, child_frame_id: 13", odometry())
    assert heard == odometry(child_frame_id=13)


def test_quality_goes_through_its_values_again_and_again() -> None:
    heard = after("kind: quality, values: [50, 0, -1]", *[odometry()] * 5)
    assert [message.quality for message in heard] == [50, 0, -1, 50, 0]


def test_quality_holds_for_its_time() -> None:
    heard = after("kind: quality, values: [50, 7], hold_s: 0.2, start_s: 0.1", *[delta()] * 6)
    assert [message.confidence for message in heard] == [70, 50, 50, 7, 7, 50]


def test_flow_sees_nothing() -> None:
    assert after_one("kind: quality, messages: OPTICAL_FLOW", flow()) == flow(quality=0)


@pytest.mark.parametrize(("value", "message"), [(-1, flow()), (255, odometry())], ids=["flow", "odometry"])
def test_quality_is_as_large_as_its_field_holds(value: int, message: Message) -> None:
    assert after_one("kind: quality, values: [255], messages: OPTICAL_FLOW", flow()) == flow(quality=255)
    reason = passed_over(f"kind: quality, values: [{value}]", encoded(message)[0])
    assert reason == {"does not fit its field": 1}


def test_distances_and_where_they_look_are_those_given() -> None:
    assert after_one("kind: distance, distance_m: 20", distance()) == distance(current_distance=2000)
    assert after_one("kind: looks, orientation: 24", distance()) == distance(orientation=24)


@pytest.mark.parametrize("kind", ["distance", "looks"])
def test_only_distances_are_changed(kind: str) -> None:
    assert after_one(f"kind: {kind}", flow()) == flow()
    assert passed_over(f"kind: {kind}", encoded(flow())[0]) == {"nothing in it to change": 1}


def test_nan_is_in_the_fields_named() -> None:
    heard = after_one("kind: nan, fields: [y, q]", odometry())
    assert (heard.x, heard.z) == (1.0, -4.0)
    assert all(map(math.isnan, (heard.y, *heard.q)))


def test_fields_that_a_message_has_not_are_left() -> None:
    heard = after_one("kind: nan, fields: [vx, yaw]", position())
    assert math.isnan(heard.yaw)
    assert heard.x == 1.0


@pytest.mark.parametrize(("variance", "first", "second", "last"), [("0", 0, 0, 0), ("1.0e+6", 1e6, 0, 1e6)])
def test_covariance_is_a_diagonal(variance: str, first: float, second: float, last: float) -> None:
    odom, pose, velocity = after(f"kind: covariance, variance: {variance}", odometry(), position(), speed())
    for covariance in (odom.pose_covariance, odom.velocity_covariance, pose.covariance, velocity.covariance):
        assert (covariance[0], covariance[1], covariance[-1]) == (first, second, last)
    assert [place for place, value in enumerate(pose.covariance) if value] == ([0, 6, 11, 15, 18, 20] if first else [])
    assert [place for place, value in enumerate(velocity.covariance) if value] == ([0, 4, 8] if first else [])


def test_unknown_covariance_has_nan_in_front() -> None:
    covariance = after_one("kind: covariance, variance: nan", mocap(covariance=(1.0,) * 21)).covariance
    assert math.isnan(covariance[0])
    assert covariance[1:] == (0.0,) * 20


@pytest.mark.parametrize(("kind", "message"), [
    ("frame_ids", position()), ("quality", position()), ("covariance", delta()), ("nan", delta()), ("nan", BEAT),
    ("covariance", distance()), ("nan, fields: [covariance]", distance()),
])  # fmt: skip
def test_message_with_nothing_to_change_is_passed_over(kind: str, message: object) -> None:
    frame = encoded(message)[0]  # type: ignore[arg-type]  # all are messages
    assert passed_over(f"kind: {kind}", frame) == {"nothing in it to change": 1}
