# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion's program in virtual time: what it starts from, and when it does what."""

import dataclasses
import logging
import math
from collections import Counter
from typing import Any

import numpy as np
import pytest

from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ATTITUDE_QUATERNION, LOCAL_POSITION_NED
from tests.unit.viso.demo.hops import make_setup
from viso.companion.odometry.clock_sync import ClockSync
from viso.companion.run.virtual_companion import AutopilotState, VirtualCompanion
from viso.companion.vio.frames import yaw_of_heading
from viso.companion.vio.result import Result
from viso.companion.vio.types import NavCameraFrame, VioState
from viso.geometry.rotation import yaw_of

ORIGIN_W = np.array([5.0, -3.0, 0.25])
HEADING_RAD = 0.4
NOW_NS = 10_000_000_000


def attitude(boot_ms: int = 9_990) -> ATTITUDE_QUATERNION:
    """Return the attitude of a level vehicle."""
    half = 0.5 * HEADING_RAD
    return ATTITUDE_QUATERNION(boot_ms, math.cos(half), 0.0, 0.0, math.sin(half), 0.0, 0.0, 0.0)


@pytest.fixture
def state() -> AutopilotState:
    """An autopilot of which nothing is known."""
    return AutopilotState(ClockSync(), ORIGIN_W)


def test_nothing_is_known_without_an_attitude(state: AutopilotState) -> None:
    state.take(LOCAL_POSITION_NED(9_990, 1.0, 2.0, -3.0, 0.0, 0.0, 0.0), NOW_NS)
    assert state.start_at(NOW_NS) is None


def test_vehicle_that_has_no_position_yet_is_at_rest_in_the_origin(state: AutopilotState) -> None:
    state.take(attitude(), NOW_NS)
    start = state.start_at(NOW_NS)
    assert start is not None
    world_T_body = start.body_T_world.inverse()
    assert world_T_body.t == pytest.approx(ORIGIN_W)
    assert yaw_of(world_T_body.R) == pytest.approx(yaw_of_heading(HEADING_RAD))
    assert start.velocity_b == pytest.approx(0.0)


def test_position_is_carried_on_to_the_time_asked_for(state: AutopilotState) -> None:
    state.take(attitude(), NOW_NS)
    state.take(LOCAL_POSITION_NED(9_990, 1.0, 2.0, -3.0, 4.0, -2.0, 1.0), NOW_NS)
    start = state.start_at(NOW_NS - 100_000_000)
    assert start is not None
    # East, north, up.
    assert start.body_T_world.inverse().t == pytest.approx(ORIGIN_W + np.array([2.0 + 0.2, 1.0 - 0.4, 3.0 + 0.1]))


def test_velocity_is_told_in_the_body(state: AutopilotState) -> None:
    state.take(attitude(), NOW_NS)
    ahead = 5.0 * math.cos(HEADING_RAD), 5.0 * math.sin(HEADING_RAD)
    state.take(LOCAL_POSITION_NED(9_990, 0.0, 0.0, 0.0, *ahead, 0.0), NOW_NS)
    start = state.start_at(NOW_NS)
    assert start is not None
    assert start.velocity_b == pytest.approx([5.0, 0.0, 0.0], abs=1e-6)


def test_position_of_long_ago_is_none(state: AutopilotState) -> None:
    state.take(LOCAL_POSITION_NED(9_000, 1.0, 2.0, -3.0, 4.0, 0.0, 0.0), NOW_NS - 300_000_000)
    state.take(attitude(), NOW_NS)
    assert state.start_at(NOW_NS) is None


class Lonely:
    """A companion on a wire on which an autopilot says its attitude, or nothing."""

    def __init__(self) -> None:
        self.setup = make_setup(9.0)
        self.wire, companion_wire = make_pair()
        self.results: list[Result] = []
        logger = logging.Logger("test")
        logger.addHandler(logging.NullHandler())
        self.companion = VirtualCompanion(
            self.setup.flight, self.setup.config, companion_wire, logger, [self.results.append]
        )
        self._autopilot = Codec(1, 1)
        self.sent: list[Any] = []

    def run(self, end_ms: int, *, says_attitude: bool = True) -> "Lonely":
        """Run for so long since the companion came up."""
        start_us = self.setup.flight.start_ns // 1000
        for ms in range(0, end_ms + 1, 10):
            if says_attitude:
                self.wire.send(self._autopilot.encode(attitude(ms)))
            self.companion.run(start_us + ms * 1000)
            self.sent += messages(self.wire)
        return self


def messages(wire: PairLink) -> list[Any]:
    """Return the messages that have arrived on a wire."""
    codec = Codec(1, 1)
    codec.feed(wire.receive())
    found = []
    while isinstance(received := codec.next_received(), Received):
        found.append(received.message)
    return found


@pytest.mark.slow
def test_companion_asks_for_what_it_wants_to_know_once() -> None:
    lonely = Lonely().run(1200)
    commands = [message for message in lonely.sent if type(message).__name__ == "COMMAND_LONG"]
    assert [(command.command, command.param1, command.param2) for command in commands] == [
        (511, 31, 5e4),
        (511, 32, 5e4),
    ]


@pytest.mark.slow
def test_odometry_begins_with_the_second_frame_and_its_latency() -> None:
    lonely = Lonely().run(900)
    assert [result.state for result in lonely.results] == [VioState.INIT, VioState.INIT, VioState.TRACKING]
    kinds = Counter(type(message).__name__ for message in lonely.sent)
    assert kinds["ODOMETRY"] == 5  # from 0.7 s on, 20 per second


@pytest.mark.slow
def test_without_an_autopilot_nothing_begins() -> None:
    lonely = Lonely().run(1300, says_attitude=False)
    assert lonely.results == []
    assert "ODOMETRY" not in {type(message).__name__ for message in lonely.sent}


@pytest.mark.slow
def test_frames_are_altered_before_anybody_sees_them() -> None:
    lonely = Lonely().run(900)
    lonely.companion.alter_frame = rename_camera
    start_us = lonely.setup.flight.start_ns // 1000
    lonely.companion.run(start_us + 1_000_000)
    assert lonely.results[-1].state is VioState.LOST


def rename_camera(frame: NavCameraFrame) -> NavCameraFrame:
    """Return a frame of another camera."""
    return dataclasses.replace(frame, camera_id="another")


@pytest.mark.slow
def test_same_time_twice_changes_nothing() -> None:
    lonely = Lonely().run(900)
    before = len(lonely.results)
    lonely.companion.run(lonely.setup.flight.start_ns // 1000 + 900_000)
    assert len(lonely.results) == before
    assert messages(lonely.wire) == []
