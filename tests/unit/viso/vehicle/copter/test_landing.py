# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Take-off, landing, and disarming on the ground by itself."""

from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from viso.vehicle.copter.modes import MODES, ModeNumber

if TYPE_CHECKING:
    from tests.unit.viso.conftest import CopterRig

PLACE = Location(-353_632_610, 1_491_652_300, 58_400)
M = ModeNumber


def arm_in(rig: "CopterRig", mode: ModeNumber) -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.ahrs.stand_at(PLACE)
    rig.run_for(0.1)
    rig.copter.set_mode(mode)
    assert rig.copter.arm(do_checks=False)
    rig.take_texts()
    rig.records.clear()


def spin(rig: "CopterRig", mode: ModeNumber) -> None:
    """Arm, and wait until the motors may turn."""
    arm_in(rig, mode)
    rig.run_for(2.1)
    assert rig.written("EV") == [("EV", (57,))]


def fly(rig: "CopterRig", mode: ModeNumber = M.GUIDED, height_m: float = 5.0) -> None:
    spin(rig, mode)
    assert rig.copter.take_off(500, must_navigate=True)
    rig.run_for(1.5)
    rig.ahrs.stand_at(Location(PLACE.lat, PLACE.lng, PLACE.alt_cm + round(height_m * 100)), -height_m)


# Disarming after a delay


@pytest.mark.parametrize("mode", [M.STABILIZE, M.GUIDED, M.LOITER, M.ALT_HOLD])
def test_vehicle_that_stays_on_the_ground_disarms_after_10_s(rig: "CopterRig", mode: ModeNumber) -> None:
    arm_in(rig, mode)
    rig.run_for(9.9)
    assert rig.copter.is_armed()
    rig.run_for(0.2)
    assert not rig.copter.is_armed()
    assert rig.take_texts() == ["Disarming motors"]
    assert rig.written("ARM", "EV") == [("EV", (57,)), ("ARM", (0, 0, 0, 17)), ("EV", (11,)), ("EV", (56,))]


@pytest.mark.parametrize(("delay_s", "armed_after_60_s"), [(0, True), (5, False), (59, False), (61, True)])
def test_delay_is_a_parameter_and_0_is_never(rig: "CopterRig", delay_s: int, armed_after_60_s: bool) -> None:
    rig.params.set("DISARM_DELAY", delay_s)
    arm_in(rig, M.STABILIZE)
    rig.run_for(60)
    assert rig.copter.is_armed() is armed_after_60_s


def test_throw_waits_to_be_thrown(rig: "CopterRig") -> None:
    arm_in(rig, M.THROW)
    rig.run_for(60)
    assert rig.copter.is_armed()


def test_delay_starts_over_with_every_arming(rig: "CopterRig") -> None:
    arm_in(rig, M.STABILIZE)
    rig.run_for(9)
    rig.copter.disarm(force=False)
    rig.run_for(0.1)
    rig.copter.arm(do_checks=False)
    rig.run_for(9)
    assert rig.copter.is_armed()


# Take-off


@pytest.mark.parametrize(("mode", "must_navigate", "accepted"), [
    (M.GUIDED, True, True), (M.LOITER, True, True), (M.POSHOLD, True, True), (M.GUIDED_NOGPS, True, True),
    (M.ALT_HOLD, True, False), (M.ALT_HOLD, False, True), (M.STABILIZE, False, False), (M.DRIFT, False, False),
])  # fmt: skip
def test_take_off_depends_on_the_mode(rig: "CopterRig", mode: ModeNumber, must_navigate: bool, accepted: bool) -> None:
    arm_in(rig, mode)
    assert rig.copter.take_off(500, must_navigate) is accepted


def test_disarmed_vehicle_does_not_take_off(rig: "CopterRig") -> None:
    rig.copter.set_mode(M.GUIDED)
    assert not rig.copter.take_off(500, must_navigate=True)


@pytest.mark.parametrize(("altitude_cm", "accepted"), [(-100, False), (250, False), (251, True), (float("nan"), True)])
def test_take_off_leads_upwards(rig: "CopterRig", altitude_cm: float, accepted: bool) -> None:
    arm_in(rig, M.GUIDED)
    rig.ahrs.stand_at(Location(PLACE.lat, PLACE.lng, PLACE.alt_cm + 250), -9.0)
    assert rig.copter.take_off(altitude_cm, must_navigate=True) is accepted


@pytest.mark.parametrize(("down_m", "accepted"), [(-2.5, False), (-2.4, True), (1.0, True)])
def test_without_home_height_counts_from_the_origin(rig: "CopterRig", down_m: float, accepted: bool) -> None:
    rig.ahrs.stand_at(PLACE, down_m)
    rig.copter.set_mode(M.GUIDED)
    rig.copter.arm(do_checks=False)
    assert rig.copter.take_off(250, must_navigate=True) is accepted


