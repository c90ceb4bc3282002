# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the compass sets yaw and magnetic field, and when its three axes are fused."""

import math

import numpy as np
import pytest

from ekf_stub.filter.attitude import quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.fusion.compass_yaw import CompassAlignment, angle_between
from ekf_stub.fusion.height_source import Vehicle

PARKED = Vehicle(armed=False, on_ground=True, in_flight=False)
UNTILTED = Vehicle(armed=False, on_ground=True, in_flight=False, tilt_aligned=False)
ARMED = Vehicle(armed=True, on_ground=False, in_flight=False)
FLYING = Vehicle(armed=True, on_ground=False, in_flight=True)


class Rig:
    """An alignment and the state that it looks at."""

    def __init__(self) -> None:
        self.state = ErrorState(quat_of_euler(0, 0, 0), np.ones(6))
        self.alignment = CompassAlignment(self.state)

    def due(
        self, vehicle: Vehicle = PARKED, *, innovation: float = 0.0, climbed_m: float = 0.0, aligned: bool = False
    ) -> str | None:
        return self.alignment.due(vehicle, innovation, climbed_m, aligned=aligned)

    def climb(self, down: float) -> None:
        self.state.pos = np.array([0.0, 0.0, down])


@pytest.fixture
def rig() -> Rig:
    return Rig()


def airborne(rig: Rig, *, innovation: float = 0.0) -> None:
    """Take off with a field that was set on the ground."""
    rig.alignment.note_yaw(PARKED)
    rig.alignment.note_field(PARKED, innovation)
    rig.alignment.update(PARKED, innovation)


# Which is due


@pytest.mark.parametrize(("vehicle", "aligned", "due"), [
    (PARKED, False, "initial"),
    (FLYING, False, "initial"),
    (UNTILTED, False, None),
    (PARKED, True, None),
])  # fmt: skip
def test_first_alignment_takes_tilt(rig: Rig, vehicle: Vehicle, aligned: bool, due: str | None) -> None:
    assert rig.due(vehicle, aligned=aligned) == due


@pytest.mark.parametrize(("turn_deg", "due"), [(9.9, "initial"), (10.1, None)])
def test_fast_turn_is_waited_for(rig: Rig, turn_deg: float, due: str | None) -> None:
    rig.state.quat = quat_of_euler(0, 0, math.radians(turn_deg))
    assert rig.due() == due
    assert rig.due() == "initial"


@pytest.mark.parametrize(("vehicle", "climbed_m", "due"), [
    (FLYING, 2.4, None),
    (FLYING, 2.6, "final"),
    (ARMED, 2.6, "final"),
    (PARKED, 2.6, None),
])  # fmt: skip
def test_last_alignment_is_2_5_m_above_the_ground(
    rig: Rig, vehicle: Vehicle, climbed_m: float, due: str | None
) -> None:
    airborne(rig)
    assert rig.due(vehicle, climbed_m=climbed_m, aligned=True) == due


def test_last_alignment_is_made_once_a_flight(rig: Rig) -> None:
    airborne(rig)
    rig.alignment.note_yaw(FLYING)
    assert rig.due(FLYING, climbed_m=3.0, aligned=True) is None
    rig.alignment.update(PARKED, 0.0)
    assert rig.due(FLYING, climbed_m=3.0, aligned=True) == "final"


@pytest.mark.parametrize(("climb_m", "innovation", "due"), [
    (0.6, 0.3, "interim"),
    (0.4, 0.3, None),
    (0.6, 0.2, None),
    (0.6, -0.3, "interim"),
])  # fmt: skip
def test_yaw_that_goes_wrong_as_the_vehicle_leaves_iron_behind_is_aligned_anew(
    rig: Rig, climb_m: float, innovation: float, due: str | None
) -> None:
    airborne(rig)
    rig.climb(-climb_m)
    assert rig.due(FLYING, innovation=innovation, aligned=True) == due


def test_yaw_that_was_wrong_on_the_ground_already_is_not_an_anomaly(rig: Rig) -> None:
    airborne(rig, innovation=0.2)
    rig.climb(-0.6)
    assert rig.due(FLYING, innovation=0.4, aligned=True) is None


def test_vehicle_that_has_turned_by_as_much_is_not_an_anomaly(rig: Rig) -> None:
    airborne(rig)
    rig.climb(-0.6)
    for number in range(1, 4):
        rig.state.quat = quat_of_euler(0, 0, 0.15 * number)
        assert rig.due(FLYING, innovation=0.14 * number, aligned=True) is None


def test_anomalies_are_corrected_twice_a_flight(rig: Rig) -> None:
    airborne(rig)
    rig.climb(-0.6)
    for _ in range(2):
        assert rig.due(FLYING, innovation=0.3, aligned=True) == "interim"
        rig.alignment.note_anomaly()
    assert rig.due(FLYING, innovation=0.3, aligned=True) is None


def test_alignment_may_be_asked_for(rig: Rig) -> None:
    airborne(rig)
    rig.alignment.is_requested = True
    assert rig.due(aligned=True) == "requested"
    rig.alignment.note_yaw(PARKED)
    assert rig.due(aligned=True) is None


# Whether the field is estimated


@pytest.mark.parametrize(("magcal", "vehicle", "wanted"), [
    (0, FLYING, True),
    (0, ARMED, False),
    (2, FLYING, False),
    (3, FLYING, False),
    (4, FLYING, True),
    (4, PARKED, True),
    (0, PARKED, False),
    (5, FLYING, False),
])  # fmt: skip
def test_parameter_says_when_the_field_is_estimated(rig: Rig, magcal: int, vehicle: Vehicle, wanted: bool) -> None:
    assert rig.alignment.wants_field(magcal, vehicle) is wanted


def test_field_is_estimated_after_the_last_alignment_by_default(rig: Rig) -> None:
    airborne(rig)
    rig.alignment.note_yaw(FLYING)
    assert not rig.alignment.wants_field(3, FLYING)
    rig.alignment.note_field(FLYING, 0.0)
    assert rig.alignment.wants_field(3, FLYING)
    rig.alignment.update(PARKED, 0.0)
    assert not rig.alignment.wants_field(3, PARKED)


@pytest.mark.parametrize(("accel", "wanted"), [(0.4, False), (0.6, True)])
def test_field_may_be_estimated_while_manoeuvring(rig: Rig, accel: float, wanted: bool) -> None:
    rig.state.accel_filtered = np.array([0.0, accel, 5.0])
    assert rig.alignment.wants_field(1, FLYING) is wanted


@pytest.mark.parametrize(("field_on_ground", "vehicle", "asked"), [
    (False, PARKED, True),
    (True, PARKED, False),
    (True, FLYING, True),
])  # fmt: skip
def test_field_that_begins_to_be_estimated_is_set_first(
    rig: Rig, field_on_ground: bool, vehicle: Vehicle, asked: bool
) -> None:
    if field_on_ground:
        airborne(rig)
    rig.alignment.request_for_field(vehicle)
    assert rig.alignment.is_requested is asked


@pytest.mark.parametrize("turn", [0.0, 0.3, -2.0, 3.1])
def test_angle_between_attitudes_is_the_shorter_way_round(turn: float) -> None:
    first, second = quat_of_euler(0.1, -0.2, 0.3), quat_of_euler(0.1, -0.2, 0.3 + turn)
    assert angle_between(first, second) == pytest.approx(abs(turn), abs=1e-7)
    assert angle_between(first, -second) == pytest.approx(abs(turn), abs=1e-7)
