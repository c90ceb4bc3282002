# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Velocities of the camera: their weight and gate, what is rejected, and what the filter is reset to."""

import math

import pytest

from ap_core.vector3 import Vector3f
from tests.unit.ekf_stub.filter_rig import (
    GRAVITY_MSS,
    HOME,
    MODE_ABSOLUTE,
    NO_AIDING,
    PARKED,
    SLOW_LOOP_US,
    FilterRig,
    Start,
    compared,
    navigating,
    reckoned,
    standing,
)

VEL, POS = 4, 7
GATE = 25.0  # EK3_VEL_I_GATE of 500, squared


def seen(sources: str = "66166", **options: object) -> FilterRig:
    """Return a vehicle that navigates with velocities, and whose sensors say nothing for now."""
    rig = navigating(sources, "velocity", **options)
    rig.lose("camera", "velocity", "baro")
    rig.run(0.2)
    rig.forget()
    return rig


def tell(start: Start, x: float, y: float, z: float = 0.0, *, err: float = 0.1) -> tuple[FilterRig, FilterRig]:
    """Let a velocity come due in a vehicle; return it and one without."""
    return compared(start, lambda rig: rig.velocity(x, y, z, err=err), lambda core: core.ext_nav.has_velocity)


def variances(rig: FilterRig) -> list[float]:
    return rig.core.state.cov.variances()[VEL : VEL + 3]


def ratio_of(rig: FilterRig, vel: tuple[float, ...], gate_var: float) -> float:
    """Return the ratio of velocities, along so many axes, by the covariance before."""
    off = sum((a - b) ** 2 for a, b in zip(rig.core.state.vel, vel, strict=False))
    return off / (GATE * (sum(variances(rig)[: len(vel)]) + len(vel) * gate_var))


@pytest.mark.parametrize(("err", "noise"), [(0.1, 0.1), (0.0, 0.05), (10.0, 10.0), (1e4, 50.0)])
def test_velocity_is_fused_with_its_error_within_limits(err: float, noise: float) -> None:
    told, other = tell(lambda: seen("66106"), 0.1, -0.2, 0.3, err=err)
    states = reckoned(other, (VEL, 0.1, noise**2), (VEL + 1, -0.2, noise**2))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-6)
    assert told.core.state.pos == pytest.approx(states[POS : POS + 3], abs=1e-6)
    assert told.core.aiding.vel_ms == told.now_ms
    # AND its vertical part, which is not to be used, shows no innovation
    assert told.report.vel_innovation[2] == 0.0


def test_vertical_velocity_is_fused_with_the_others() -> None:
    told, other = tell(seen, 0.1, -0.2, 0.3)
    states = reckoned(other, (VEL, 0.1, 0.01), (VEL + 1, -0.2, 0.01), (VEL + 2, 0.3, 0.01))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-6)
    assert told.report.vel_ratio == pytest.approx(ratio_of(other, (0.1, -0.2, 0.3), 0.01), rel=1e-4)


def test_vertical_velocity_alone_is_never_fused() -> None:
    def start() -> FilterRig:
        rig = navigating("60666")
        rig.lose("camera", "baro")
        return rig

    told, other = tell(start, 0.1, 0.2, 0.3)
    assert told.core.state.vel == other.core.state.vel
    assert told.report.vel_ratio == 0
    assert ("velocity", "model_unused") in told.became()


@pytest.mark.parametrize(("options", "is_used"), [(0, False), (1, True), (2, False)])
def test_velocity_of_any_set_is_fused_if_the_option_says_so(options: float, is_used: bool) -> None:
    def start() -> FilterRig:
        rig = seen()
        rig.use("60166")
        rig.use("06006", 2)
        rig.set_param("SRC_OPTIONS", options)
        return rig

    told, other = tell(start, 0.1, 0.2, 0.3)
    assert (told.core.state.vel[0] > other.core.state.vel[0] + 0.01) is is_used
    assert told.became() == [("velocity", "model_fused" if is_used else "model_unused")]


@pytest.mark.parametrize(("err", "noise"), [(0.1, 0.1), (0.01, 0.05), (40.0, 5.0)])
def test_gate_of_velocity_has_another_upper_limit_of_the_error(err: float, noise: float) -> None:
    told, other = tell(lambda: seen("66106"), 1.0, 2.0, err=err)
    # The acceleration that is felt at rest, of some mm/s/s, counts too.
    assert told.report.vel_ratio == pytest.approx(ratio_of(other, (1.0, 2.0), noise**2), rel=1e-3)