def test_height_is_0_while_there_is_none(rig: "CopterRig") -> None:
    rig.copter.set_mode(M.GUIDED)
    rig.copter.arm(do_checks=False)
    assert not rig.copter.take_off(0, must_navigate=True)
    assert rig.copter.take_off(1, must_navigate=True)


def test_vehicle_flies_when_its_motors_have_spooled_up(rig: "CopterRig") -> None:
    spin(rig, M.GUIDED)
    rig.copter.take_off(500, must_navigate=True)
    rig.run_for(1.1)
    assert rig.copter.is_landed()
    rig.run_for(0.2)
    assert not rig.copter.is_landed()
    assert rig.written("EV") == [("EV", (15,)), ("EV", (28,))]


def test_motors_that_idle_lift_it_sooner(rig: "CopterRig") -> None:
    spin(rig, M.GUIDED)
    rig.run_for(1.0)
    rig.copter.take_off(500, must_navigate=True)
    rig.run_for(0.9)
    assert rig.copter.is_landed()
    rig.run_for(0.1)
    assert not rig.copter.is_landed()


def test_take_off_waits_for_the_arming_delay(rig: "CopterRig") -> None:
    arm_in(rig, M.GUIDED)
    rig.copter.take_off(500, must_navigate=True)
    rig.run_for(3.2)
    assert rig.copter.is_landed()
    rig.run_for(0.2)
    assert rig.written("EV") == [("EV", (15,)), ("EV", (57,)), ("EV", (28,))]


def test_take_off_ends_on_the_ground_with_another_mode(rig: "CopterRig") -> None:
    spin(rig, M.GUIDED)
    rig.copter.take_off(500, must_navigate=True)
    rig.run_for(1.0)
    rig.copter.set_mode(M.LOITER)
    rig.run_for(2.0)
    assert rig.copter.is_landed()


def test_take_off_that_is_asked_for_twice_happens_once(rig: "CopterRig") -> None:
    spin(rig, M.GUIDED)
    assert rig.copter.take_off(500, must_navigate=True)
    rig.run_for(1)
    assert rig.copter.take_off(500, must_navigate=True)
    rig.run_for(0.3)
    assert rig.written("EV") == [("EV", (15,)), ("EV", (28,))]


def test_flying_vehicle_does_not_take_off_again(rig: "CopterRig") -> None:
    fly(rig)
    assert not rig.copter.take_off(5000, must_navigate=True)


def test_flying_vehicle_does_not_disarm_by_itself(rig: "CopterRig") -> None:
    fly(rig)
    rig.run_for(60)
    assert rig.copter.is_armed()


def test_flying_vehicle_is_disarmed_by_force_only(rig: "CopterRig") -> None:
    fly(rig)
    rig.written()
    assert not rig.copter.disarm(force=False)
    assert rig.copter.is_armed()
    assert rig.copter.disarm(force=True)
    assert rig.copter.is_landed()
    assert rig.written("ARM", "EV") == [
        ("ARM", (0, 0, 1, 1)),
        ("EV", (11,)),
        ("EV", (18,)),
        ("EV", (17,)),
    ]
    rig.run_for(0.1)
    assert rig.written("EV") == [("EV", (56,))]


def test_take_off_that_was_broken_off_does_not_happen_later(rig: "CopterRig") -> None:
    arm_in(rig, M.GUIDED)
    rig.copter.take_off(500, must_navigate=True)
    rig.copter.disarm(force=False)
    rig.copter.arm(do_checks=False)
    rig.run_for(3)
    assert rig.copter.is_landed()


# Landing


@pytest.mark.parametrize("mode", [M.LAND, M.RTL, M.SMART_RTL])
def test_vehicle_that_comes_down_lands_and_disarms(rig: "CopterRig", mode: ModeNumber) -> None:
    fly(rig)
    assert rig.copter.set_mode(mode)
    rig.run_for(3)
    assert not rig.copter.is_landed()
    rig.written()
    rig.take_texts()
    rig.ahrs.stand_at(PLACE, -0.2)
    rig.run_for(0.5)
    assert rig.written("ARM", "EV") == [("EV", (18,)), ("EV", (17,))]
    rig.run_for(0.3)  # the motors have spooled down
    assert rig.written("ARM", "EV") == [("ARM", (0, 0, 0, 13)), ("EV", (11,)), ("EV", (56,))]
    assert rig.take_texts() == ["Disarming motors"]


def test_vehicle_that_is_low_goes_on_flying_in_a_mode_that_does_not_land(rig: "CopterRig") -> None:
    fly(rig, height_m=0.0)
    rig.run_for(3)
    assert not rig.copter.is_landed()


def test_vehicle_of_unknown_height_lands_at_once(rig: "CopterRig") -> None:
    fly(rig)
    rig.ahrs.pos = None
    rig.copter.set_mode(M.LAND)
    rig.run_for(0.7)
    assert not rig.copter.is_armed()


