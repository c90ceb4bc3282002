# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Streams of a scenario: when messages are due, and what is in them."""

import math
from typing import Any

import pytest

from mav_handlers.wire.messages import ODOMETRY, VISION_POSITION_DELTA, VISION_POSITION_ESTIMATE, Message
from viso.recording.scenario import Jump, Stream
from viso.recording.vision import Pose, VisionStream, pose_at

START_US = 7_000_000


def messages(stream: VisionStream, until_us: int = 1_000_000) -> list[tuple[int, Any]]:
    """Return when after the start each message is due, and the message."""
    found: list[tuple[int, Message]] = []
    while (due_us := stream.next_due_us()) <= START_US + until_us:
        found += ((due_us - START_US, message) for message in stream.due_messages(due_us))
    return found


def running(name: str = "VISION_POSITION_ESTIMATE", **values: Any) -> VisionStream:
    return VisionStream(Stream(name, **{"rate_hz": 10, **values}), START_US)


def test_stamps_are_of_the_senders_clock() -> None:
    sent = messages(running(stamp_offset_s=50, drift_ppm=1000, stamp_unit_us=1000), 200_000)
    assert [(due_us, one.usec) for due_us, one in sent] == [(0, 50_000), (100_000, 50_100), (200_000, 50_200)]
    assert messages(running(stamp_offset_s=0, drift_ppm=1000), 100_000)[1][1].usec == 100_100


def test_delays_take_turns_and_may_change_the_order() -> None:
    sent = messages(running(delays_ms=(0, 150, 0), stamp_offset_s=0), 300_000)
    assert [(due_us, one.usec) for due_us, one in sent] == [
        (0, 0),
        (200_000, 200_000),
        (250_000, 100_000),
        (300_000, 300_000),
    ]


def test_jump_moves_turns_and_counts() -> None:
    stream = running()
    stream.jump(Jump((1, 2, 3), 90, True))
    stream.jump(Jump((1, 0, 0), 0, False))
    [(_, message)] = messages(stream, 0)
    assert (message.x, message.y, message.z, message.reset_counter) == (2, 2, 3, 1)
    assert message.yaw == pytest.approx(math.pi / 2)


def test_silence_leaves_frames_out() -> None:
    assert [due_us for due_us, _ in messages(running(silent_every_s=0.5, silent_for_s=0.2), 900_000)] == [
        *range(0, 500_000, 100_000),
        *range(700_000, 1_000_000, 100_000),
    ]
    stream = running()
    stream.be_silent(START_US + 250_000)
    assert [due_us for due_us, _ in messages(stream, 400_000)] == [300_000, 400_000]


def test_change_of_the_rate_keeps_time_and_stamps() -> None:
    stream = running(stamp_offset_s=0)
    messages(stream, 400_000)
    stream.change({"rate_hz": 5})
    assert [(due_us, one.usec) for due_us, one in messages(stream, 1_000_000)] == [
        (600_000, 600_000),
        (800_000, 800_000),
        (1_000_000, 1_000_000),
    ]


def test_noise_is_the_same_each_time() -> None:
    first, second = (messages(running(noise_m=0.1, noise_deg=1, random_delay_ms=9)) for _ in range(2))
    assert first == second
    assert len({message.x for _, message in first}) > 5


def test_circle_is_round_and_its_velocity_goes_along() -> None:
    stream = Stream("ODOMETRY", motion="circle", position_m=(5, 0, -1), radius_m=2, period_s=8)
    assert pose_at(stream, 2).position_m == pytest.approx((5, 2, -1))
    assert pose_at(stream, 2).velocity_m_s == pytest.approx((-math.pi / 2, 0, 0))


def test_velocity_of_odometry_is_along_the_body() -> None:
    [(_, message)] = messages(running("ODOMETRY", motion="line", velocity_m_s=(2, 0, 0), heading_deg=90), 0)
    assert isinstance(message, ODOMETRY)
    assert (message.vx, message.vy, message.vz) == pytest.approx((0, -2, 0), abs=1e-9)
    assert (message.frame_id, message.child_frame_id) == (20, 12)


def test_delta_tells_what_changed_since_the_frame_before() -> None:
    _, (_, message) = messages(running("VISION_POSITION_DELTA", motion="line", velocity_m_s=(1, 0, 0)), 100_000)
    assert isinstance(message, VISION_POSITION_DELTA)
    assert message.time_delta_usec == 100_000
    assert message.position_delta == pytest.approx((0.1, 0, 0))


def test_truth_is_sent_from_when_it_is_told() -> None:
    stream = running(motion="truth")
    assert messages(stream, 100_000) == []
    stream.take_truth(Pose((1, 2, -3), (0, 0, 0), (0, 0, 1)))
    [(due_us, message)] = messages(stream, 200_000)
    assert isinstance(message, VISION_POSITION_ESTIMATE)
    assert (due_us, message.x, message.y, message.z, message.yaw) == (200_000, 1, 2, -3, 1)
