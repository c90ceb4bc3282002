# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Three axes of a compass: what they are compared with, what passes, and what they correct."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
import quaternion

from ekf_stub.filter.attitude import euler_of, quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array, InertialStep
from ekf_stub.filter.states import ATT, BODY, EARTH
from ekf_stub.fusion.mag_fusion import MagFusion
from ekf_stub.fusion.measurements import MagSample

PARAMS = {"MAG_M_NSE": 0.05, "MAG_I_GATE": 300.0, "MAG_EF_LIM": 50.0}
NOISE_VAR = 0.0025
GATE = 9.0
FIELD_NED = np.array([0.238, 0.0, -0.529])
STEP = InertialStep(0, np.zeros(3), np.zeros(3), 0.0125, 0.0125)
TURNING = InertialStep(0, np.zeros(3), np.array([0.0, 0.0, 0.0125 * 10]), 0.0125, 0.0125)


class Rig:
    """A fusion with its state, and a true attitude and bias that a compass feels."""

    def __init__(self, **params: float) -> None:
        self.state = ErrorState(quat_of_euler(0, 0, 0), np.ones(6))
        self.fusion = MagFusion(self.state, {**PARAMS, **params}.__getitem__)

    def turn_to(self, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> None:
        self.state.quat = quat_of_euler(roll, pitch, yaw)
        self.state.rotation = self.state.rotation_now()

    def feel(self, quat: quaternion.quaternion, bias: Array | None = None) -> MagSample:
        """Return what a compass on a vehicle of that attitude and iron feels."""
        felt = (quat.conjugate() * quaternion.quaternion(0.0, *FIELD_NED) * quat).vec
        return MagSample(0, felt if bias is None else felt + bias)

    def begin(self) -> None:
        """Set the field from the present attitude and begin to estimate it."""
        self.fusion.reset(self.feel(self.state.quat))
        assert self.fusion.learn(wanted=True)
        self.fusion.begin_step()


@pytest.fixture
def rig() -> Rig:
    return Rig()


def variances(rig: Rig, states: slice) -> list[float]:
    found: list[float] = rig.state.cov.diagonal()[states].tolist()
    return found


# Beginning and ending


def test_estimation_begins_once(rig: Rig) -> None:
    assert not rig.fusion.learn(wanted=False)
    assert rig.fusion.learn(wanted=True)
    assert not rig.fusion.learn(wanted=True)
    assert rig.state.learns_field
    assert not rig.fusion.learn(wanted=False)
    assert not rig.state.learns_field


def test_fields_begin_as_uncertain_as_the_compass(rig: Rig) -> None:
    rig.begin()
    assert variances(rig, BODY) == pytest.approx([NOISE_VAR] * 3)
    assert variances(rig, slice(EARTH.start + 2, EARTH.stop)) == pytest.approx([NOISE_VAR])


def test_declination_is_known_from_the_start(rig: Rig) -> None:
    """The direction of the level field has an error of 20 degrees, its length that of the compass."""
    rig.begin()
    along, across = variances(rig, slice(EARTH.start, EARTH.start + 2))
    assert along == pytest.approx(NOISE_VAR)
    by_angle = (math.radians(20) * FIELD_NED[0]) ** 2
    assert across == pytest.approx(NOISE_VAR * by_angle / (NOISE_VAR + by_angle), rel=1e-3)


def test_first_variances_are_given_once(rig: Rig) -> None:
    rig.begin()
    before = rig.state.cov.copy()
    rig.fusion.begin_step()
    assert np.array_equal(rig.state.cov, before)


# Setting the field


def test_field_is_set_as_felt_and_turned_to_the_declination(rig: Rig) -> None:
    rig.turn_to(0.1, -0.2, 1.0)
    rig.fusion.declination = 0.2
    rig.fusion.reset(rig.feel(quat_of_euler(0.1, -0.2, 1.0)))
    expected = [0.238 * math.cos(0.2), 0.238 * math.sin(0.2), -0.529]
    assert rig.state.earth_field == pytest.approx(expected, abs=1e-9)


def test_field_that_was_learned_is_not_turned(rig: Rig) -> None:
    rig.fusion.is_learned = True
    rig.fusion.declination = 0.2
    rig.fusion.reset(rig.feel(rig.state.quat))
    assert rig.state.earth_field == pytest.approx(FIELD_NED)


# What passes


def test_field_that_fits_leaves_no_innovation(rig: Rig) -> None:
    rig.turn_to(0.3, -0.2, 0.8)
    rig.begin()
    assert rig.fusion.fuse(rig.feel(rig.state.quat), STEP)
    assert rig.fusion.innovation == pytest.approx([0, 0, 0], abs=1e-9)
    assert rig.fusion.ratios == pytest.approx([0, 0, 0], abs=1e-9)


def test_innovation_is_prediction_less_measurement_along_each_axis_of_the_body(rig: Rig) -> None:
    rig.begin()
    rig.state.clear(ATT, 1e-12)
    rig.fusion.fuse(rig.feel(rig.state.quat, np.array([0.01, -0.02, 0.03])), STEP)
    assert rig.fusion.innovation == pytest.approx([-0.01, 0.02, -0.03])
    spread = NOISE_VAR + NOISE_VAR + NOISE_VAR  # of the earth's field down, of the vehicle's, and of the compass
    assert rig.fusion.ratios[2] == pytest.approx(0.03**2 / (GATE * spread), rel=1e-3)


def test_iron_of_the_vehicle_is_expected(rig: Rig) -> None:
    rig.begin()
    rig.state.body_field = np.array([0.01, -0.02, 0.03])
    rig.fusion.fuse(rig.feel(rig.state.quat, np.array([0.01, -0.02, 0.03])), STEP)
    assert rig.fusion.innovation == pytest.approx([0, 0, 0], abs=1e-9)


def test_compass_is_believed_less_as_the_vehicle_turns() -> None:
    still, turning = Rig(), Rig()
    for rig, step in ((still, STEP), (turning, TURNING)):
        rig.begin()
        rig.state.clear(ATT, 1e-12)
        rig.fusion.fuse(rig.feel(rig.state.quat, np.array([0.0, 0.0, 0.03])), step)
    more = (0.005 * 10) ** 2
    assert still.fusion.ratios[2] / turning.fusion.ratios[2] == pytest.approx(1 + more / (3 * NOISE_VAR), rel=1e-3)


@pytest.mark.parametrize(("noise", "used"), [(1e-3, 0.01), (5.0, 0.5)])
def test_noise_of_the_compass_has_limits(noise: float, used: float) -> None:
    rig = Rig(MAG_M_NSE=noise)
    rig.begin()
    rig.state.clear(slice(EARTH.start, BODY.stop), 0.0)
    rig.state.clear(ATT, 1e-12)
    rig.fusion.fuse(rig.feel(rig.state.quat, np.array([0.0, 0.0, 0.001])), STEP)
    assert rig.fusion.ratios[2] == pytest.approx(1e-6 / (GATE * used**2), rel=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_one_axis_beyond_its_gate_rejects_all(rig: Rig, axis: int) -> None:
    rig.begin()
    quat, field = rig.state.quat, rig.state.earth_field.copy()
    assert not rig.fusion.fuse(rig.feel(quat, 0.5 * np.eye(3)[axis] + 0.01), STEP)
    assert [ratio >= 1 for ratio in rig.fusion.ratios] == [index == axis for index in range(3)]
    assert rig.state.quat == quat
    assert rig.state.earth_field == pytest.approx(field, abs=1e-6)


# What is corrected


@pytest.mark.parametrize("true", [(0.0, 0.0, 0.05), (0.05, 0.0, 0.0), (0.0, -0.05, 0.0), (0.03, 0.02, -0.04)])
@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), (0.4, -0.3, 2.0)])
def test_attitude_is_corrected_in_the_right_direction(
    at: tuple[float, float, float], true: tuple[float, float, float]
) -> None:
    """With known fields: whatever of an error in attitude a compass can feel is gone after a few readings."""
    rig = Rig(MAG_M_NSE=0.01)
    rig.turn_to(*at)
    rig.begin()
    rig.state.clear(slice(EARTH.start, BODY.stop), 0.0)
    sample = rig.feel(quat_of_euler(*at) * quat_of_euler(*true))
    before = np.linalg.norm(rig.state.earth_field @ rig.state.rotation_now() - sample.field)
    for _ in range(10):
        rig.state.clear(ATT, 2.5e-3)
        assert rig.fusion.fuse(sample, STEP)
    assert np.linalg.norm(rig.state.earth_field @ rig.state.rotation_now() - sample.field) < 0.02 * before