@pytest.mark.parametrize("mode", [mode.number for mode in MODES.values() if mode.lands and mode.number != M.SMART_RTL])
def test_landing_on_the_ground_disarms(rig: "CopterRig", mode: ModeNumber) -> None:
    arm_in(rig, M.STABILIZE)
    rig.copter.set_mode(mode)
    rig.run_for(1.9)
    assert rig.copter.is_armed()
    rig.run_for(0.2)
    assert not rig.copter.is_armed()


def test_heights_of_landing_count_from_the_place_of_arming(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.ahrs.stand_at(PLACE, -20.0)
    rig.copter.set_mode(M.GUIDED)
    rig.copter.arm(do_checks=False)
    assert rig.copter.take_off(2500, must_navigate=True)
    rig.run_for(4)
    rig.copter.set_mode(M.LAND)
    rig.ahrs.stand_at(PLACE, -20.4)
    rig.run_for(1)
    assert rig.copter.is_armed()
    rig.ahrs.stand_at(PLACE, -20.2)
    rig.run_for(0.7)
    assert not rig.copter.is_armed()


# While heights may count from the ground


def stable(rig: "CopterRig") -> bool:
    rig.copter.expect_ground()
    return rig.ahrs.terrain_is_stable


def test_ground_counts_during_takeoff_and_landing(rig: "CopterRig") -> None:
    spin(rig, M.GUIDED)
    assert not stable(rig)
    assert rig.copter.take_off(500, must_navigate=True)
    assert stable(rig)
    rig.run_for(1.5)
    rig.ahrs.stand_at(Location(PLACE.lat, PLACE.lng, PLACE.alt_cm + 480), -4.8)
    rig.run_for(0.1)
    assert stable(rig)
    rig.ahrs.stand_at(Location(PLACE.lat, PLACE.lng, PLACE.alt_cm + 495), -4.95)
    rig.run_for(0.1)
    assert not stable(rig)
    rig.copter.set_mode(M.LAND)
    assert stable(rig)


def test_takeoff_ends_with_its_mode(rig: "CopterRig") -> None:
    fly(rig, height_m=2.0)
    assert stable(rig)
    rig.copter.set_mode(M.LOITER)
    assert not stable(rig)


def test_ground_does_not_count_without_a_position(rig: "CopterRig") -> None:
    fly(rig, height_m=2.0)
    rig.ahrs.navigate()
    assert not stable(rig)


# While the air under rotors may mislead the barometer


def expected(rig: "CopterRig") -> tuple[bool, bool]:
    rig.copter.expect_ground()
    return rig.copter.landing.expected


def test_take_off_is_expected_from_arming_until_the_vehicle_has_climbed(rig: "CopterRig") -> None:
    assert expected(rig) == (False, False)
    arm_in(rig, M.GUIDED)
    assert expected(rig) == (True, False)
    rig.run_for(9)
    assert expected(rig) == (True, False)
    assert rig.copter.take_off(500, must_navigate=True)
    rig.run_for(1.5)
    rig.ahrs.stand_at(PLACE, -0.4)
    assert expected(rig) == (True, False)
    rig.ahrs.stand_at(PLACE, -0.6)
    assert expected(rig) == (False, False)
    rig.ahrs.stand_at(PLACE, -0.1)
    assert expected(rig) == (False, False)
    rig.copter.disarm(force=True)
    assert rig.copter.arm(do_checks=False)
    assert expected(rig) == (True, False)


def test_take_off_is_expected_for_5_s_in_the_air_and_never_of_a_throw(rig: "CopterRig") -> None:
    fly(rig, height_m=0.2)
    assert expected(rig) == (True, False)
    rig.run_for(4.6)
    assert expected(rig) == (True, False)
    rig.run_for(0.4)
    assert expected(rig) == (False, False)
    rig.copter.disarm(force=True)
    arm_in(rig, M.THROW)
    assert expected(rig) == (False, False)


@pytest.mark.parametrize(
    ("mode", "velocity", "is_expected"),
    [
        (M.LAND, (0.0, 0.0, 0.5), True),
        (M.LAND, (0.0, 1.2, -0.5), True),
        (M.LAND, (1.0, 1.0, 0.5), False),
        (M.LAND, (0.0, 0.0, 0.7), False),
        (M.LAND, None, False),
        (M.GUIDED, (0.0, 0.0, 0.5), False),
    ],
)
def test_touchdown_is_expected_of_a_mode_that_lands_slowly(
    rig: "CopterRig", mode: ModeNumber, velocity: tuple[float, float, float] | None, is_expected: bool
) -> None:
    fly(rig)
    rig.copter.set_mode(mode)
    rig.ahrs.velocity = None if velocity is None else Vector3f(*velocity)
    assert expected(rig) == (False, is_expected)
