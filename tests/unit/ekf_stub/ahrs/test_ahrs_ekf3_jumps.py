# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter makes of poses and velocities that jump, stop and come back, while the vehicle stands still."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ekf_stub.core.params import BARO
from viso.firmware.releases import JULY_2025

if TYPE_CHECKING:
    from tests.unit.ekf_stub.bench_rig import BenchRig

MakeBench = Callable[..., "BenchRig"]

POSE_ALONE = "60606"
GOOD, GOOD_NOT_PASSING, LOST_BUT_AGREEING = 0x1233F, 0x1033F, 0x12027  # of XKF4.SS


def aided(make_bench: MakeBench, sources: str = "66666", *, with_velocity: bool = True, **params: float) -> "BenchRig":
    """Return a bench that has navigated by a pose of 0 for 3 s; its clock is at 9 s."""
    bench = make_bench(sources, run_s=6, **params)
    bench.know_gyros()
    bench.stream(9, bench.pose, *([bench.speed] if with_velocity else []))
    return bench


def when_changed(bench: "BenchRig", flags: int) -> int:
    """Return the time in ms at which the flags of EKF_STATUS_REPORT were first these after 9 s."""
    return next(time_ms for time_ms, was in bench.statuses if was == flags and time_ms > 9000)


# A camera that tells of its jump


def test_reset_counter_moves_position_at_once_and_nothing_else(make_bench: MakeBench) -> None:
    bench = aided(make_bench)
    before, said = bench.report, len(bench.texts)
    bench.stream(9.1, lambda: bench.pose(4, -2, reset_ms=9000), bench.speed)
    after = bench.report
    assert bench.position == pytest.approx((4, -2, 0), abs=0.02)
    assert after.moved_ne == pytest.approx((4, -2), abs=0.02)
    assert after.vel_ned == pytest.approx(before.vel_ned, abs=0.02)
    assert (after.timeouts, after.flags) == (before.timeouts, before.flags)
    assert after.variances[4:10] == pytest.approx(before.variances[4:10], rel=0.1)
    assert len(bench.texts) == said


def test_reset_counter_moves_height_too_when_it_comes_from_poses(make_bench: MakeBench) -> None:
    bench = aided(make_bench)
    bench.stream(9.1, lambda: bench.pose(0, 0, -5, reset_ms=9000), bench.speed)
    assert bench.position == pytest.approx((0, 0, -5), abs=0.05)


@pytest.mark.slow
def test_reset_counter_leaves_height_alone_when_it_comes_from_the_barometer(make_bench: MakeBench) -> None:
    bench = aided(make_bench, "66106", with_velocity=False)
    bench.stream(9.1, lambda: bench.pose(1, 0, -5, reset_ms=9000))
    assert bench.position == pytest.approx((1, 0, 0), abs=0.05)


def test_reset_counter_does_not_reset_yaw(make_bench: MakeBench) -> None:
    bench = aided(make_bench, with_velocity=False)
    bench.pose(yaw=1.0, reset_ms=9000)
    bench.run_for(0.1)
    assert bench.report.yaw_innovation == pytest.approx(-1.0, abs=0.02)
    assert abs(bench.report.rpy_rad[2]) < 0.5
    assert len(bench.yaw_resets) == 1


# Positions that jump without a word


@pytest.mark.slow
def test_pose_alone_that_jumps_is_rejected_for_7_s_and_then_reset_to(make_bench: MakeBench) -> None:
    bench = aided(make_bench, POSE_ALONE, with_velocity=False)
    bench.stream(9.1, lambda: bench.pose(30))
    assert bench.report.pos_innovation[0] == pytest.approx(-30, abs=0.1)
    assert bench.report.pos_ratio > 1
    assert (bench.report.flags, bench.report.timeouts) == (GOOD, 48)
    bench.stream(12.9, lambda: bench.pose(30))
    assert bench.report.flags == GOOD
    bench.stream(13.2, lambda: bench.pose(30))
    assert bench.report.flags == GOOD_NOT_PASSING
    bench.stream(15.9, lambda: bench.pose(30))
    assert bench.position == pytest.approx((0, 0, 0), abs=1)
    assert bench.ahrs.ext_nav_counts["pose", "model_gate_position"] > 200
    bench.stream(16.2, lambda: bench.pose(30))
    assert bench.report.moved_ne[0] == pytest.approx(30, abs=1)
    assert bench.position == pytest.approx((30, 0, 0), abs=0.1)
    assert (bench.report.flags, bench.report.timeouts) == (GOOD, 48)
    assert bench.ahrs.ext_nav_counts["pose", "model_reset"] == 1
    assert bench.said(since_s=9) == []


