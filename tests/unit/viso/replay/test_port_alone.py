# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Streams through the batch port: what of a stream has an effect. That bits agree is shown in tests/parity."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ap_core.clock import VirtualClock
from ap_core.param import ParamTable
from ekf_stub.ahrs.ahrs_recorded import RecordedStates
from ekf_stub.ahrs.ahrs_settable import SettableAhrs
from ekf_stub.inputs.sources import EkfSources
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import COMMAND_LONG, HEARTBEAT, PARAM_SET, VISION_POSITION_DELTA, Message
from tests.places import DATA
from viso.bench.odometry import odometry_at
from viso.replay.port_alone import following, replay_port
from viso.streams.stream_kinds import Stream, StreamMessage, read_stream

LOG = DATA / "logs" / "flight_mav_extyaw.BIN.xz"
START_US = 30_000_000
PERIOD_US = 33_333
MAV, T265 = {"VISO_TYPE": 1.0}, {"VISO_TYPE": 2.0}
NO_COMMAND = (0.0,) * 5


def stream_of(messages: Sequence[Message], sender: tuple[int, int] = (1, 197)) -> Stream:
    codec = Codec(*sender)
    frames = [codec.encode(message) for message in messages]
    times = range(START_US, START_US + PERIOD_US * len(frames), PERIOD_US)
    return Stream("made", tuple(map(StreamMessage, times, frames)))


def odometry(count: int, first: int = 0) -> list[Message]:
    return [odometry_at(START_US + PERIOD_US * number) for number in range(first, first + count)]


def north(replay: Any) -> list[float]:
    return [float(value) for value in replay.pose_results.pos[0]]


def test_samples_are_consumed_and_counted() -> None:
    replay = replay_port(stream_of(odometry(40)), MAV)
    assert replay.verdict_counts() == {"consumed": 80}
    assert (replay.healthy, replay.quality) == (True, 90)
    assert replay.poses.time_us.tolist()[:2] == [START_US, START_US + PERIOD_US]


def test_messages_of_another_kind_have_no_effect() -> None:
    plain = replay_port(stream_of(odometry(5)), MAV)
    mixed = replay_port(stream_of([*odometry(5), HEARTBEAT(2, 3, 0, 0, 0, 3)]), MAV)
    assert mixed.verdict_counts() == plain.verdict_counts()


def test_bytes_that_are_no_message_have_no_effect() -> None:
    stream = stream_of(odometry(3))
    damaged = replace(stream, messages=(StreamMessage(START_US, b"no message"), *stream.messages))
    assert replay_port(damaged, MAV).verdict_counts() == {"consumed": 6}


def test_messages_under_the_autopilots_own_ids_are_not_taken() -> None:
    assert replay_port(stream_of(odometry(5), sender=(1, 1)), MAV).verdict_counts() == {}


def test_parameter_that_is_set_holds_from_there_on() -> None:
    messages = [*odometry(20, 30), PARAM_SET(1, 1, "VISO_SCALE", 2.0, 9), *odometry(20, 30)]
    positions = north(replay_port(stream_of(messages), MAV))
    assert positions[20:] == [2 * one for one in positions[:20]]


def test_delta_counts_for_health() -> None:
    delta = VISION_POSITION_DELTA(0, 20_000, (0.0,) * 3, (0.1, 0.0, 0.0), 90.0)
    gap = [HEARTBEAT(2, 3, 0, 0, 0, 3)] * 11
    with_delta = [*odometry(1), *gap[:6], delta, *gap[:4], *odometry(1)]
    without = [*odometry(1), *gap, *odometry(1)]
    assert [
        replay_port(stream_of(messages), MAV).pose_results.was_healthy.tolist() for messages in (with_delta, without)
    ] == [[False, True], [False, False]]


def known_attitude(_clock: VirtualClock, _params: ParamTable, _sources: EkfSources) -> SettableAhrs:
    return SettableAhrs(is_initialised=True, is_dcm_yaw_initialised=True, yaw=np.float32(0.5))


def test_command_aligns_the_camera_again() -> None:
    align = COMMAND_LONG(1, 1, 218, 0, 80.0, 2.0, *NO_COMMAND)
    messages = [*odometry(20), align, *odometry(20)]
    texts = replay_port(stream_of(messages), T265, make_ahrs=known_attitude).texts
    assert [(text.time_us, text.text) for text in texts] == [
        (START_US, "VisOdom: yaw shifted 28 to 28 deg"),
        (START_US + 21 * PERIOD_US, "VisOdom: yaw shifted 0 to 28 deg"),
    ]


def test_other_commands_do_not() -> None:
    other = COMMAND_LONG(1, 1, 218, 0, 80.0, 1.0, *NO_COMMAND)
    assert len(replay_port(stream_of([*odometry(2), other, *odometry(2)]), T265, make_ahrs=known_attitude).texts) == 1


def test_without_an_attitude_the_camera_is_not_aligned() -> None:
    replay = replay_port(stream_of(odometry(20)), T265)
    assert replay.texts == ()
    assert replay.verdict_counts() == {"consumed": 40}


def test_camera_follows_the_position_of_a_log_while_another_source_is_in_use() -> None:
    time_us = np.array([1e6, 60e6])
    rest = np.zeros((2, 3))
    states = RecordedStates(time_us, rest, time_us, rest + np.array([7.0, 8.0, -9.0]))
    settings = {**T265, "EK3_SRC1_POSXY": 3.0, "EK3_SRC2_POSXY": 6.0, "EK3_SRC1_POSZ": 1.0, "EK3_SRC2_POSZ": 6.0}
    replay = replay_port(stream_of(odometry(20)), settings, make_ahrs=following(states))
    assert np.abs(replay.pose_results.pos - [[7.0], [8.0], [-9.0]]).max() < 1e-5


def test_flight_log_is_replayed() -> None:
    stream = read_stream(LOG, START_US)
    replay = replay_port(stream, stream.params, baud=stream.baud)
    assert replay.verdict_counts() == {"consumed": len(replay.poses) + len(replay.velocities)}
    assert len(replay.poses) > 1000


@pytest.mark.parametrize("messages", [[], [HEARTBEAT(2, 3, 0, 0, 0, 3)]])
def test_stream_without_samples_comes_to_nothing(messages: list[Message]) -> None:
    replay = replay_port(stream_of(messages), MAV)
    assert (len(replay.poses), len(replay.velocities), replay.verdict_counts()) == (0, 0, {})
