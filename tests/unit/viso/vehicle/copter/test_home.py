# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When home is set, what is logged and told of it, and the field's elevation."""

from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location

if TYPE_CHECKING:
    from tests.unit.viso.conftest import CopterRig

ORIGIN = Location(-353_632_610, 1_491_652_300, 58_400)
PLACE = Location(-353_632_500, 1_491_652_000, 58_412)
ORIGIN_LOGGED = ("ORGN", (0, ORIGIN.lat, ORIGIN.lng, ORIGIN.alt_cm))


def home_logged(place: Location) -> tuple[str, tuple[int, ...]]:
    return "ORGN", (1, place.lat, place.lng, place.alt_cm)


def settle(rig: "CopterRig") -> None:
    """Let the vehicle have an origin, a place and its first home."""
    rig.ahrs.ekf_origin = ORIGIN
    rig.ahrs.stand_at(PLACE)
    rig.run_for(0.1)
    rig.take_texts()
    rig.records.clear()
    rig.copter.home.take_changed()


def test_home_is_where_the_vehicle_is_as_soon_as_that_is_known(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = ORIGIN
    rig.run_for(1)
    assert not rig.copter.has_home()
    rig.ahrs.stand_at(PLACE)
    rig.run_for(0.1)
    assert rig.copter.home.place == PLACE
    assert not rig.copter.home.locked
    assert rig.copter.mission.count() == 1


def test_first_home_is_an_event_and_origin_and_home_are_logged(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = ORIGIN
    rig.ahrs.stand_at(PLACE)
    rig.run_for(0.1)
    assert rig.written("EV", "ORGN") == [("EV", (25,)), ORIGIN_LOGGED, home_logged(PLACE)]


def test_home_stays_when_the_vehicle_moves(rig: "CopterRig") -> None:
    settle(rig)
    rig.ahrs.stand_at(ORIGIN)
    rig.run_for(10)
    assert rig.copter.home.place == PLACE


def test_home_is_told_to_be_changed_once(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = ORIGIN
    rig.ahrs.stand_at(PLACE)
    assert not rig.copter.home.take_changed()
    rig.run_for(0.1)
    assert [rig.copter.home.take_changed(), rig.copter.home.take_changed()] == [True, False]


def test_home_of_an_armed_vehicle_is_level_with_the_origin(rig: "CopterRig") -> None:
    rig.copter.arm(do_checks=False)
    rig.ahrs.ekf_origin = ORIGIN
    rig.run_for(0.1)
    assert not rig.copter.has_home()
    rig.ahrs.stand_at(PLACE)
    rig.run_for(0.1)
    assert rig.copter.home.place == Location(PLACE.lat, PLACE.lng, ORIGIN.alt_cm)
    assert rig.copter.home.has_return_path


def test_arming_sets_home_again(rig: "CopterRig") -> None:
    settle(rig)
    rig.ahrs.stand_at(ORIGIN)
    rig.copter.arm(do_checks=False)
    assert rig.copter.home.place == ORIGIN
    assert rig.written("EV", "ORGN") == [("EV", (10,)), ORIGIN_LOGGED, home_logged(ORIGIN)]
    assert rig.ahrs.height_resets == 1  # by the elevation


def test_arming_without_home_lets_heights_start_over(rig: "CopterRig") -> None:
    rig.copter.arm(do_checks=False)
    assert rig.ahrs.height_resets == 1
    assert rig.written("EV", "ORGN") == [("EV", (10,)), ("EV", (60,))]


@pytest.mark.parametrize("here", [False, True])
def test_home_of_a_client_is_locked_so_that_arming_leaves_it(rig: "CopterRig", here: bool) -> None:
    settle(rig)
    assert rig.copter.home.set_here(lock=True) if here else rig.copter.home.set(PLACE, lock=True)
    rig.ahrs.stand_at(ORIGIN)
    rig.copter.arm(do_checks=False)
    assert rig.copter.home.place == PLACE


def test_later_home_is_no_event(rig: "CopterRig") -> None:
    settle(rig)
    rig.copter.home.set(ORIGIN, lock=True)
    assert rig.written("EV", "ORGN") == [ORIGIN_LOGGED, home_logged(ORIGIN)]
    assert rig.copter.home.take_changed()


def test_home_needs_an_origin(rig: "CopterRig") -> None:
    rig.ahrs.stand_at(PLACE)
    assert not rig.copter.home.set(PLACE, lock=True)
    assert not rig.copter.home.set_here(lock=True)
    assert not rig.copter.has_home()


def test_home_cannot_be_where_nobody_knows_to_be(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = ORIGIN
    assert not rig.copter.home.set_here(lock=True)


@pytest.mark.parametrize(
    "place", [Location(0, 0, 0), Location(900_000_001, 0, 0), Location(0, -1_800_000_001, 5)], ids=str
)
def test_impossible_home_is_refused(rig: "CopterRig", place: Location) -> None:
    settle(rig)
    assert not rig.copter.home.set(place, lock=True)
    assert rig.copter.home.place == PLACE


# The field's elevation


@pytest.mark.parametrize(("alt_cm", "text"), [(58_400, "584"), (-1250, "-13"), (58_451, "585"), (20, "0")])
def test_elevation_is_that_of_the_origin_in_whole_metres(rig: "CopterRig", alt_cm: int, text: str) -> None:
    rig.ahrs.ekf_origin = Location(1, 2, alt_cm)
    rig.run_for(5)
    assert rig.texts == [(6, f"Field Elevation Set: {text}m")]
    assert rig.ahrs.height_resets == 1


def test_elevation_of_0_is_told_every_second(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = Location(1, 2, 0)
    rig.run_for(5)
    assert rig.take_texts() == ["Field Elevation Set: 0m"] * 5


def test_elevation_waits_for_the_vehicle_to_be_disarmed(rig: "CopterRig") -> None:
    rig.params.set("DISARM_DELAY", 0)
    rig.copter.arm(do_checks=False)
    rig.take_texts()
    rig.ahrs.ekf_origin = ORIGIN
    rig.run_for(5)
    assert rig.take_texts() == []
    rig.copter.disarm(force=True)
    rig.run_for(0.1)
    assert rig.take_texts() == ["Disarming motors", "Field Elevation Set: 584m"]


def test_elevation_is_not_told_in_the_first_second_after_boot(rig: "CopterRig") -> None:
    rig.clock.set_us(800_000)
    rig.ahrs.ekf_origin = ORIGIN
    rig.run_for(0.1)
    assert rig.take_texts() == []
    rig.run_for(0.1)
    assert rig.take_texts() == ["Field Elevation Set: 584m"]
