# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which velocities, positions and heights are fused, through which gates, and with which weight."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.states import ACCEL, POS, VEL
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.fusion.height_source import BARO, EXT_NAV, Vehicle
from ekf_stub.fusion.measurements import BaroSample
from ekf_stub.inputs.gps_reading import GpsFix
from ekf_stub.inputs.gps_sample import GpsSample

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

PARKED = Vehicle(armed=False, on_ground=True, in_flight=False)
ARMED = Vehicle(armed=True, on_ground=False, in_flight=False)
ARMED_UNTILTED = Vehicle(armed=True, on_ground=False, in_flight=False, tilt_aligned=False)
TAKING_OFF = Vehicle(armed=True, on_ground=False, in_flight=False, near_ground=True)
FLYING = Vehicle(armed=True, on_ground=False, in_flight=True)
NOW_MS = 50_000
ORIGIN = Location(-353632610, 1491652300, 58400)
POS_VAR, VEL_VAR, VEL_D_VAR, HEIGHT_VAR = 0.25, 0.09, 0.25, 4.0  # as the filter begins
GATE = 25.0


def navigating(make_parts: MakeParts, sources: str = "66666", **params: float) -> "FilterParts":
    """Return parts that navigate by position, and are all up to date."""
    parts = make_parts(sources, **params)
    parts.aiding.mode = AidingMode.ABSOLUTE
    parts.aiding.vel_timeout = False
    times = parts.aiding.times
    times.pos = times.vel = times.height = times.odometry = NOW_MS - 100
    parts.ingest.pose_stamp_ms, parts.ingest.have_pose = NOW_MS, True
    return parts


def standing(make_parts: MakeParts, sources: str = "66166", **params: float) -> "FilterParts":
    """Return parts that do not navigate, whose height is the barometer's."""
    parts = make_parts(sources, **params)
    parts.aiding.times.height = NOW_MS - 100
    return parts


def step(
    parts: "FilterParts",
    *,
    now_ms: int = NOW_MS,
    vehicle: Vehicle = PARKED,
    baro: float | None = None,
    rests: bool = False,
) -> None:
    """Make a step with what was set to have come due, and perhaps a height of the barometer."""
    parts.ingest.horizon_ms = now_ms
    if baro is not None:
        parts.height.baro.push(BaroSample(now_ms, baro))
    parts.fusion.step(now_ms, vehicle, rests=rests)
    parts.end_step()


def variances(parts: "FilterParts") -> Array:
    return parts.state.cov.diagonal().copy()


def weight(variance: float, noise: float) -> float:
    """Return which part of an innovation is believed."""
    return variance / (variance + noise**2)


# Positions


@pytest.mark.parametrize(("err", "noise"), [(0.2, 0.2), (0.0, 0.01), (5.0, 5.0), (1e6, 100.0)])
def test_pose_is_fused_with_its_error_within_limits(make_parts: MakeParts, err: float, noise: float) -> None:
    parts = navigating(make_parts)
    parts.set_pose(0.1, -0.2, 0, err=err)
    step(parts)
    assert parts.state.pos[:2] == pytest.approx(weight(POS_VAR, noise) * np.array([0.1, -0.2]), rel=1e-6)
    assert variances(parts)[POS.start] == pytest.approx(max(POS_VAR - POS_VAR * weight(POS_VAR, noise), 1e-4))