def test_iron_is_told_from_the_earth_as_the_vehicle_turns(rig: Rig) -> None:
    bias = np.array([0.02, -0.03, 0.04])
    rig.begin()
    rig.state.clear(ATT, 1e-12)

    def attitudes() -> Iterator[tuple[float, float, float]]:
        for number in range(200):
            yield 0.5 * math.sin(number), 0.5 * math.cos(1.3 * number), 0.7 * number

    for attitude in attitudes():
        rig.turn_to(*attitude)
        rig.state.clear(ATT, 1e-12)
        assert rig.fusion.fuse(rig.feel(quat_of_euler(*attitude), bias), STEP)
    assert rig.state.body_field == pytest.approx(bias, abs=2e-3)
    assert rig.state.earth_field == pytest.approx(FIELD_NED, abs=2e-3)


def test_all_axes_are_of_the_attitude_before_the_first_of_them(rig: Rig) -> None:
    rig.begin()
    sample = rig.feel(quat_of_euler(0, 0, 0.1))
    rig.fusion.fuse(sample, STEP)
    assert euler_of(rig.state.quat)[2] > 0
    assert rig.fusion.innovation == pytest.approx(FIELD_NED - sample.field)


def test_earth_field_stays_near_what_it_was_set_to(rig: Rig) -> None:
    rig.begin()
    rig.state.clear(ATT, 1e-12)
    rig.state.clear(BODY, 0.0)
    for _ in range(20):
        rig.state.clear(EARTH, 0.01)
        rig.fusion.fuse(MagSample(0, FIELD_NED * 1.2), STEP)
    assert rig.state.earth_field - FIELD_NED == pytest.approx([0.0476, 0, -0.05], abs=1e-3)


