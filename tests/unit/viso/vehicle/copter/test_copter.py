# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What arming and disarming bring with them."""

from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from viso.vehicle.copter.modes import ModeNumber

if TYPE_CHECKING:
    from tests.unit.viso.conftest import CopterRig

PLACE = Location(-353_632_610, 1_491_652_300, 58_400)


@pytest.mark.parametrize("do_checks", [False, True])
def test_records_of_arming_come_in_the_firmware_s_order(rig: "CopterRig", do_checks: bool) -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.ahrs.stand_at(PLACE)
    rig.run_for(0.1)
    rig.copter.set_mode(ModeNumber.GUIDED)
    rig.written()
    assert rig.copter.arm(do_checks)
    place = (PLACE.lat, PLACE.lng, PLACE.alt_cm)
    assert rig.written("ARM", "EV", "ORGN", "MODE") == [
        ("ARM", (1, 1, int(not do_checks), 1)),
        ("EV", (10,)),
        ("ORGN", (0, *place)),
        ("ORGN", (1, *place)),
        ("MODE", (4, 4, 2)),
    ]


@pytest.mark.parametrize("do_checks", [False, True])
def test_log_is_open_when_arming_is_logged(rig: "CopterRig", do_checks: bool) -> None:
    size_before = rig.logger.size
    rig.copter.arm(do_checks)
    assert rig.logger.is_open
    assert rig.logger.size > size_before


def test_failed_attempt_changes_nothing_but_the_time_of_the_last_one(rig: "CopterRig") -> None:
    rig.visual_odom.failure = "not healthy"
    assert rig.copter.disarmed_us is None
    assert not rig.copter.arm(do_checks=True)
    assert rig.copter.disarmed_us == 10_000_000
    assert rig.written("ARM", "EV", "MODE") == []
    assert rig.ahrs.height_resets == 0


def test_time_of_disarming_is_kept(rig: "CopterRig") -> None:
    rig.copter.arm(do_checks=True)
    rig.run_for(2)
    assert rig.copter.disarm(force=False)
    assert rig.copter.disarmed_us == 12_000_000


def test_disarming_the_disarmed_changes_nothing(rig: "CopterRig") -> None:
    assert not rig.copter.disarm(force=True)
    assert rig.copter.disarmed_us is None


def test_refused_mode_is_no_change(rig: "CopterRig") -> None:
    assert not rig.copter.set_mode(99)
    assert rig.copter.take_changed() == []


@pytest.mark.parametrize(("initial", "mode"), [(0, 0), (4, 4), (5, 5), (99, 0), (-1, 0), (22, 0)])
def test_vehicle_boots_into_its_initial_mode_if_it_can(rig: "CopterRig", initial: int, mode: int) -> None:
    rig.params.set("INITIAL_MODE", initial)
    rig.copter.enter_initial_mode()
    assert (rig.copter.modes.current.number, rig.copter.modes.reason) == (mode, 26)


def test_safety_switch_can_be_moved_back(rig: "CopterRig") -> None:
    rig.copter.safety_on = True
    assert not rig.copter.arm(do_checks=True)
    rig.copter.safety_on = False
    assert rig.copter.arm(do_checks=True)
