# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Several cores, each with an IMU of its own: which is the primary one, and what happens as an IMU fails."""

import math
from typing import Any

import pytest

from ap_core.location import Location
from tests.unit.ekf_stub.filter_rig import HOME, SLOW_LOOP_US, FilterRig

PARIS = Location(488_566_000, 23_522_000, 3500)


def several(cores: int = 3, **params: Any) -> FilterRig:
    """Return a vehicle with IMUs that are alike, which navigates by its camera and may choose among its cores."""
    rig = FilterRig("66666", cores=cores, loop_us=SLOW_LOOP_US, **params)
    rig.feeds |= {"camera", "velocity"}
    rig.run(3.5)
    rig.skip(10.0)  # so long must the primary core have been healthy
    rig.run(0.5)
    rig.forget()
    return rig


def spoil(rig: FilterRig, imu: int, accel: float = 4.0) -> None:
    """Let an accelerometer show what is not."""
    rig.accel_bias[imu] = (0.0, 0.0, accel)


# Which one is primary


@pytest.mark.parametrize(("wanted", "primary"), [(0, 0), (2, 2), (3, 0), (-1, 0)])
def test_first_core_is_the_primary_one_unless_another_is_chosen(wanted: float, primary: int) -> None:
    assert FilterRig(cores=3, PRIMARY=wanted).lanes.primary == primary


def test_choice_of_the_user_counts_at_once_on_the_ground_and_by_an_option_in_flight() -> None:
    rig = several()
    rig.set_param("PRIMARY", 1)
    rig.one_pass()
    assert (rig.lanes.primary, rig.told()) == (1, [])
    rig.arm()
    rig.set_param("PRIMARY", 2)
    rig.one_pass()
    assert (rig.lanes.primary, rig.told()) == (1, [])
    rig.set_param("OPTIONS", 2)
    rig.one_pass()
    assert (rig.lanes.primary, rig.told()) == (2, ["EKF3 lane switch 2"])
    assert rig.lanes.primary_filter is rig.lanes.cores[2]


def test_core_whose_imu_fails_hands_over_to_the_better_one() -> None:
    # GIVEN a vehicle in flight
    rig = several()
    rig.arm()
    rig.run(0.5)
    # WHEN the first accelerometer fails
    spoil(rig, 0)
    rig.run_until(lambda: rig.lanes.primary != 0, 10.0)
    # THEN another core takes over, and yaw counts as reset
    assert rig.told()[-1].startswith("EKF3 lane switch ")
    assert rig.lanes.yaw_reset_ms == rig.now_ms
    assert rig.lanes.relative_errors == [0.0, 0.0, 0.0]
    good = rig.lanes.primary_filter
    assert math.dist(good.output.now.pos, rig.pos) < 0.2
    assert math.dist(rig.lanes.cores[0].output.now.pos, rig.pos) > 0.2


def test_core_that_has_been_the_primary_one_is_not_chosen_again_for_ten_seconds() -> None:
    rig = several(2)
    rig.arm()
    spoil(rig, 0)
    rig.run_until(lambda: rig.lanes.primary == 1, 10.0)
    switched_us = rig.now_us
    # WHEN it is the other one's turn to fail, twice
    rig.accel_bias = [(0.0, 0.0, 0.0), (0.0, 0.0, 4.0)]
    rig.run_until(lambda: rig.lanes.primary == 0, 60.0)
    first_us = rig.now_us
    rig.accel_bias = [(0.0, 0.0, 4.0), (0.0, 0.0, 0.0)]
    rig.run_until(lambda: rig.lanes.primary == 1, 60.0)
    assert rig.now_us - switched_us > 10_000_000
    assert first_us > switched_us


def test_little_that_a_core_is_better_counts_for_nothing() -> None:
    rig = several(2)
    rig.arm()
    rig.accel_bias = [(0.0, 0.0, 0.05), (0.0, 0.0, 0.0)]
    rig.run(5.0)
    assert rig.lanes.primary == 0
    assert rig.lanes.relative_errors[1] > -0.5


def test_nothing_is_chosen_before_the_primary_core_has_been_healthy_for_ten_seconds() -> None:
    rig = FilterRig("66666", cores=2, loop_us=SLOW_LOOP_US)
    rig.feeds |= {"camera", "velocity"}
    rig.run(3.0)
    rig.arm()
    spoil(rig, 0, 8.0)
    rig.run(3.0)
    assert rig.lanes.primary == 0
    assert rig.lanes.error_scores == [0.0, 0.0]


def test_core_of_the_user_comes_back_on_the_ground_without_a_word() -> None:
    rig = several(2)
    rig.arm()
    spoil(rig, 0)
    rig.run_until(lambda: rig.lanes.primary == 1, 10.0)
    rig.accel_bias[0] = (0.0, 0.0, 0.0)
    rig.forget()
    rig.arm(False)
    rig.run_until(lambda: rig.lanes.primary == 0, 10.0)
    assert "EKF3 lane switch 0" not in rig.texts


def test_manual_choice_alone_counts() -> None:
    rig = several(2, OPTIONS=2)
    rig.arm()
    spoil(rig, 0)
    rig.run(3.0)
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 0
    rig.set_param("PRIMARY", 1)
    rig.one_pass()
    assert rig.lanes.primary == 1
    assert "EKF3 lane switch 1" in rig.texts


# As the vehicle is about to give up


def rate(rig: FilterRig, *ratios: float) -> None:
    """Let each core's height be off by so much."""
    for core, ratio in zip(rig.lanes.cores, ratios, strict=True):
        core.vel_pos.height_ratio = ratio


