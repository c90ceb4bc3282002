# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a mission goes on from command to command, whatever they do."""

import pytest

from ap_core.location import Location
from mav_handlers.transfers.mission_items import Cmd, MissionItem
from tests.unit.viso.conftest import CopterRig
from viso.firmware.releases import JULY_2025, STABLE_4_6, Firmware
from viso.vehicle.copter.mission import Command, Mission, MissionState

HOME = MissionItem(Cmd.NAV_WAYPOINT)
TAKEOFF, WAYPOINT, LAND = MissionItem(Cmd.NAV_TAKEOFF), MissionItem(Cmd.NAV_WAYPOINT), MissionItem(Cmd.NAV_LAND)
DELAY, SPEED = MissionItem(Cmd.CONDITION_DELAY), MissionItem(Cmd.DO_CHANGE_SPEED)
AUX = MissionItem(Cmd.DO_AUX_FUNCTION)


def jump(to: int, times: int) -> MissionItem:
    return MissionItem(Cmd.DO_JUMP, params=(float(to), float(times), 0.0, 0.0))


class Note:
    """A crew that notes what it does; a command is done once its number stands in ``done``."""

    def __init__(self) -> None:
        self.begun: list[int] = []
        self.done: set[int] = set()
        self.cannot: set[int] = set()
        self.ends = 0

    def start(self, command: Command) -> bool:
        self.begun.append(command.seq)
        return command.seq not in self.cannot

    def verify(self, command: Command) -> bool:
        return command.seq in self.done

    def end(self) -> None:
        self.ends += 1


class Run:
    """A mission with its crew."""

    def __init__(self, rig: CopterRig, *items: MissionItem) -> None:
        self.rig = rig
        self.mission: Mission = rig.copter.mission
        self.crew = self.mission.crew = Note()
        self.mission.load([HOME, *items])
        self.mission.start()

    def finish(self, *numbers: int) -> list[int]:
        """Let commands be done, and return those that begin in the next two updates."""
        self.crew.done.update(numbers)
        before = len(self.crew.begun)
        self.mission.update()
        self.mission.update()
        self.crew.done.difference_update(numbers)
        return self.crew.begun[before:]


def test_commands_before_a_navigation_command_are_done_one_after_the_other_meanwhile(rig: CopterRig) -> None:
    run = Run(rig, TAKEOFF, DELAY, SPEED, WAYPOINT, LAND)
    assert run.crew.begun == [1]
    assert run.finish(1) == [2, 4]
    assert run.finish(2) == [3]
    assert run.finish(4) == [5]
    assert run.finish(5) == []
    assert (run.mission.state, run.crew.ends) == (MissionState.COMPLETE, 1)


def test_command_that_cannot_be_done_is_followed_by_the_next(rig: CopterRig) -> None:
    run = Run(rig, TAKEOFF, WAYPOINT, LAND)
    run.crew.cannot.add(2)
    assert run.finish(1) == [2, 3]
    assert run.mission.nav_seq == 3


@pytest.mark.parametrize(("firmware", "again"), [(JULY_2025, [2, 2, 4]), (STABLE_4_6, [4])])
def test_jump_is_done_as_often_as_asked_for(rig: CopterRig, firmware: Firmware, again: list[int]) -> None:
    rig.vehicle.release = firmware.endpoint
    run = Run(rig, TAKEOFF, WAYPOINT, jump(2, 2), WAYPOINT, jump(3, -1))
    begun = [seq for finished in (1, 2, 2, 2) for seq in run.finish(finished)]
    assert begun == [2, 2, 2, 4]
    assert [text for text in rig.take_texts() if "Jump" in text] == ["Mission: 3 Jump 1/2", "Mission: 3 Jump 2/2"]
    begun = []
    while len(begun) < len(again):
        begun += run.finish(4, 2)
    assert begun[: len(again)] == again


def test_jumps_in_a_circle_end_the_mission(rig: CopterRig) -> None:
    run = Run(rig, TAKEOFF, jump(3, -1), jump(2, -1))
    assert run.finish(1) == []
    assert run.mission.state is MissionState.COMPLETE


def test_jump_to_a_tag(rig: CopterRig) -> None:
    tag = MissionItem(Cmd.JUMP_TAG, params=(7.0, 0.0, 0.0, 0.0))
    run = Run(rig, TAKEOFF, MissionItem(Cmd.DO_JUMP_TAG, params=(7.0, 1.0, 0.0, 0.0)), WAYPOINT, tag, LAND)
    assert run.finish(1) == [5]


@pytest.mark.parametrize(("items", "starts"), [
    ((TAKEOFF,), True),
    ((AUX, MissionItem(Cmd.NAV_DELAY), TAKEOFF), True),
    ((WAYPOINT, TAKEOFF), False),
    ((), False),
])  # fmt: skip
def test_takeoff_at_the_beginning(rig: CopterRig, items: tuple[MissionItem, ...], starts: bool) -> None:
    rig.copter.mission.load([HOME, *items])
    assert rig.copter.mission.starts_with_takeoff() == starts


def test_stopped_mission_goes_on_with_its_current_command(rig: CopterRig) -> None:
    run = Run(rig, TAKEOFF, DELAY, WAYPOINT, LAND)
    run.finish(1)
    run.mission.stop()
    assert run.mission.set_current(4)
    assert run.crew.begun == [1, 2, 3]
    run.mission.start_or_resume()
    assert run.crew.begun[3:] == [4]
    run.mission.stop()
    rig.params.set("MIS_RESTART", 1)
    run.mission.start_or_resume()
    assert run.crew.begun[4:] == [1]


def test_mission_whose_current_command_is_gone_begins_anew(rig: CopterRig) -> None:
    run = Run(rig, TAKEOFF, WAYPOINT, LAND)
    run.finish(1)
    run.finish(2)
    run.mission.stop()
    run.mission.begin(2)
    run.mission.resume()
    assert run.mission.nav_seq == 1


def test_items_are_logged_as_they_come_and_as_they_begin(rig: CopterRig) -> None:
    rig.logger.update(True, rig.params)
    run = Run(rig, TAKEOFF, LAND)
    run.mission.complete()
    assert [(name, values[:3]) for name, values in rig.written("CMD", "MISE")] == [
        ("MISE", (3, 1, 22)),
        ("CMD", (3, 0, 16)),
        ("CMD", (3, 1, 22)),
        ("CMD", (3, 2, 21)),
    ]


def test_first_item_is_home_whatever_was_uploaded(rig: CopterRig) -> None:
    mission = rig.copter.mission
    mission.load([MissionItem(Cmd.NAV_LAND), TAKEOFF])
    rig.copter.home.place = Location(10, 20, 3050)
    assert mission.get(0) == MissionItem(Cmd.NAV_WAYPOINT, x=10, y=20, z=30.5)