def test_gate_of_velocity_opens_with_acceleration() -> None:
    def start() -> FilterRig:
        rig = seen("66106")
        rig.accel_ned = 4.0, 0.0, 0.0
        rig.run(0.5)
        return rig

    told, other = tell(start, *start().vel[:2])
    accel = math.dist(other.core.state.accel_filtered, (0.0, 0.0, 0.0))
    assert accel > 3.0
    expected = ratio_of(other, other.vel[:2], 0.01 + (0.05 * accel) ** 2)
    innovation = told.last_test("velocity")[2]
    assert innovation > 0.0
    # What was told was the velocity of 16 ms before it came due.
    vel = math.sqrt(told.report.vel_ratio * GATE * (sum(variances(other)[:2]) + 2 * (0.01 + (0.05 * accel) ** 2)))
    assert vel == pytest.approx(innovation, rel=1e-6)
    assert expected < 1


@pytest.mark.parametrize(("percent", "sigmas"), [(500, 5.0), (300, 3.0), (50, 1.0)])
@pytest.mark.parametrize("passes", [True, False])
def test_gate_of_velocity_is_as_wide_as_its_parameter_but_not_less_than_a_sigma(
    percent: float, sigmas: float, passes: bool
) -> None:
    def start() -> FilterRig:
        rig = seen("66106")
        rig.set_param("VEL_I_GATE", percent)
        return rig

    _, other = tell(start, 0.0, 0.0)
    spread = sum(variances(other)[:2]) + 2 * 0.01
    speed = sigmas * math.sqrt(spread) * (0.999 if passes else 1.001)
    north, east, _ = other.core.state.vel
    told, _ = tell(start, north + speed, east)
    assert told.became() == [("velocity", "model_fused" if passes else "model_gate_velocity")]


def test_rejected_velocity_freezes_its_innovation() -> None:
    def start() -> FilterRig:
        return tell(seen, 0.1, -0.2, 0.3)[0]

    before = start().report.vel_innovation
    assert before[0] < 0 < before[1]
    told, other = tell(start, 15.0, 0.0)
    assert told.report.vel_ratio > 1
    assert told.report.vel_innovation == before
    assert told.core.state.vel == other.core.state.vel
    assert told.core.aiding.vel_ms < told.now_ms
    code, ratio, innovation = told.last_test("velocity")
    assert (code, ratio) == ("model_gate_velocity", pytest.approx(math.sqrt(told.report.vel_ratio)))
    assert innovation == pytest.approx(15.0, abs=0.5)  # with all that it has learned from the one before


def test_gates_are_of_the_covariance_before_the_step() -> None:
    # GIVEN position and velocity that go together
    def start() -> FilterRig:
        return seen("66106")

    def say(rig: FilterRig) -> None:
        rig.velocity(0.3, 0.0, err=0.1)
        rig.camera(0.5, 0.0, 0.0, yaw=math.nan)

    told, other = compared(start, say, lambda core: core.ext_nav.has_velocity and core.ext_nav.has_pose)
    variance = other.core.state.cov.variances()
    off = math.dist(other.core.state.pos[:2], (0.5, 0.0))
    assert told.report.pos_ratio == pytest.approx(off**2 / (25.0 * (variance[POS] + variance[POS + 1] + 2 * 0.04)))
    # AND velocity, which is first, has moved the position by the time it is fused
    states = reckoned(other, (VEL, 0.3, 0.01), (VEL + 1, 0.0, 0.01))
    assert told.report.pos_innovation[0] == pytest.approx(states[POS] - 0.5, abs=1e-6)


# Without a radius


def test_velocity_is_fused_without_a_gate_when_there_is_no_radius() -> None:
    def start() -> FilterRig:
        rig = seen("66106")
        rig.set_param("GLITCH_RAD", 0)
        return rig

    told, other = tell(start, 15.0, 0.0)
    states = reckoned(other, (VEL, 15.0, 0.01), (VEL + 1, 0.0, 0.01))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-5)
    assert told.report.vel_ratio > 1
    # AND position counts as known by it
    assert told.core.aiding.pos_ms == told.now_ms


