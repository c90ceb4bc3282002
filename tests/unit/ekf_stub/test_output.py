# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is told of the present: it follows the filter, and jumps with it, all along its history."""

import math

import pytest

from ekf_stub.core.vectors import conjugate, euler_of, quat_of_euler, times
from tests.unit.ekf_stub.filter_rig import HOME, SLOW_LOOP_US, FilterRig, navigating, standing


def far_off() -> FilterRig:
    """Return a vehicle whose horizon lies 250 ms back."""
    return navigating("66666", "velocity", longest_delay_ms=250)


def test_output_is_ahead_of_the_filter_by_the_inertial_data_since() -> None:
    rig = far_off()
    rig.move(2.0, -1.0, 0.0, 1.0)
    rig.run(0.5)
    horizon_s = 1e-3 * (rig.now_ms - rig.core.ext_nav.horizon_ms)
    assert horizon_s > 0.24
    ahead = rig.core.output.now.pos[0] - rig.core.state.pos[0]
    assert ahead == pytest.approx(horizon_s * rig.vel[0], rel=0.05)
    assert rig.miss_m() < 0.05


def test_output_takes_the_filters_biases_off() -> None:
    rig = standing("66666", loop_us=SLOW_LOOP_US)
    rig.feeds |= {"camera", "velocity"}
    rig.gyro_bias, rig.accel_bias = [(0.01, -0.01, 0.0)], [(0.0, 0.0, 0.2)]
    rig.run(40.0)
    assert rig.core.output.now.vel == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    assert rig.report.accel_bias[2] == pytest.approx(0.2, abs=0.05)
    assert euler_of(rig.core.output.now.quat)[:2] == pytest.approx((0.0, 0.0), abs=5e-3)


def test_output_follows_the_filter_the_faster_the_shorter_its_time_constant() -> None:
    errors = []
    for tau in (10, 50):
        rig = navigating("66166", TAU_OUTPUT=tau)
        rig.lose("camera")
        rig.camera(0.8, 0.0, 0.0, yaw=math.nan)
        rig.run(0.25)
        errors.append(rig.core.output.pos_error)
    assert errors[0] < 0.7 * errors[1]


def test_errors_are_how_far_it_was_from_the_filter() -> None:
    rig = navigating("66166")
    rig.lose("camera")
    assert rig.report.pos_error < 0.01
    before = rig.core.state.pos[0]
    rig.camera(0.8, 0.0, 0.0, yaw=math.nan)
    rig.run_until(lambda: rig.core.state.pos[0] > before + 0.05)
    assert rig.report.pos_error == pytest.approx(rig.core.state.pos[0] - before, abs=0.01)
    assert rig.report.vel_error > 0


def test_attitude_follows_the_filter() -> None:
    rig = navigating()
    rig.camera_yaw = 0.3
    rig.run(0.1)
    start = rig.report.angle_error
    rig.run(4.0)
    assert start > 0
    assert euler_of(rig.core.output.now.quat)[2] == pytest.approx(rig.heading, abs=0.01)
    assert rig.heading > 0.2


@pytest.mark.parametrize("kind", ["jump", "place", "yaw"])
def test_present_and_past_jump_together(kind: str) -> None:
    """After a reset, the output agrees with the filter at the horizon, and so neither swings nor drifts."""
    rig = far_off()
    if kind == "jump":
        rig.camera_shift, rig.reset_ms = (30.0, -40.0, -5.0), 7
        rig.run_until(lambda: rig.core.state.pos[0] > 20.0)
    elif kind == "place":
        rig.lanes.set_origin(HOME)
        rig.lose("camera")
        rig.run(1.3)
        assert rig.lanes.set_place(HOME, 1.0, rig.now_ms)
    else:
        rig.lose("camera")
        rig.set_param("SRC1_YAW", 2)
        rig.run(0.5)
        rig.set_param("SRC1_YAW", 6)
        rig.camera_yaw = 1.5
        rig.feeds.add("camera")
        rig.run_until(lambda: rig.heading > 1.0)
    rig.step()
    assert rig.report.pos_error < 0.05
    assert rig.report.angle_error < 0.01
    assert rig.report.vel_error < 0.05


def test_output_turns_about_its_own_body_as_yaw_is_set() -> None:
    # GIVEN an output that leans otherwise than the filter at the horizon, as where the vehicle turns
    rig = standing(loop_us=SLOW_LOOP_US)
    output, state = rig.core.output, rig.core.state
    leaning = quat_of_euler(0.1, -0.2, 0.3)
    output.now.quat, before = leaning, state.quat
    # WHEN the filter's yaw is set, THEN what the filter turned, seen from its body, is what the output turns
    output.rotate(state.set_yaw(1.5, 0.01, True))
    expected = times(times(leaning, conjugate(before)), state.quat)
    assert output.now.quat == pytest.approx(expected, abs=1e-12)
    assert state.yaw(True) == pytest.approx(1.5)


# The rate of height


def test_height_rate_comes_to_that_of_the_height() -> None:
    rig = far_off()
    rig.move(0.0, 0.0, -2.0, 1.0)
    rig.run(2.0)
    assert rig.report.height_rate == pytest.approx(-2.0, abs=0.02)


def test_height_rate_does_not_jump_with_the_height() -> None:
    rig = far_off()
    rig.camera_shift, rig.reset_ms = (0.0, 0.0, -5.0), 7
    worst = 0.0
    for _ in range(400):
        rig.one_pass()
        worst = max(worst, abs(rig.report.height_rate))
    assert rig.core.output.now.pos[2] == pytest.approx(-5.0, abs=0.05)
    assert worst < 0.05


# Bad accelerometers are in test_gps


def test_told_state_is_no_farther_than_the_filters_limits() -> None:
    rig = navigating(GLITCH_RAD=0, loop_us=SLOW_LOOP_US)
    for number in range(20):
        rig.reset_ms = number + 1
        rig.camera(9e7, -9e7, 9e7, yaw=math.nan)
        rig.run(0.06)
    assert max(map(abs, rig.core.state.pos)) <= 5e7
    assert max(map(abs, rig.core.output.now.pos)) <= 5.1e7  # it goes on by its velocity
