# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the mission is, and how far it is to the target."""

import math
from typing import TYPE_CHECKING

import pytest

from mav_handlers.senders.missions import mission_current, mission_item_reached, nav_controller_output
from mav_handlers.transfers.mission_items import MissionItem
from mav_handlers.wire.messages import MISSION_CURRENT, MISSION_ITEM_REACHED, NAV_CONTROLLER_OUTPUT
from viso.vehicle.copter.mission import MissionState

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import MakeBench
    from tests.unit.mav_handlers.senders.conftest import Desk


def test_controller_is_silent_until_initialised(make_bench: "MakeBench") -> None:
    bare = make_bench(until_ms=0)
    assert nav_controller_output(bare.vehicle, bare.client.channel, 0) is None


@pytest.mark.parametrize(("yaw_deg", "bearing"), [(0, 0), (90.7, 90), (-90.7, -90)])
def test_controllers_want_the_present_attitude(desk: "Desk", yaw_deg: float, bearing: int) -> None:
    desk.ahrs.face(math.radians(10), math.radians(-20), math.radians(yaw_deg))
    now = desk.ask(nav_controller_output)
    assert (now.nav_roll, now.nav_pitch) == pytest.approx((10, -20))
    assert now == NAV_CONTROLLER_OUTPUT(now.nav_roll, now.nav_pitch, bearing, 0, 0, 0, 0, 0)


def test_home_alone_is_no_mission(desk: "Desk") -> None:
    assert desk.ask(mission_current) == MISSION_CURRENT(seq=0, total=0, mission_state=1, mission_mode=0)
    desk.vehicle.copter.mission.load([MissionItem(16)])
    assert desk.ask(mission_current) == MISSION_CURRENT(seq=0, total=0, mission_state=1, mission_mode=0)


@pytest.mark.parametrize(("state", "number"), [(MissionState.STOPPED, 2), (MissionState.RUNNING, 3)])
def test_mission_is_counted_without_home(desk: "Desk", state: MissionState, number: int) -> None:
    mission = desk.vehicle.copter.mission
    mission.load([MissionItem(16), MissionItem(22), MissionItem(20)])
    assert mission.set_current(2)
    mission.state = state
    assert desk.ask(mission_current) == MISSION_CURRENT(seq=2, total=2, mission_state=number, mission_mode=0)


def test_command_that_was_done_last_is_told(desk: "Desk") -> None:
    desk.vehicle.copter.mission.note_reached(7)
    assert desk.ask(mission_item_reached) == MISSION_ITEM_REACHED(7)