# A velocity that is lost


@pytest.mark.parametrize("north", [0.1, 15.0])
def test_velocity_that_is_lost_is_reset_to_whether_it_passes_or_not(north: float) -> None:
    # GIVEN a vehicle that has lost everything
    def start() -> FilterRig:
        rig = navigating("66166", loop_us=SLOW_LOOP_US)
        rig.lose("camera", "baro")
        rig.skip(7.0)
        rig.run(0.1)
        assert rig.core.aiding.vel_timeout
        rig.forget()
        return rig

    # WHEN a velocity comes
    told, _ = tell(start, north, 0.0, err=0.2)
    # THEN the filter is reset to it
    assert told.core.state.vel[:2] == (north, 0.0)
    assert variances(told)[:2] == pytest.approx([0.04, 0.04])
    assert told.core.output.now.vel[:2] == pytest.approx((north, 0.0), abs=0.01)  # drawn on since
    assert told.report.vel_ratio == 0
    assert (told.core.aiding.vel_timeout, told.core.aiding.vel_ms) == (False, told.now_ms)
    assert told.became() == [("velocity", "model_reset")]
    # AND position stays lost
    assert told.core.aiding.pos_timeout


def test_velocity_that_never_came_is_0_and_certain_as_aiding_starts() -> None:
    rig = standing()
    rig.camera(yaw=math.nan)
    rig.run_until(lambda: rig.mode == MODE_ABSOLUTE)
    assert rig.core.state.vel[:2] == (0.0, 0.0)
    assert max(variances(rig)[:2]) <= 1e-4


@pytest.mark.parametrize("age_s", [0.1, 0.4])
def test_velocity_of_no_source_counts_as_aiding_starts_however_old(age_s: float) -> None:
    rig = standing("60166")
    rig.lose("baro")
    rig.velocity(4.0, 5.0, 6.0, err=0.2)
    rig.run(age_s)
    rig.camera(yaw=math.nan)
    rig.run_until(lambda: rig.mode == MODE_ABSOLUTE)
    assert rig.core.state.vel[:2] == pytest.approx((4.0, 5.0))
    assert variances(rig)[:2] == pytest.approx([0.04, 0.04])


@pytest.mark.parametrize(("age_s", "north", "variance"), [(0.1, 7.0, 4.0), (0.4, 0.0, 625.0)])
def test_velocity_of_a_gps_counts_as_aiding_starts_while_it_is_fresh_and_no_source_is_named(
    age_s: float, north: float, variance: float
) -> None:
    rig = standing("60166")
    rig.lanes.set_origin(HOME)
    rig.gps = {"vel_ned": Vector3f(7, 8, 9), "speed_accuracy": 2.0}
    rig.feeds.add("gps")
    rig.run(0.02)
    rig.feeds.discard("gps")
    rig.camera(yaw=math.nan, stamp_ms=rig.now_ms + round(1000 * age_s) - 100)
    rig.run_until(lambda: rig.mode == MODE_ABSOLUTE)
    assert rig.core.state.vel[0] == north
    assert variances(rig)[0] == pytest.approx(variance)


# Without aiding


def test_velocity_is_fused_between_heights_but_not_with_them() -> None:
    # GIVEN a vehicle that does not navigate
    def start() -> FilterRig:
        rig = standing("66166")
        rig.lose("baro")
        rig.forget()
        return rig

    def with_height(rig: FilterRig) -> None:
        rig.core.inputs.set_baro(rig.now_ms, 0.0)
        rig.velocity(0.4, 0.0, 0.0, stamp_ms=rig.now_ms - 50)

    # WHEN a velocity comes with a height
    told, _ = compared(start, with_height, lambda core: core.height.is_new and core.ext_nav.has_velocity)
    # THEN it is not used
    assert told.became() == [("velocity", "model_unused")]
    # AND by itself it is, with the noise of a vehicle that stands
    told, other = tell(start, 0.4, 0.0)
    variance = variances(other)[0]
    vel = other.core.state.vel[0]
    assert told.core.state.vel[0] - vel == pytest.approx((0.4 - vel) * variance / (variance + 0.25), rel=1e-3)
    assert told.report.vel_ratio == pytest.approx(ratio_of(other, (0.4, 0.0, 0.0), 0.25), rel=1e-3)
    assert told.mode == NO_AIDING


