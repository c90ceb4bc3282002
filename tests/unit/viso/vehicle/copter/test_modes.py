# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which modes may be entered when, and what refusals say."""

from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from ekf_stub.reports import FilterFlag
from viso.vehicle.copter.modes import MODES, ModeNumber

if TYPE_CHECKING:
    from tests.unit.viso.conftest import CopterRig

PLACE = Location(-353_632_610, 1_491_652_300, 58_400)
NEVER = {"FLIP", "AUTOTUNE", "FLOWHOLD", "FOLLOW", "SYSTEMID", "TURTLE"}
REQUIRES_POSITION = {
    "AUTO", "GUIDED", "LOITER", "RTL", "CIRCLE", "DRIFT", "POSHOLD", "BRAKE", "THROW", "AVOID_ADSB", "SMARTRTL",
    "FOLLOW", "ZIGZAG",
}  # fmt: skip
NOT_ARMABLE = {
    "AUTO", "RTL", "CIRCLE", "LAND", "FLIP", "AUTOTUNE", "BRAKE", "AVOID_ADSB", "SMARTRTL", "FOLLOW", "SYSTEMID",
}  # fmt: skip
every_mode = pytest.mark.parametrize("number", MODES, ids=lambda number: MODES[number].name)


def arm(rig: "CopterRig") -> None:
    assert rig.copter.arm(do_checks=False)
    rig.take_texts()
    rig.records.clear()


def test_list_of_modes_is_the_reference_s(rig: "CopterRig") -> None:
    modes = rig.copter.modes.available()
    names = [mode.name for mode in modes]
    assert (len(names), names[:4], names[-1]) == (24, ["AUTO RTL", "AUTO", "ACRO", "STABILIZE"], "TURTLE")
    assert {(mode.standard_mode, mode.properties) for mode in modes} == {(0, 0)}
    assert len({mode.custom_mode for mode in modes}) == 24


def test_modes_that_require_a_position_and_those_that_cannot_be_armed_in_are_the_firmware_s() -> None:
    assert {mode.name for mode in MODES.values() if mode.requires_position} == REQUIRES_POSITION
    assert {mode.name for mode in MODES.values() if not mode.arms} == NOT_ARMABLE


@every_mode
def test_disarmed_vehicle_enters_any_mode_that_can_be_entered_on_the_ground(rig: "CopterRig", number: int) -> None:
    rig.ahrs.navigate(FilterFlag.UNINITIALISED)
    expected = number == ModeNumber.STABILIZE or (MODES[number].name not in NEVER and number != ModeNumber.SMART_RTL)
    assert rig.copter.set_mode(number) is expected
    assert (rig.copter.modes.current.number == number) is expected


@every_mode
def test_armed_vehicle_without_a_position_is_refused_what_requires_one(rig: "CopterRig", number: int) -> None:
    arm(rig)
    rig.ahrs.navigate(FilterFlag.VERT_POS, FilterFlag.VERT_VEL)
    mode = MODES[number]
    refused = f"Mode change to {mode.name} failed: requires position"
    entered = rig.copter.set_mode(number)
    assert (refused in rig.take_texts()) is mode.requires_position
    assert not (entered and mode.requires_position)


def test_armed_vehicle_without_a_height_stays_where_the_pilot_has_the_throttle(rig: "CopterRig") -> None:
    arm(rig)
    rig.ahrs.navigate(FilterFlag.ATTITUDE)
    assert rig.copter.set_mode(ModeNumber.ACRO)
    assert not rig.copter.set_mode(ModeNumber.ALT_HOLD)
    assert rig.texts == [(4, "Mode change to ALT_HOLD failed: need alt estimate")]


def test_armed_vehicle_that_lost_its_height_changes_between_modes_that_need_one(rig: "CopterRig") -> None:
    arm(rig)
    rig.copter.set_mode(ModeNumber.ALT_HOLD)
    rig.ahrs.navigate(FilterFlag.ATTITUDE)
    assert rig.copter.set_mode(ModeNumber.GUIDED_NOGPS)