@pytest.mark.slow
def test_pose_that_jumps_while_velocity_passes_is_fused_after_10_s_and_counts_as_lost_for_good(
    make_bench: MakeBench,
) -> None:
    bench = aided(make_bench)
    bench.stream(18.9, lambda: bench.pose(30), bench.speed)
    assert (bench.report.flags, bench.report.timeouts) == (GOOD_NOT_PASSING, 48)
    assert bench.position == pytest.approx((0, 0, 0), abs=1)
    bench.stream(26, lambda: bench.pose(30), bench.speed)
    assert (bench.report.flags, bench.report.timeouts) == (LOST_BUT_AGREEING, 49)
    assert when_changed(bench, 39) == pytest.approx(19_020, abs=50)
    assert bench.position == pytest.approx((30, 0, 0), abs=1)
    assert bench.report.moved_ne == pytest.approx((0, 0), abs=0.1)
    bench.stream(26.5, lambda: bench.pose(40, reset_ms=26_000), bench.speed)
    assert bench.report.timeouts == 49


@pytest.mark.slow
def test_sticky_loss_ends_where_a_gps_has_passed_its_checks(make_bench: MakeBench) -> None:
    bench = aided(make_bench)
    sent = (lambda: bench.pose(30), bench.speed, bench.fix)
    bench.stream(19.5, *sent)
    assert bench.core.gps.checks.good
    assert bench.position == pytest.approx((30, 0, 0), abs=0.1)
    assert bench.report.timeouts == 48


def test_without_a_glitch_radius_a_jump_is_absorbed_within_a_second(make_bench: MakeBench) -> None:
    bench = aided(make_bench, POSE_ALONE, with_velocity=False, EK3_GLITCH_RAD=0)
    bench.stream(9.1, lambda: bench.pose(30))
    assert bench.report.pos_ratio > 1
    bench.stream(10, lambda: bench.pose(30))
    assert bench.position is not None
    assert bench.position[0] > 15
    assert (bench.report.flags, bench.report.timeouts) == (GOOD, 48)


def test_small_jump_passes_the_gate(make_bench: MakeBench) -> None:
    bench = aided(make_bench)
    bench.stream(9.2, lambda: bench.pose(1.2), bench.speed)
    assert 0 < bench.report.pos_ratio < 1
    assert bench.ahrs.ext_nav_counts["pose", "model_gate_position"] == 0
    assert bench.report.moved_ne == pytest.approx((0, 0), abs=0.01)


# Silence


@pytest.mark.slow
def test_poses_that_come_back_before_aiding_ends_are_reset_to_without_a_word(make_bench: MakeBench) -> None:
    bench = aided(make_bench, POSE_ALONE, with_velocity=False)
    bench.run_to(17)
    assert bench.report.timeouts == 51
    bench.stream(17.3, lambda: bench.pose(7))
    assert bench.position == pytest.approx((7, 0, 0), abs=0.2)
    assert (bench.report.flags, bench.report.timeouts) == (GOOD, 48)
    assert bench.said(since_s=9) == []


# Velocities


@pytest.mark.slow
def test_velocity_that_jumps_is_rejected_for_good_while_positions_pass(make_bench: MakeBench) -> None:
    bench = aided(make_bench)
    bench.run_for(0.08)
    before = bench.report.vel_innovation
    bench.stream(22, bench.pose, lambda: bench.speed(15))
    assert bench.report.vel_ratio > 100
    assert bench.report.vel_innovation == before
    assert bench.velocity == pytest.approx((0, 0, 0), abs=0.05)
    assert (bench.report.flags, bench.report.timeouts) == (GOOD, 48)
    assert bench.ahrs.ext_nav_counts["velocity", "model_gate_velocity"] > 300