def test_last_resort_is_the_core_of_the_lowest_score() -> None:
    rig = several()
    rate(rig, 0.8, 0.7, 0.6)
    rig.lanes.cores[2].yaw.aligned = False
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 1
    # AND not twice in five seconds
    rig.lanes.cores[2].yaw.aligned = True
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 1
    rig.arm()
    rig.skip(5.0)
    rig.one_pass()
    rate(rig, 0.8, 0.7, 0.6)
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 2


def test_no_core_above_the_limit_is_a_last_resort() -> None:
    rig = several(2)
    rate(rig, 1.0, 0.95)
    rig.lanes.check_lane_switch()
    rig.listen()
    assert (rig.lanes.primary, rig.told()) == (0, [])


def test_score_is_that_of_the_worst_innovation() -> None:
    rig = several(2)
    core = rig.core
    core.vel_pos.vel_ratio, core.vel_pos.pos_ratio, core.vel_pos.height_ratio = 0.2, 0.6, 0.3
    core.yaw.field.ratios = 0.5, 1.0, 1.5
    assert core.error_score() == pytest.approx(0.4)
    core.vel_pos.height_ratio = 0.5
    assert core.error_score() == 0.5
    rig.set_param("AFFINITY", 4)  # of the compass
    assert core.error_score() == pytest.approx(0.9)
    core.yaw.aligned = False
    assert core.error_score() == 0.0


def test_core_that_is_not_well_is_told_of() -> None:
    rig = several(2)
    assert rig.lanes.unhealthy_reason(rig.now_ms) is None
    second = rig.lanes.cores[1].vel_pos
    second.vel_ratio = second.pos_ratio = second.height_ratio = 2.0
    assert rig.lanes.unhealthy_reason(rig.now_ms) == "EKF3 still initialising"
    second.height_ratio = 0.9
    assert rig.lanes.unhealthy_reason(rig.now_ms) is None


# What goes to all


def test_origin_goes_to_all_cores_once() -> None:
    rig = several()
    assert rig.lanes.set_origin(HOME)
    assert [core.origin for core in rig.lanes.cores] == [HOME] * 3
    assert rig.lanes.origin == HOME
    assert not rig.lanes.set_origin(PARIS)
    rig.listen()
    assert rig.told() == ["origin set", "core 1: origin set", "core 2: origin set", "EKF3: origin already set"]


def test_heights_begin_anew_in_all_cores() -> None:
    rig = several()
    assert rig.lanes.reset_height_datum()
    assert [core.state.pos[2] for core in rig.lanes.cores] == [0.0] * 3


def test_yaw_jumps_as_the_primary_core_aligns_it() -> None:
    rig = FilterRig("66666", cores=2, loop_us=SLOW_LOOP_US)
    rig.run(3.0)
    assert rig.lanes.yaw_reset_ms == 0
    rig.camera()
    rig.run_until(lambda: rig.core.yaw.aligned)
    assert rig.lanes.yaw_reset_ms == rig.now_ms


# IMUs


def test_each_core_has_the_data_of_its_own_imu() -> None:
    rig = several(2)
    rig.gyro_bias = [(0.01, 0.0, 0.0), (-0.02, 0.0, 0.0)]
    rig.run(8.0)
    biases = [core.state.gyro_bias[0] / core.dt_ekf_avg for core in rig.lanes.cores]
    assert biases == pytest.approx([0.01, -0.02], abs=0.004)  # still being learned


@pytest.mark.parametrize(("spoilt", "sensors"), [("has_gyro", (0, 1)), ("has_accel", (1, 0))])
def test_sensor_that_fails_is_replaced_by_the_first(spoilt: str, sensors: tuple[int, int]) -> None:
    rig = several(2)
    setattr(rig.imus.imus[1], spoilt, False)
    assert (rig.imus.gyro_of(1), rig.imus.accel_of(1)) == sensors
    assert (rig.imus.gyro_of(0), rig.imus.accel_of(0)) == (0, 0)
    assert rig.imus.has_data_of(1)


def test_imu_that_says_nothing_is_none() -> None:
    rig = FilterRig(cores=2)
    assert rig.imus.are_several()
    rig.imus.imus[1].has_data = False
    assert not rig.imus.are_several()
    assert rig.imus.gyro_of(1) == 0
    # AND one of which nothing is known neither
    assert rig.imus.gyro_of(2) == 0


def test_gyro_that_stands_in_brings_its_own_bias() -> None:
    # GIVEN two gyros that differ, and cores that have known both for a while
    rig = several(2)
    rig.gyro_bias = [(0.0, 0.0, 0.0), (0.02, 0.0, 0.0)]
    rig.run(20.0)
    core = rig.core
    own = core.state.gyro_bias[0] / core.dt_ekf_avg
    roll = rig.report.rpy_rad[0]
    # WHEN the first fails
    rig.imus.imus[0].has_gyro, rig.imus.first_gyro = False, 1
    rig.one_pass()
    # THEN the filter knows a little of the other's bias, which it has been learning slowly all the while
    brought = core.state.gyro_bias[0] / core.dt_ekf_avg
    learned = 20.0 / 0.02 * 1e-4 * 0.02  # of 0.02 rad/s, in passes of 20 ms
    assert brought - own == pytest.approx(learned, rel=0.2)
    # AND tilt does not jump
    rig.run(0.2)
    assert rig.report.rpy_rad[0] == pytest.approx(roll, abs=0.01)
    # AND the first one's bias comes back with it
    rig.imus.imus[0].has_gyro, rig.imus.first_gyro = True, 0
    rig.one_pass()
    assert core.state.gyro_bias[0] / core.dt_ekf_avg == pytest.approx(own, abs=5e-4)