@pytest.mark.parametrize("number", [8, 10, 12, 13, 26, 29, 99, 255])
def test_unknown_mode_is_refused_and_logged(rig: "CopterRig", number: int) -> None:
    assert not rig.copter.set_mode(number)
    assert rig.texts == [(4, f"No such mode {number}")]
    assert rig.written("ERR", "MODE") == [("ERR", (10, number))]


def test_return_in_auto_needs_a_mission(rig: "CopterRig") -> None:
    assert not rig.copter.set_mode(ModeNumber.AUTO_RTL)
    assert rig.texts == [(4, "Mode change to AUTO RTL failed: No return path or landing sequence found")]
    assert rig.written("ERR") == [("ERR", (10, 27))]


@pytest.mark.parametrize(("number", "texts"), [
    (ModeNumber.FLIP, ["Mode change to FLIP failed: init failed"]),
    (ModeNumber.FOLLOW, ["Set FOLL_ENABLE = 1", "Mode change to FOLLOW failed: init failed"]),
    (ModeNumber.SYSTEMID, ["No axis selected, SID_AXIS = 0", "Mode change to SYSTEMID failed: init failed"]),
    (ModeNumber.SMART_RTL, ["Mode change to SMARTRTL failed: init failed"]),
])  # fmt: skip
def test_refusal_says_which_mode_and_why(rig: "CopterRig", number: int, texts: list[str]) -> None:
    assert not rig.copter.set_mode(number)
    assert rig.take_texts() == texts
    assert rig.written("ERR") == [("ERR", (10, number))]


@pytest.mark.parametrize("number", [ModeNumber.AUTO, ModeNumber.THROW])
def test_auto_without_mission_and_throw_are_for_the_disarmed(rig: "CopterRig", number: int) -> None:
    arm(rig)
    assert not rig.copter.set_mode(number)
    assert rig.take_texts() == [f"Mode change to {MODES[number].name} failed: init failed"]


def test_armed_vehicle_without_home_does_not_return(rig: "CopterRig") -> None:
    arm(rig)
    assert not rig.copter.set_mode(ModeNumber.RTL)
    rig.ahrs.ekf_origin = PLACE
    rig.copter.home.set(PLACE, lock=True)
    assert rig.copter.set_mode(ModeNumber.RTL)


def test_way_back_begins_where_home_was_set_by_the_vehicle_being_there(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.copter.home.set(PLACE, lock=True)
    assert not rig.copter.set_mode(ModeNumber.SMART_RTL)
    rig.ahrs.stand_at(PLACE)
    rig.copter.home.set_here(lock=True)
    assert rig.copter.set_mode(ModeNumber.SMART_RTL)


def test_change_is_logged_and_told(rig: "CopterRig") -> None:
    assert rig.copter.set_mode(ModeNumber.GUIDED)
    assert rig.written("MODE") == [("MODE", (4, 4, 2))]
    assert rig.copter.take_changed() == ["HEARTBEAT"]
    assert rig.copter.is_holding_position()


def test_mode_that_the_vehicle_is_in_is_entered_without_a_trace_but_the_reason(rig: "CopterRig") -> None:
    assert rig.copter.modes.reason == 26
    assert rig.copter.set_mode(ModeNumber.STABILIZE)
    assert (rig.written("MODE"), rig.copter.take_changed(), rig.copter.modes.reason) == ([], [], 2)


@pytest.mark.parametrize("number", [ModeNumber.STABILIZE, ModeNumber.ACRO, ModeNumber.ALT_HOLD, ModeNumber.THROW])
def test_position_controller_does_not_run_where_the_pilot_steers(rig: "CopterRig", number: int) -> None:
    rig.copter.set_mode(number)
    assert not rig.copter.is_holding_position()