# Heights


@pytest.mark.slow
@pytest.mark.parametrize(("with_velocity", "after_s"), [(False, 5.0), (True, 10.0)])
def test_height_that_jumps_is_rejected_and_then_reset_to(
    make_bench: MakeBench, with_velocity: bool, after_s: float
) -> None:
    bench = aided(make_bench, with_velocity=with_velocity)
    senders = [lambda: bench.pose(0, 0, -30), *([bench.speed] if with_velocity else [])]
    bench.stream(8.95 + after_s, *senders)
    assert bench.report.pos_innovation[2] == pytest.approx(30, abs=0.5)
    assert bench.report.pos_ned[2] == pytest.approx(0, abs=0.5)
    bench.stream(9.15 + after_s, *senders)
    assert bench.report.pos_ned[2] == pytest.approx(-30, abs=0.1)
    assert bench.report.height_ratio < 1
    assert bench.ahrs.ext_nav_counts["height", "model_reset"] == 1
    assert bench.said(since_s=9) == []


def test_height_steps_after_a_gap_in_which_the_barometer_took_over(make_bench: MakeBench) -> None:
    bench = aided(make_bench)
    bench.run_to(9.8)
    bench.stream(9.9, lambda: bench.pose(0, 0, -3), bench.speed)
    assert bench.report.pos_ned[2] == pytest.approx(-3, abs=0.1)
    assert bench.report.height_ratio < 0.1


def test_height_meets_its_gate_after_a_shorter_gap(make_bench: MakeBench) -> None:
    bench = aided(make_bench)
    bench.run_to(9.4)
    bench.stream(9.5, lambda: bench.pose(0, 0, -3), bench.speed)
    assert bench.report.pos_ned[2] == pytest.approx(0, abs=0.1)
    assert bench.report.height_ratio > 1


@pytest.mark.slow
def test_height_of_the_barometer_is_left_as_aiding_starts_and_comes_back_as_recorded(make_bench: MakeBench) -> None:
    bench = make_bench("60106", firmware=JULY_2025)
    bench.run_to(4.5)
    heights = []
    for time_s in (5.85, 6.75, 7.95, 9.15, 10.35, 11.85):
        bench.stream(time_s, lambda: bench.pose(1, 2, -5))
        heights.append(bench.report.pos_ned[2])
    assert heights == pytest.approx([-5.0, -3.9, 0.5, 2.1, 1.46, 0.05], abs=0.25)


@pytest.mark.slow
def test_height_is_kept_when_poses_end(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(11, lambda: bench.pose(0, 0, -5))
    bench.run_to(15)
    assert bench.report.pos_ned[2] == pytest.approx(-5, abs=0.1)
    assert bench.core.height.active == BARO


# Yaws


def test_yaw_that_jumps_on_the_ground_is_followed_slowly(make_bench: MakeBench) -> None:
    bench = aided(make_bench, with_velocity=False)
    bench.stream(9.1, lambda: bench.pose(yaw=1.57))
    assert bench.report.yaw_innovation == pytest.approx(-1.57, abs=0.1)
    assert bench.report.yaw_ratio > 1
    bench.stream(11, lambda: bench.pose(yaw=1.57))
    assert 0.1 < bench.report.rpy_rad[2] < 0.6
    assert bench.ahrs.ext_nav_counts["yaw", "model_gate_yaw"] == 0


@pytest.mark.slow
def test_yaw_that_jumps_in_flight_is_rejected_for_good(make_bench: MakeBench) -> None:
    bench = aided(make_bench, with_velocity=False)
    bench.state.armed, bench.state.flying_since_us = True, bench.clock.micros64() - 6_000_000
    bench.stream(15, lambda: bench.pose(yaw=1.57))
    assert bench.report.rpy_rad[2] == pytest.approx(0, abs=0.05)
    assert bench.report.yaw_ratio > 1
    assert bench.ahrs.ext_nav_counts["yaw", "model_gate_yaw"] > 150
    assert bench.said(since_s=9) == []