def test_ratio_of_a_position_is_of_its_distance(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_pose(0.3, -0.4, 0, err=0.2)
    step(parts)
    ratio = 0.25 / (GATE * 2 * (POS_VAR + 0.04))
    assert parts.fusion.innovations.pos_ratio == pytest.approx(ratio)
    assert parts.fusion.innovations.pos[:2] == pytest.approx([-0.3, 0.4])
    assert ("pose", "model_fused", pytest.approx(math.sqrt(ratio))) in parts.outcomes
    assert parts.aiding.times.pos == NOW_MS


@pytest.mark.parametrize(("percent", "sigmas"), [(500, 5.0), (300, 3.0), (50, 1.0)])
@pytest.mark.parametrize("passes", [True, False])
def test_gate_of_position_is_as_wide_as_its_parameter_but_not_less_than_a_sigma(
    make_parts: MakeParts, percent: float, sigmas: float, passes: bool
) -> None:
    parts = navigating(make_parts, POS_I_GATE=percent)
    distance = sigmas * math.sqrt(2 * (POS_VAR + 0.04)) * (0.999 if passes else 1.001)
    parts.set_pose(distance, 0, 0, err=0.2)
    step(parts)
    assert bool(parts.state.pos[0] != 0) is passes
    assert parts.aiding.times.pos == (NOW_MS if passes else NOW_MS - 100)
    assert (("pose", "model_gate_position", pytest.approx(1.001)) in parts.outcomes) is not passes


def test_rejected_position_still_shows_its_innovation(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_pose(30, -40, 0)
    step(parts)
    assert parts.fusion.innovations.pos[:2].tolist() == [-30, 40]
    assert parts.fusion.innovations.pos_ratio > 1
    assert parts.state.pos[:2].tolist() == [0, 0]


def test_ratios_and_innovations_persist_until_the_next_test(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_pose(30, -40, 0)
    step(parts)
    before = parts.fusion.innovations.pos_ratio
    step(parts, now_ms=NOW_MS + 12)
    assert parts.fusion.innovations.pos_ratio == before
    assert parts.fusion.innovations.pos[:2].tolist() == [-30, 40]


@pytest.mark.parametrize(("mode", "sources"), [
    (AidingMode.RELATIVE, "66666"),
    (AidingMode.ABSOLUTE, "06666"),
    (AidingMode.ABSOLUTE, "36666"),
])  # fmt: skip
def test_pose_is_used_by_its_source_in_absolute_aiding_only(
    make_parts: MakeParts, mode: AidingMode, sources: str
) -> None:
    parts = navigating(make_parts, sources)
    parts.aiding.mode = mode
    parts.set_pose(0.1, 0.1, 0)
    step(parts)
    assert parts.state.pos[:2].tolist() == [0, 0]
    assert ("pose", "model_unused", None) in parts.outcomes


# Positions that are lost


def test_position_that_is_lost_is_reset_to_while_nothing_holds_velocity(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.aiding.pos_timeout = parts.aiding.vel_timeout = True
    parts.set_pose(30, -40, 0)
    step(parts)
    assert parts.state.pos[:2].tolist() == [30, -40]
    assert variances(parts)[POS.start : POS.start + 2].tolist() == [156.25, 156.25]
    assert parts.resets.moved_ne.tolist() == [30, -40]
    assert (parts.fusion.innovations.pos_ratio, parts.fusion.innovations.vel_ratio) == (0, 0)
    assert (parts.aiding.pos_timeout, parts.aiding.vel_timeout, parts.aiding.times.pos) == (False, False, NOW_MS)
    assert ("pose", "model_reset", None) in parts.outcomes


def test_velocity_is_reset_with_a_lost_position_and_not_fused_as_well(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.aiding.pos_timeout = parts.aiding.vel_timeout = True
    parts.set_pose(30, -40, 0)
    parts.set_velocity(1, 2, 3, err=0.2)
    step(parts)
    assert parts.state.vel.tolist() == [1, 2, 0]
    assert variances(parts)[VEL.start] == pytest.approx(0.04)
    assert parts.aiding.times.vel == NOW_MS


def test_velocity_that_is_not_lost_is_left_alone_by_that(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.aiding.pos_timeout = True
    parts.state.vel = np.array([1.0, 2.0, 3.0])
    parts.set_pose(30, -40, 0)
    step(parts)
    assert parts.state.pos[:2].tolist() == [30, -40]
    assert parts.state.vel.tolist() == [1, 2, 3]


def test_position_that_is_lost_is_fused_without_a_gate_while_velocity_passes(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.aiding.pos_timeout = parts.aiding.vel_aiding = True
    parts.set_pose(30, -40, 0, err=0.2)
    step(parts)
    assert parts.state.pos[:2] == pytest.approx(weight(POS_VAR, 0.2) * np.array([30, -40]))
    assert parts.fusion.innovations.pos_ratio > 1
    assert parts.aiding.pos_timeout
    assert parts.aiding.times.pos == NOW_MS - 100


def test_good_gps_lets_a_lost_position_be_reset_all_the_same(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.aiding.pos_timeout = parts.aiding.vel_aiding = True
    parts.gps.checks.good = True
    parts.set_pose(30, -40, 0)
    step(parts)
    assert parts.state.pos[:2].tolist() == [30, -40]
    assert not parts.aiding.pos_timeout


@pytest.mark.parametrize(("variance", "is_reset"), [(312.0, False), (313.0, True)])
def test_position_that_passes_is_reset_to_when_it_was_uncertain_beyond_the_radius(
    make_parts: MakeParts, variance: float, is_reset: bool
) -> None:
    parts = navigating(make_parts)
    parts.state.clear(slice(POS.start, POS.start + 2), variance)
    parts.set_pose(3, 4, 0)
    step(parts)
    assert (parts.state.pos[:2].tolist() == [3, 4]) is is_reset
    assert (parts.resets.moved_ne.tolist() == [3, 4]) is is_reset


@pytest.mark.parametrize("radius", [0, -1])
def test_without_a_radius_every_position_is_fused_at_full_weight(make_parts: MakeParts, radius: float) -> None:
    parts = navigating(make_parts, GLITCH_RAD=radius)
    parts.state.clear(slice(POS.start, POS.start + 2), 400.0)
    parts.set_pose(3000, 4000, 0, err=0.2)
    step(parts)
    assert parts.state.pos[:2] == pytest.approx(weight(400.0, 0.2) * np.array([3000, 4000]))
    assert parts.fusion.innovations.pos_ratio > 1
    assert parts.aiding.times.pos == NOW_MS
    assert parts.resets.moved_ne.tolist() == [0, 0]


# Jumps of the frame


def test_jump_is_followed_and_the_same_pose_fused(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_pose(0, 0, 0)
    step(parts)
    parts.aiding.times.pos = 0
    parts.set_pose(30, -40, -5, is_reset=True)
    step(parts, now_ms=NOW_MS + 33)
    assert parts.state.pos.tolist() == [30, -40, -5]
    assert parts.resets.moved_ne.tolist() == [30, -40]
    assert parts.fusion.innovations.pos_ratio == 0
    assert parts.aiding.times.pos == NOW_MS + 33


def test_jump_leaves_the_height_of_another_source_alone(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66166")
    parts.set_pose(30, -40, -5, is_reset=True)
    step(parts)
    assert parts.state.pos.tolist() == [30, -40, 0]


def test_jump_does_not_end_a_timeout(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.aiding.pos_timeout = parts.aiding.vel_aiding = True
    parts.set_pose(30, -40, 0, is_reset=True)
    step(parts)
    assert parts.aiding.pos_timeout


def test_other_source_of_position_is_followed_with_its_first_sample(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "36666")
    step(parts)
    parts.params.set("EK3_SRC1_POSXY", 6)
    step(parts, now_ms=NOW_MS + 12)
    parts.set_pose(30, -40, 0)
    step(parts, now_ms=NOW_MS + 25)
    assert parts.state.pos[:2].tolist() == [30, -40]
    parts.set_pose(60, -80, 0)
    step(parts, now_ms=NOW_MS + 37)
    assert parts.state.pos[:2].tolist() == [30, -40]


def test_source_that_was_none_for_a_while_is_followed(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    for source in (0, 6):
        parts.params.set("EK3_SRC1_POSXY", source)
        step(parts)
    parts.set_pose(30, -40, 0)
    step(parts)
    assert parts.state.pos[:2].tolist() == [30, -40]


# Velocities


@pytest.mark.parametrize(("err", "noise"), [(0.1, 0.1), (0.0, 0.05), (10.0, 10.0), (1e4, 50.0)])
def test_velocity_is_fused_with_its_error_within_limits(make_parts: MakeParts, err: float, noise: float) -> None:
    parts = navigating(make_parts, "66106")
    parts.set_velocity(0.1, -0.2, 0.3, err=err)
    step(parts)
    assert parts.state.vel == pytest.approx([0.1 * weight(VEL_VAR, noise), -0.2 * weight(VEL_VAR, noise), 0])
    assert parts.aiding.times.vel == NOW_MS


def test_vertical_velocity_is_fused_with_the_others(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_velocity(0.1, -0.2, 0.3, err=0.1)
    step(parts)
    assert parts.state.vel[2] == pytest.approx(0.3 * weight(VEL_D_VAR, 0.1))
    spread = 2 * VEL_VAR + VEL_D_VAR + 3 * 0.01
    assert parts.fusion.innovations.vel_ratio == pytest.approx(0.14 / (GATE * spread))


def test_vertical_velocity_alone_is_never_fused(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "60666")
    parts.set_velocity(0.1, 0.2, 0.3)
    step(parts)
    assert parts.state.vel.tolist() == [0, 0, 0]
    assert parts.fusion.innovations.vel_ratio == 0
    assert ("velocity", "model_unused", None) in parts.outcomes


def test_velocity_of_any_set_is_fused_if_the_option_says_so(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "60606", SRC2_VELXY=6)
    parts.params.set("EK3_SRC_OPTIONS", 1)
    parts.set_velocity(0.1, 0.2, 0.3)
    step(parts)
    assert parts.state.vel[0] > 0


@pytest.mark.parametrize(("err", "noise"), [(0.1, 0.1), (0.01, 0.05), (40.0, 5.0)])
def test_gate_of_velocity_has_another_upper_limit_of_the_error(make_parts: MakeParts, err: float, noise: float) -> None:
    parts = navigating(make_parts, "66106")
    parts.set_velocity(1, 2, 0, err=err)
    step(parts)
    assert parts.fusion.innovations.vel_ratio == pytest.approx(5 / (GATE * 2 * (VEL_VAR + noise**2)))


def test_gate_of_velocity_opens_with_acceleration(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66106")
    parts.state.accel_filtered = np.array([3.0, 0.0, 4.0])
    parts.set_velocity(1, 2, 0, err=0.1)
    step(parts)
    spread = 2 * (VEL_VAR + 0.01 + (0.05 * 5) ** 2)
    assert parts.fusion.innovations.vel_ratio == pytest.approx(5 / (GATE * spread))


def test_rejected_velocity_freezes_its_innovation(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_velocity(0.1, -0.2, 0.3)
    step(parts)
    before = parts.fusion.innovations.vel.copy()
    assert before == pytest.approx([-0.1, 0.2, -0.3])
    vel = parts.state.vel.copy()
    parts.set_velocity(15, 0, 0)
    step(parts, now_ms=NOW_MS + 33)
    assert parts.fusion.innovations.vel_ratio > 1
    assert np.array_equal(parts.fusion.innovations.vel, before)
    assert np.array_equal(parts.state.vel, vel)
    assert parts.aiding.times.vel == NOW_MS
    assert parts.outcomes[-1][:2] == ("velocity", "model_gate_velocity")


def test_vertical_innovation_stays_0_while_it_is_not_fused(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66106")
    parts.set_velocity(0.1, -0.2, 0.3)
    step(parts)
    assert parts.fusion.innovations.vel == pytest.approx([-0.1, 0.2, 0])


@pytest.mark.parametrize("north", [0.1, 15.0])
def test_velocity_that_is_lost_is_reset_to_whether_it_passes_or_not(make_parts: MakeParts, north: float) -> None:
    parts = navigating(make_parts)
    parts.aiding.vel_timeout = True
    parts.set_velocity(north, 0, 0, err=0.2)
    step(parts)
    assert parts.state.vel.tolist() == [north, 0, 0]
    assert parts.fusion.innovations.vel_ratio == 0
    assert (parts.aiding.vel_timeout, parts.aiding.times.vel) == (False, NOW_MS)
    assert ("velocity", "model_reset", None) in parts.outcomes


def test_velocity_is_fused_without_a_gate_when_there_is_no_radius(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, GLITCH_RAD=0)
    parts.set_velocity(15, 0, 0, err=0.1)
    step(parts)
    assert parts.state.vel[0] == pytest.approx(15 * weight(VEL_VAR, 0.1))


def test_all_gates_are_of_the_covariance_before_the_step(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66106")
    cov = parts.state.cov
    cov[POS.start, VEL.start] = cov[VEL.start, POS.start] = 0.1
    parts.set_velocity(0.3, 0, 0, err=0.1)
    parts.set_pose(0.5, 0, 0, err=0.2)
    step(parts)
    assert parts.fusion.innovations.pos_ratio == pytest.approx(0.25 / (GATE * 2 * (POS_VAR + 0.04)))
    # The velocity, which is first, has moved the position by then.
    assert parts.fusion.innovations.pos[0] == pytest.approx(0.3 * 0.1 / (VEL_VAR + 0.01) - 0.5)


# Without aiding


@pytest.mark.parametrize(("vehicle", "noise"), [(PARKED, 0.5), (ARMED_UNTILTED, 0.5), (ARMED, 10.0)])
def test_standing_vehicle_is_held_where_it_was_with_every_height(
    make_parts: MakeParts, vehicle: Vehicle, noise: float
) -> None:
    parts = standing(make_parts)
    parts.resets.last_known_ne = np.array([0.5, -0.5])
    step(parts, vehicle=vehicle)
    assert parts.state.pos[:2].tolist() == [0, 0]
    step(parts, now_ms=NOW_MS + 12, vehicle=vehicle, baro=0.0)
    assert parts.state.pos[:2] == pytest.approx(weight(POS_VAR, noise) * np.array([0.5, -0.5]))
    assert parts.aiding.times.pos == NOW_MS + 12


@pytest.mark.parametrize(("given", "noise"), [(0.1, 0.5), (20.0, 20.0), (100.0, 50.0)])
def test_noise_of_the_assumed_position_has_limits(make_parts: MakeParts, given: float, noise: float) -> None:
    parts = standing(make_parts, NOAID_M_NSE=given)
    parts.resets.last_known_ne = np.array([0.5, -0.5])
    step(parts, vehicle=ARMED, baro=0.0)
    assert parts.state.pos[0] == pytest.approx(0.5 * weight(POS_VAR, noise))


def test_assumed_position_passes_any_gate(make_parts: MakeParts) -> None:
    parts = standing(make_parts)
    parts.resets.last_known_ne = np.array([1000.0, 0.0])
    step(parts, baro=0.0)
    assert parts.state.pos[0] == pytest.approx(1000 * weight(POS_VAR, 0.5))
    assert parts.fusion.innovations.pos_ratio > 1


def test_velocity_is_fused_between_heights_but_not_with_them(make_parts: MakeParts) -> None:
    parts = standing(make_parts)
    parts.set_velocity(0.4, 0, 0, err=0.1)
    step(parts, baro=0.0)
    assert parts.state.vel[0] == 0
    assert ("velocity", "model_unused", None) in parts.outcomes
    parts.set_velocity(0.4, 0, 0, err=0.1)
    step(parts, now_ms=NOW_MS + 12)
    assert parts.state.vel[0] == pytest.approx(0.4 * weight(VEL_VAR, 0.5))
    spread = 2 * VEL_VAR + VEL_D_VAR + 3 * 0.25
    assert parts.fusion.innovations.vel_ratio == pytest.approx(0.16 / (GATE * spread))


def test_lost_velocity_is_fused_through_no_gate_without_aiding(make_parts: MakeParts) -> None:
    parts = standing(make_parts)
    parts.set_velocity(40, 0, 0)
    step(parts)
    assert parts.aiding.vel_timeout
    assert parts.state.vel[0] == pytest.approx(40 * weight(VEL_VAR, 0.5))


# At rest


@pytest.mark.parametrize(("given", "noise"), [(0.5, 0.5), (10.0, 1.0)])
def test_rest_is_fused_with_every_height_without_aiding(make_parts: MakeParts, given: float, noise: float) -> None:
    parts = standing(make_parts, NOAID_M_NSE=given)
    parts.state.vel = np.array([0.1, 0.0, 0.2])
    parts.resets.last_known_ne = np.array([0.5, -0.5])
    step(parts, rests=True)
    assert parts.state.vel.tolist() == [0.1, 0.0, 0.2]
    step(parts, baro=0.0, rests=True)
    assert parts.state.vel[0] == pytest.approx(0.1 * (1 - weight(VEL_VAR, noise)))
    assert parts.state.vel[2] < 0.2 * (1 - 0.9 * weight(VEL_D_VAR, noise))
    assert parts.state.pos[0] == pytest.approx(0.5 * weight(POS_VAR, noise), rel=0.01)
    assert parts.fusion.innovations.vel_ratio == pytest.approx(0.01 / (GATE * 2 * (VEL_VAR + noise**2)))
    assert parts.aiding.times.vel == NOW_MS


def test_rest_is_not_fused_before_tilt_is_known(make_parts: MakeParts) -> None:
    parts = standing(make_parts)
    parts.state.vel = np.array([0.1, 0.0, 0.0])
    step(parts, vehicle=ARMED_UNTILTED, baro=0.0, rests=True)
    assert parts.state.vel[0] == 0.1


@pytest.mark.parametrize("told", ["vel", "flow", "odometry"])
def test_rest_is_fused_while_aiding_when_nothing_has_told_velocity_for_a_second(
    make_parts: MakeParts, told: str
) -> None:
    parts = navigating(make_parts, "60166")
    parts.state.vel = np.array([0.1, 0.0, 0.0])
    parts.aiding.times.vel = parts.aiding.times.odometry = NOW_MS - 5000
    setattr(parts.aiding.times, told, NOW_MS - 999)
    step(parts, baro=0.0, rests=True)
    assert parts.state.vel[0] == 0.1
    step(parts, now_ms=NOW_MS + 1, baro=0.0, rests=True)
    assert parts.state.vel[0] == pytest.approx(0.1 * (1 - weight(VEL_VAR, 1.0)))


def test_position_that_comes_with_rest_has_its_error_up_to_10_m(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "60166")
    parts.aiding.times.vel = parts.aiding.times.odometry = NOW_MS - 5000
    parts.set_pose(0.5, 0, 0, err=50.0)
    step(parts, baro=0.0, rests=True)
    assert parts.state.pos[0] == pytest.approx(0.5 * weight(POS_VAR, 10.0), rel=0.01)


def test_velocity_that_comes_as_rest_is_due_is_not_used(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66166")
    parts.aiding.times.vel = parts.aiding.times.odometry = NOW_MS - 5000
    parts.set_velocity(0.4, 0, 0, err=0.1)
    step(parts, baro=0.0, rests=True)
    assert parts.state.vel[0] == 0
    assert ("velocity", "model_unused", None) in parts.outcomes
    assert parts.aiding.times.vel == NOW_MS


# Heights


def test_height_is_fused_through_its_gate(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66166")
    step(parts, baro=1.0)
    assert parts.state.pos[2] == pytest.approx(-weight(HEIGHT_VAR, 2.0))
    assert parts.fusion.innovations.pos[2] == 1
    assert parts.fusion.innovations.height_ratio == pytest.approx(1 / (GATE * 8))
    assert parts.aiding.times.height == NOW_MS


@pytest.mark.parametrize(("standing_still", "limit"), [(False, 1.0), (True, 3.0)])
@pytest.mark.parametrize("passes", [True, False])
def test_gate_of_height_is_wider_for_a_vehicle_that_stands(
    make_parts: MakeParts, standing_still: bool, limit: float, passes: bool
) -> None:
    parts = (standing if standing_still else navigating)(make_parts, "66166")
    height = math.sqrt(limit * GATE * 8) * (0.999 if passes else 1.001)
    step(parts, baro=height)
    assert bool(parts.state.pos[2] != 0) is passes
    assert parts.aiding.times.height == (NOW_MS if passes else NOW_MS - 100)
    assert parts.fusion.innovations.pos[2] == pytest.approx(height)


def test_height_of_a_standing_vehicle_that_is_armed_has_the_narrow_gate(make_parts: MakeParts) -> None:
    parts = standing(make_parts)
    step(parts, vehicle=ARMED, baro=1.2 * math.sqrt(GATE * 8))
    assert parts.state.pos[2] == 0


def test_height_that_is_lost_is_reset_to(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66166")
    parts.aiding.times.height = NOW_MS - 5001
    parts.state.vel = np.array([1.0, 2.0, 3.0])
    step(parts, baro=1000.0)
    assert parts.state.pos[2] == -1000
    assert parts.state.vel.tolist() == [1, 2, 0]
    assert variances(parts)[POS.start + 2] == 4.0
    assert not parts.height.is_lost
    assert parts.aiding.times.height == NOW_MS


@pytest.mark.parametrize(("vehicle", "down_rate"), [(PARKED, 0.0), (ARMED, 3.0), (FLYING, 6.0)])
def test_vertical_velocity_after_a_reset_of_height(make_parts: MakeParts, vehicle: Vehicle, down_rate: float) -> None:
    parts = navigating(make_parts, "60606")
    parts.height.active = EXT_NAV
    parts.state.vel = np.array([1.0, 2.0, 3.0])
    parts.set_velocity(4, 5, 6, err=0.3)
    parts.fusion.reset_height(NOW_MS, vehicle)
    assert parts.state.vel.tolist() == [1, 2, down_rate]
    assert variances(parts)[VEL.start + 2] == pytest.approx(0.09)


def test_vertical_velocity_of_external_navigation_is_for_heights_of_the_same(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "60106")
    parts.height.active = BARO
    parts.state.vel = np.array([1.0, 2.0, 3.0])
    parts.set_velocity(4, 5, 6)
    parts.fusion.reset_height(NOW_MS, FLYING)
    assert parts.state.vel.tolist() == [1, 2, 3]


def test_height_of_a_pose_is_fused_without_aiding_too(make_parts: MakeParts) -> None:
    parts = standing(make_parts, "06666")
    parts.ingest.pose_stamp_ms, parts.ingest.have_pose = NOW_MS, True
    parts.set_pose(100, 100, 0, err=0.2)
    step(parts)
    parts.set_pose(100, 100, -0.5, err=0.2)
    step(parts, now_ms=NOW_MS + 33)
    assert parts.state.pos[2] == pytest.approx(-0.25, abs=0.01)  # the first height left a variance of 0.2^2
    assert parts.state.pos[0] == 0
    assert [outcome[:2] for outcome in parts.outcomes if outcome[0] == "height"] == [("height", "model_fused")] * 2


def test_other_source_of_height_is_followed_ungated(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_pose(0, 0, -1000)
    step(parts)
    assert parts.state.pos[2] == -1000
    assert parts.fusion.innovations.height_ratio == 0


def test_low_air_pressure_at_take_off_is_not_believed(make_parts: MakeParts) -> None:
    """The vehicle seems to sink by 3 m as its rotors blow at the ground: only what is beyond the dead zone counts."""
    parts = navigating(make_parts, "66166")
    step(parts, vehicle=TAKING_OFF, baro=-3.0)
    assert parts.fusion.innovations.pos[2] == pytest.approx(-0.5)
    assert parts.fusion.innovations.height_ratio == pytest.approx(9 / (GATE * (HEIGHT_VAR + 16)))
    assert parts.state.pos[2] == pytest.approx(0.5 * weight(HEIGHT_VAR, 4.0))


def test_rise_at_take_off_is_believed(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "66166")
    step(parts, vehicle=TAKING_OFF, baro=3.0)
    assert parts.fusion.innovations.pos[2] == pytest.approx(3)


# GPS


def fix(parts: "FilterParts", place: Vector3f, **fields: Any) -> None:
    """Let a solution of the GPS come due."""
    values: dict[str, Any] = {"vel_ned": Vector3f(), "num_sats": 10, "hdop": 100, **fields}
    sample = GpsSample(time_ms=NOW_MS, fix_type=3, location=ORIGIN.offset(place), **values)
    parts.gps.read(sample, NOW_MS, absolute=True, worst_ratios=(0.0, 0.0))
    parts.gps.push(sample, ORIGIN, 0.01 * ORIGIN.alt_cm, NOW_MS - 300, NOW_MS)
    parts.gps.recall(NOW_MS - 206)


def test_gps_gives_position_and_velocity(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "33131")
    fix(parts, Vector3f(1, -1, 0), vel_ned=Vector3f(0.1, -0.2, 0.3), has_vertical_velocity=True)
    step(parts)
    assert parts.state.pos[:2] == pytest.approx(weight(POS_VAR, 0.5) * np.array([1, -1]), abs=0.01)
    down = 0.3 * weight(VEL_D_VAR, 0.5)
    assert parts.state.vel == pytest.approx([0.1 * weight(VEL_VAR, 0.3), -0.2 * weight(VEL_VAR, 0.3), down])


@pytest.mark.parametrize(("sources", "has_vertical"), [("33131", False), ("33101", True)])
def test_gps_gives_vertical_velocity_if_it_has_one_and_is_its_source(
    make_parts: MakeParts, sources: str, has_vertical: bool
) -> None:
    parts = navigating(make_parts, sources)
    fix(parts, Vector3f(), vel_ned=Vector3f(0.1, -0.2, 0.3), has_vertical_velocity=has_vertical)
    step(parts)
    assert parts.state.vel[0] > 0
    assert parts.state.vel[2] == 0


def test_gps_may_give_position_alone(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "30101")
    fix(parts, Vector3f(1, -1, 0), vel_ned=Vector3f(0.1, -0.2, 0.3))
    step(parts)
    assert parts.state.pos[0] > 0
    assert parts.state.vel.tolist() == [0, 0, 0]


def test_accuracies_of_the_gps_count(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "33131")
    fix(parts, Vector3f(1, 0, 0), vel_ned=Vector3f(0.1, 0, 0), horizontal_accuracy=2.0, speed_accuracy=1.0)
    step(parts)
    assert parts.state.pos[0] == pytest.approx(weight(POS_VAR, 2.0), abs=0.01)
    assert parts.state.vel[0] == pytest.approx(0.1 * weight(VEL_VAR, 1.0))
    # The gate of velocity goes by what is assumed, not by what the receiver claims.
    assert parts.fusion.innovations.vel_ratio == pytest.approx(0.01 / (GATE * 2 * (VEL_VAR + 0.09)))


def test_noises_of_a_gps_that_tells_no_accuracies_have_limits(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "33131", POSNE_M_NSE=50, VELNE_M_NSE=50, VELD_M_NSE=50)
    fix(parts, Vector3f(1, 0, 0), vel_ned=Vector3f(0.1, 0, 0.3), has_vertical_velocity=True)
    step(parts)
    assert parts.state.pos[0] == pytest.approx(weight(POS_VAR, 10.0), rel=0.01)
    assert parts.state.vel == pytest.approx([0.1 * weight(VEL_VAR, 5.0), 0, 0.3 * weight(VEL_D_VAR, 5.0)])


def test_few_satellites_count_for_less_but_not_at_the_gate(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "33131")
    fix(parts, Vector3f(1, 0, 0), horizontal_accuracy=1.0)
    parts.gps.noise_scaler = 2.0
    step(parts)
    assert parts.state.pos[0] == pytest.approx(weight(POS_VAR, 2.0), abs=0.01)
    assert parts.fusion.innovations.pos_ratio == pytest.approx(1 / (GATE * 2 * (POS_VAR + 1.0)), rel=0.03)


@pytest.mark.parametrize(("sources", "scale"), [("33131", 2.0), ("60131", 1.0)])
def test_position_that_is_assumed_for_want_of_gps_counts_for_less(
    make_parts: MakeParts, sources: str, scale: float
) -> None:
    parts = make_parts(sources)
    parts.gps.noise_scaler = 2.0
    parts.state.pos = np.array([1.0, 0.0, 0.0])
    parts.height.baro.push(BaroSample(NOW_MS - 10, 0.0))
    step(parts)
    assert parts.state.pos[0] == pytest.approx(1 - weight(POS_VAR, 0.5 * scale), abs=0.01)


def test_gps_that_jumps_is_rejected(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "33131")
    fix(parts, Vector3f(1000, 0, 0))
    step(parts)
    assert parts.fusion.innovations.pos_ratio > 1
    assert parts.state.pos[0] == 0


def test_gps_of_no_source_is_not_fused(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    fix(parts, Vector3f(1, 0, 0))
    step(parts)
    assert parts.state.pos[:2].tolist() == [0, 0]


def test_change_from_external_navigation_to_gps_is_followed(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    step(parts)
    parts.params.set("EK3_SRC1_POSXY", 3)
    fix(parts, Vector3f(100, -50, -5))
    step(parts, now_ms=NOW_MS + 12)
    assert parts.state.pos == pytest.approx([100, -50, 0], abs=0.02)
    assert parts.resets.moved_ne == pytest.approx([100, -50], abs=0.02)


@pytest.mark.parametrize(("sources", "has_vertical", "vehicle", "down_rate"), [
    ("33131", True, FLYING, 0.3),
    ("33131", True, PARKED, 0.0),
    ("33131", False, FLYING, 0.5),
    ("33101", True, FLYING, 0.5),
])  # fmt: skip
def test_gps_gives_vertical_velocity_as_height_is_reset_in_flight(
    make_parts: MakeParts, sources: str, has_vertical: bool, vehicle: Vehicle, down_rate: float
) -> None:
    parts = navigating(make_parts, sources)
    parts.state.vel = np.array([0.0, 0.0, 0.5])
    fix(parts, Vector3f(), vel_ned=Vector3f(0, 0, 0.3), has_vertical_velocity=has_vertical)
    parts.fusion.reset_height(NOW_MS, vehicle)
    assert parts.state.vel[2] == pytest.approx(down_rate)


# Accelerometers that are bad


def seen_by_gps(parts: "FilterParts", *, climb: float, baro: float, now_ms: int) -> None:
    """Make a step in which height and climb are measured, by barometer and GPS."""
    fix = GpsFix(now_ms, np.array([0.0, 0.0, -baro]), np.array([0.0, 0.0, -climb]), True, None)
    parts.gps.delayed, parts.gps.is_due = fix, True
    step(parts, now_ms=now_ms, vehicle=FLYING, baro=baro)


def with_bad_accelerometers(make_parts: MakeParts, **params: float) -> "FilterParts":
    parts = navigating(make_parts, "33131", **params)
    seen_by_gps(parts, climb=8.0, baro=40.0, now_ms=NOW_MS)
    assert not parts.state.accel_is_bad
    assert parts.state.vel[2] == 0.0  # beyond the gate
    seen_by_gps(parts, climb=8.0, baro=40.0, now_ms=NOW_MS + 200)
    return parts


def test_height_and_climb_that_are_off_alike_are_the_accelerometers_fault(make_parts: MakeParts) -> None:
    parts = with_bad_accelerometers(make_parts, VELD_M_NSE=0.7, ALT_M_NSE=3.0)
    assert parts.state.accel_is_bad
    assert parts.state.vel[2] == pytest.approx(-8.0, abs=0.5)
    assert variances(parts)[[VEL.stop - 1, POS.stop - 1]] == pytest.approx([0.49, 9.0], rel=0.2)
    assert parts.state.unlearned == range(ACCEL.start, ACCEL.stop)
    assert parts.state.down < -1.0  # beyond its gate, and fused all the same


def test_accelerometers_are_trusted_again_10_s_after_all_was_well(make_parts: MakeParts) -> None:
    parts = with_bad_accelerometers(make_parts)
    down = -parts.state.down
    for since_ms, is_bad in ((9999, True), (10_200, False)):
        parts.aiding.times.height = NOW_MS + since_ms
        seen_by_gps(parts, climb=-float(parts.state.vel[2]), baro=down, now_ms=NOW_MS + since_ms)
        assert parts.state.accel_is_bad is is_bad


@pytest.mark.parametrize(
    ("sources", "climb", "baro"),
    [("33131", -8.0, 40.0), ("33131", 1.4, 40.0), ("33131", 4.0, 5.0), ("33101", 4.0, 40.0), ("33331", 4.0, 40.0)],
)
def test_accelerometers_are_trusted_otherwise(make_parts: MakeParts, sources: str, climb: float, baro: float) -> None:
    parts = navigating(make_parts, sources)
    for now_ms in (NOW_MS, NOW_MS + 200):
        parts.aiding.times.height = now_ms
        seen_by_gps(parts, climb=climb, baro=baro, now_ms=now_ms)
    assert not parts.state.accel_is_bad


def test_height_is_lost_with_accelerometers_that_have_been_bad_for_a_second(make_parts: MakeParts) -> None:
    parts = with_bad_accelerometers(make_parts)
    parts.aiding.times.height = NOW_MS + 1200
    seen_by_gps(parts, climb=8.0, baro=90.0, now_ms=NOW_MS + 1200)
    assert parts.state.down == -90.0
    assert parts.state.vel[2] == -8.0