def test_lost_velocity_is_fused_through_no_gate_without_aiding() -> None:
    def start() -> FilterRig:
        rig = standing("66166")
        rig.lose("baro")
        return rig

    told, other = tell(start, 40.0, 0.0)
    assert told.core.aiding.vel_timeout
    variance = variances(other)[0]
    assert told.core.state.vel[0] == pytest.approx(40.0 * variance / (variance + 0.25), rel=1e-2)


def test_without_aiding_velocity_leaves_accelerometers_alone_and_what_gravity_shows() -> None:
    """Horizontal measurements say little of the biases of accelerometers, and of the gyro about the vertical."""

    def start() -> FilterRig:
        rig = standing("66106")
        rig.arm()  # so that all biases may be learned
        rig.run(0.5)
        rig.lose("baro")
        return rig

    told, other = tell(start, 0.5, 0.3)
    assert told.core.state.accel_bias[:2] == other.core.state.accel_bias[:2]
    assert told.core.state.gyro_bias[2] == other.core.state.gyro_bias[2]
    assert told.core.state.gyro_bias[0] != other.core.state.gyro_bias[0]

    # AND while it navigates, all are corrected
    def navigating_start() -> FilterRig:
        rig = seen()
        rig.arm()
        rig.accel_bias = [(0.3, 0.2, 0.0)]
        rig.run(0.3)
        return rig

    told, other = tell(navigating_start, 0.5, 0.3)
    assert told.core.state.accel_bias[0] != other.core.state.accel_bias[0]


# Healthy or not


def test_parked_vehicle_that_seems_to_move_is_unhealthy() -> None:
    # GIVEN a parked vehicle of which velocities say for long that it moves
    rig = standing("06166", loop_us=SLOW_LOOP_US)
    assert rig.core.flags == PARKED
    for _ in range(60):
        rig.velocity(2.0)
        rig.run(0.04)
        if not rig.core.flags:
            break
    # THEN it is unhealthy by how far it seems to have gone
    assert math.hypot(*rig.report.pos_innovation[:2]) > 1.0
    assert not rig.core.healthy(rig.now_ms)
    # AND armed it is not
    rig.arm()
    rig.one_pass()
    assert rig.core.healthy(rig.now_ms)


def test_acceleration_that_nothing_aids_counts_no_more_than_5_m_s_s() -> None:
    aided, alone = seen(), standing("66166")
    alone.lose("baro")
    for rig in (aided, alone):
        for _ in range(600):
            rig.run_row(10.0 * 0.0025, 0.0, -GRAVITY_MSS * 0.0025, 0.0, 0.0, 0.0, 0.0025, 0.0025)
    # One and a half seconds, less what still waits for the horizon: a step more or less.
    assert aided.core.state.vel[0] == pytest.approx(10.0 * 1.4375, abs=0.125)
    assert 0.5 < alone.core.state.vel[0] / aided.core.state.vel[0] < 0.7  # it takes a while to be noticed


def test_accelerating_vehicle_moves_in_the_filter_at_once() -> None:
    rig = seen()
    rig.accel_ned = 2.0, 0.0, 0.0
    rig.run(1.0)
    assert rig.core.output.now.vel == pytest.approx(rig.vel, abs=0.05)
    assert rig.core.output.now.pos == pytest.approx(rig.pos, abs=0.05)


def test_camera_and_velocities_that_agree_leave_next_to_no_error_on_a_circle() -> None:
    # GIVEN a vehicle that drives a circle of 2 m with 1 m/s, seen with no error
    rig = navigating("66666", "velocity", loop_us=10_000)
    rig.move(1.0, 0.0, 0.0, 1.0)
    rig.yaw_rate = 0.5
    for _ in range(300):
        rig.accel_ned = -0.5 * rig.vel[1], 0.5 * rig.vel[0], 0.0
        rig.one_pass()
    # THEN the filter knows where it is to what comes by stamps of 10 ms, and by passes of as much
    assert rig.miss_m() < 0.05
    assert rig.core.output.now.vel == pytest.approx(rig.vel, abs=0.05)
    assert rig.report.rpy_rad[2] == pytest.approx(rig.yaw, abs=0.02)