def test_limit_of_the_earth_field_may_be_switched_off() -> None:
    rig = Rig(MAG_EF_LIM=0)
    rig.begin()
    rig.state.clear(ATT, 1e-12)
    rig.state.clear(BODY, 0.0)
    for _ in range(20):
        rig.state.clear(EARTH, 0.01)
        rig.fusion.fuse(MagSample(0, FIELD_NED * 1.2), STEP)
    assert rig.state.earth_field[2] == pytest.approx(1.2 * FIELD_NED[2], abs=1e-3)


def test_field_of_a_table_is_the_one_that_is_reset_to_and_limited_around(rig: Rig) -> None:
    rig.begin()
    table = np.array([0.232, 0.0, -0.528])
    rig.fusion.use_table(table)
    rig.fusion.use_table(2 * table)  # only once
    assert rig.state.earth_field.tolist() == table.tolist()
    rig.state.earth_field = np.zeros(3)
    rig.fusion.reset(MagSample(0, 1.3 * FIELD_NED))
    assert rig.state.earth_field == pytest.approx(table)


@pytest.mark.parametrize(("limit", "knows_north", "turns"), [(0, True, True), (0, False, False), (50, True, False)])
def test_declination_keeps_the_field_from_turning_unless_positions_tell_north(
    limit: float, knows_north: bool, turns: bool
) -> None:
    rig = Rig(MAG_EF_LIM=limit)
    rig.begin()
    rig.state.clear(ATT, 1e-12)
    rig.state.clear(BODY, 0.0)
    rig.state.clear(EARTH, 0.01)
    east = quat_of_euler(0.0, 0.0, -0.05)
    for _ in range(5):
        rig.fusion.fuse(rig.feel(east), STEP, knows_north=knows_north)
    assert bool(abs(rig.state.earth_field[1]) > 0.01) is turns


# Learning


def test_field_that_was_learned_is_kept_while_it_is_not_estimated(rig: Rig) -> None:
    rig.begin()
    rig.state.clear(ATT, 1e-12)
    rig.state.clear(slice(EARTH.start, BODY.stop), 1e-5)
    rig.fusion.fuse(rig.feel(rig.state.quat), STEP)
    rig.fusion.note_learned(is_set_in_flight=True)
    assert rig.fusion.is_learned
    learned = variances(rig, slice(EARTH.start, BODY.stop))
    rig.fusion.learn(wanted=False)
    rig.state.clear(slice(EARTH.start, BODY.stop), 0.0)
    rig.fusion.learn(wanted=True)
    assert variances(rig, slice(EARTH.start, BODY.stop)) == pytest.approx(learned)


def test_uncertain_field_is_not_learned(rig: Rig) -> None:
    rig.begin()
    rig.fusion.fuse(rig.feel(rig.state.quat), STEP)
    rig.fusion.note_learned(is_set_in_flight=True)
    assert not rig.fusion.is_learned
