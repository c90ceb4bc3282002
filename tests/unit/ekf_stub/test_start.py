# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A filter that starts up: its first attitude, when it knows tilt, and when it begins anew."""

import math
from itertools import pairwise

import pytest

from ap_core.location import Location
from ekf_stub.core.covariance import GYRO
from ekf_stub.core.params import EkfSources
from ekf_stub.core.vectors import euler_of
from ekf_stub.release import APRIL_2026, JULY_2025
from tests.unit.ekf_stub.filter_rig import (
    GRAVITY_MSS,
    HOME,
    INITIALISED,
    NO_AIDING,
    PARKED,
    SLOW_LOOP_US,
    START_US,
    FilterRig,
    navigating,
    standing,
)

START_MS = START_US // 1000
EARTH_RATE = 7.292115e-5


def test_filter_has_a_state_after_a_second_of_inertial_data() -> None:
    rig = FilterRig()
    rig.run(1.0)
    assert not rig.core.initialised
    rig.run(0.01)
    assert rig.core.initialised
    assert rig.said == [(START_MS + 1002, "initialised")]


def test_filter_steps_80_times_a_second() -> None:
    rig = standing()
    steps = 0
    for _ in range(400):
        rig.one_pass()
        steps += rig.core.stepped
    assert steps == 80
    assert rig.core.dt_ekf_avg == pytest.approx(0.0125, rel=1e-3)  # its average settles within seconds


def test_every_pass_is_a_step_where_passes_are_slow() -> None:
    rig = standing(loop_us=SLOW_LOOP_US)
    for _ in range(20):
        rig.one_pass()
        assert rig.core.stepped


def test_data_of_the_pass_after_the_state_began_count_twice() -> None:
    rig, dt = standing(run_s=1.0025), 0.0054  # of which two make a step
    assert rig.core.initialised
    rig.run_row(0.0, 0.0, -GRAVITY_MSS * dt, 0.0, 0.0, 0.0, dt, dt)
    assert rig.core.stepped


def test_rotation_before_the_state_began_is_of_the_first_step() -> None:
    # A step that may not be made waits for 24 ms, in passes of 2.5 ms ten of them: 401 passes leave the last one's.
    rig, other = FilterRig(), FilterRig()
    for one, turn in ((rig, 1e-3), (other, 0.0)):
        for number in range(402):
            one.run_row(0.0, 0.0, -GRAVITY_MSS * 0.0025, 0.0, 0.0, turn if number == 400 else 0.0, 0.0025, 0.0025)
        one.run(0.2)
        assert one.core.initialised
    assert rig.core.state.yaw(True) - other.core.state.yaw(True) == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize(("is_late", "passes"), [(False, 5), (True, 9)])
def test_filter_that_is_late_steps_every_ninth_pass(is_late: bool, passes: int) -> None:
    rig = standing()
    rig.is_late = is_late
    made = []
    for number in range(60):
        rig.one_pass()
        made += [number] * rig.core.stepped
    assert {after - before for before, after in pairwise(made)} == {passes}


@pytest.mark.parametrize(("delay_ms", "steps"), [(0, 6), (120, 11), (250, 21), (9000, 21)])
def test_horizon_lies_as_far_back_as_the_longest_delay_takes(delay_ms: int, steps: int) -> None:
    rig = standing(longest_delay_ms=delay_ms)
    rig.step()
    # The newest step is one of them.
    assert rig.now_ms - rig.core.ext_nav.horizon_ms == pytest.approx(12.5 * (steps - 1), abs=1)  # ms are whole


# The first attitude


@pytest.mark.parametrize("rpy_deg", [(0.0, 0.0), (10.0, 0.0), (0.0, -10.0), (20.0, 30.0), (180.0, 0.0), (0.0, 89.0)])
def test_first_attitude_is_what_the_accelerometers_show(rpy_deg: tuple[float, float]) -> None:
    rig = FilterRig()
    rig.roll, rig.pitch = map(math.radians, rpy_deg)
    rig.run(1.01)
    roll, pitch, yaw = euler_of(rig.core.state.quat)
    # It has been predicted once, by the turning earth and by numbers of single use.
    assert abs(math.remainder(roll - rig.roll, 2 * math.pi)) < 1e-3
    assert (pitch, yaw) == pytest.approx((rig.pitch, 0.0), abs=1e-3)


def test_first_variances_are_those_of_the_parameters() -> None:
    rig = standing(run_s=1.0025, VELNE_M_NSE=0.4, VELD_M_NSE=0.6, POSNE_M_NSE=0.7, ALT_M_NSE=3.0, ACC_BIAS_LIM=2.0)
    variances = rig.core.state.cov.variances()
    assert variances[4:10] == pytest.approx([0.16, 0.16, 0.36, 0.49, 0.49, 9.0])
    # Those of biases count in the first prediction, which adds them to attitude and velocity.
    of_gyro, of_accel = (math.radians(2.5) * 0.012) ** 2, (0.2 * 2.0 * 0.012) ** 2
    assert variances[10:16] == pytest.approx([of_gyro] * 3 + [of_accel] * 3)
    assert variances[16:] == [0.0] * 6
    rig.step()
    assert rig.core.state.cov.var(1) - 0.0025 == pytest.approx(0.25 * of_gyro, rel=0.05)
    assert rig.core.state.cov.var(6) - 0.36 == pytest.approx(of_accel, rel=0.5)


def test_vehicle_that_floats_starts_level() -> None:
    # GIVEN accelerometers that show nothing at all
    rig = FilterRig()
    for _ in range(402):
        rig.run_row(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0025, 0.0025)
    # THEN the filter takes it for level
    assert rig.core.initialised
    assert euler_of(rig.core.state.quat) == (0.0, 0.0, 0.0)


def test_earth_turns_as_it_does_at_home() -> None:
    rig = FilterRig()
    rig.core.inputs.home_lat = HOME.lat
    rig.run(1.01)
    latitude = math.radians(1e-7 * HOME.lat)
    expected = EARTH_RATE * math.cos(latitude), 0.0, -EARTH_RATE * math.sin(latitude)
    assert rig.core.state.earth_rate_ned == pytest.approx(expected)


def test_gyro_that_feels_the_earth_turn_shows_no_turn_of_the_vehicle() -> None:
    # GIVEN a vehicle on an earth that turns 100 times as fast, which its gyros feel
    rig = standing("00100")
    rate = 100 * EARTH_RATE
    rig.core.state.earth_rate_ned = (rate, 0.0, 0.0)
    rig.gyro_bias = [(rate, 0.0, 0.0)]
    rig.run(2.0)
    # THEN it neither rolls nor finds a bias
    assert abs(euler_of(rig.core.state.quat)[0]) < 1e-4
    assert abs(rig.report.gyro_bias[0]) < 0.05 * rate


# Limits of biases


@pytest.mark.parametrize(("rate", "kept"), [(0.4, 0.4), (0.6, 0.5)])
def test_bias_of_a_gyro_is_at_most_half_a_radian_a_second(rate: float, kept: float) -> None:
    state, dt = standing().core.state, standing().core.dt_ekf_avg
    state.set_gyro_bias((rate * dt, 0.0, 0.0))
    assert state.gyro_bias[0] == pytest.approx(kept * dt)
    assert state.cov.var(GYRO) <= (0.175 * dt) ** 2


def test_bias_of_an_accelerometer_is_limited_by_the_parameter_as_it_is() -> None:
    rig = standing(loop_us=SLOW_LOOP_US, ACC_BIAS_LIM=1.0)
    rig.core.state.set_accel_bias((0.8 * rig.core.dt_ekf_avg, 0.0, 0.0))
    rig.set_param("ACC_BIAS_LIM", 0.3)
    rig.step()
    rig.step()
    assert rig.report.accel_bias[0] == pytest.approx(0.3, abs=0.01)


# Tilt


def test_tilt_is_known_when_its_error_is_below_5_degrees() -> None:
    rig = standing(run_s=1.0025)
    while "tilt alignment complete" not in rig.texts:
        assert not rig.core.tilt_aligned
        before = rig.report.tilt_error_rad
        rig.one_pass()
    assert START_MS + 1500 < rig.now_ms < START_MS + 3000
    assert before < math.radians(5.0)
    assert rig.core.tilt_aligned


def test_biases_are_learned_from_the_pass_after_tilt_is_known_on() -> None:
    rig = standing(run_s=1.0025)
    rig.run_until(lambda: "tilt alignment complete" in rig.texts)
    assert not rig.core.state.learns_biases  # in that pass their variances are still 0
    rig.one_pass()
    assert rig.core.state.learns_biases
    gyro, accel = math.radians(2.5) * rig.core.dt_ekf_avg, 0.2 * rig.core.dt_ekf_avg
    variances = rig.core.state.cov.variances()
    # A step may have been made since, which adds a little noise and takes what the barometer shows.
    assert variances[10:13] == pytest.approx([gyro**2] * 3, rel=0.02)
    assert variances[15] == pytest.approx(accel**2, rel=0.02)


def test_bias_of_a_gyro_is_found() -> None:
    rig = standing("00101", loop_us=SLOW_LOOP_US)
    rig.gyro_bias = [(0.01, -0.02, 0.0)]
    rig.run(20)
    assert rig.report.gyro_bias[:2] == pytest.approx((0.01, -0.02), abs=0.003)  # still being learned


def test_turning_vehicle_turns_in_the_filter() -> None:
    rig = standing("00101")
    rig.yaw_rate = 0.5
    rig.run(2.0)
    # Without a compass its yaw is held while it stands still, as which turning does not count.
    assert rig.report.rpy_rad[2] == pytest.approx(1.0, abs=0.02)


# What is known of the start


def test_flags_of_the_start() -> None:
    rig = standing(run_s=1.1)
    assert rig.core.flags == 0
    rig.run(0.9)
    assert rig.core.flags == 0
    rig.run(2.0)
    assert rig.core.flags == PARKED


def test_filter_without_tilt_is_initialised_and_no_more() -> None:
    # GIVEN a filter whose tilt stays unknown, as a gyro's noise is large
    rig = FilterRig(GYRO_P_NSE=1.0, loop_us=SLOW_LOOP_US)
    rig.run(3.0)
    assert not rig.core.tilt_aligned
    assert rig.core.flags == INITIALISED


def test_filter_is_healthy_a_second_after_it_began() -> None:
    rig = standing(run_s=1.005)
    healthy_ms = rig.now_ms + 1000
    assert not rig.core.healthy(healthy_ms - 1)
    assert rig.core.healthy(healthy_ms)


@pytest.mark.parametrize(("now_ms", "drag"), [(5000, 0), (5001, 32)])
def test_airspeed_is_always_lost_and_drag_5_s_after_boot(now_ms: int, drag: int) -> None:
    assert standing().core.timeouts(now_ms) == 16 + 2 + drag


# Beginning anew


def lost() -> FilterRig:
    """Return a vehicle that is parked while its camera says that it moves, so that nothing is right any more."""
    rig = standing("06166", loop_us=SLOW_LOOP_US)
    while rig.core.flags:
        stream_motion(rig, 0.04)
    rig.told()
    return rig


def stream_motion(rig: FilterRig, seconds: float) -> None:
    for _ in range(round(seconds / 0.04)):
        rig.velocity(1.5)
        rig.run(0.04)


def test_filter_without_any_flag_for_5_s_begins_anew() -> None:
    rig = lost()
    stream_motion(rig, 4.9)
    assert (rig.core.flags, rig.told()) == (0, [])
    assert rig.core.ext_nav.have_velocity
    stream_motion(rig, 0.2)
    assert rig.told() == ["forced reset", "initialised"]
    # AND it has forgotten what it was given
    assert (rig.mode, rig.core.yaw_resets) == (NO_AIDING, 0)
    assert rig.core.state.pos == pytest.approx((0, 0, 0), abs=0.1)  # what velocities said since
    rig.run(2.5)
    assert rig.told() == ["tilt alignment complete"]
    assert rig.core.flags == PARKED


def test_armed_filter_does_not_begin_anew() -> None:
    rig = lost()
    rig.arm()
    stream_motion(rig, 7.0)
    assert "forced reset" not in rig.told()


def test_filter_that_never_had_a_flag_does_not_begin_anew() -> None:
    # GIVEN a vehicle of which velocities say from the start on that it moves
    rig = FilterRig("06166", loop_us=SLOW_LOOP_US)
    rig.run(1.1)
    for _ in range(200):
        rig.velocity(4.0)
        rig.run(0.04)
        assert rig.core.flags == 0
    assert "forced reset" not in rig.told()


def test_filter_that_begins_anew_has_no_origin_and_takes_none() -> None:
    # The origin that all cores share stays, and bars another one; a GPS alone would give the core its own again.
    rig = lost()
    assert rig.lanes.set_origin(HOME)
    rig.listen()
    rig.told()
    stream_motion(rig, 5.1)
    assert rig.told()[:2] == ["forced reset", "initialised"]
    assert (rig.core.origin, rig.lanes.origin) == (None, HOME)
    assert not rig.lanes.set_origin(HOME)


# Its origin


def test_origin_is_set_once() -> None:
    rig = standing()
    rig.told()
    assert rig.lanes.set_origin(HOME)
    assert not rig.lanes.set_origin(Location(1, 2, 3))
    rig.listen()
    assert (rig.core.origin, rig.core.origin_alt_cm()) == (HOME, 58400)
    assert rig.told() == ["origin set", "EKF3: origin already set"]


def test_origin_leaves_the_position_and_moves_the_earth() -> None:
    rig = navigating()
    before = rig.core.position()
    rig.lanes.set_origin(HOME)
    assert rig.core.position() == pytest.approx(before)
    latitude = math.radians(1e-7 * HOME.lat)
    assert rig.core.state.earth_rate_ned[2] == pytest.approx(-EARTH_RATE * math.sin(latitude))


@pytest.mark.parametrize(("release", "is_taken"), [(JULY_2025, True), (APRIL_2026, False)])
def test_origin_before_there_is_a_state_is_lost_and_since_2026_refused(release: object, is_taken: bool) -> None:
    # As in a recorded flight: set and announced 0.8 s before the filter was initialised, and again once it was.
    rig = standing(run_s=0.5, release=release)
    assert rig.lanes.set_origin(HOME) is is_taken
    rig.run(1.0)
    assert rig.core.origin is None
    assert rig.lanes.origin is None
    assert rig.texts == ["origin set"] * is_taken + ["initialised"]
    assert rig.lanes.set_origin(HOME)
    assert rig.core.origin == HOME


@pytest.mark.parametrize(
    ("alt_cm", "told_cm"), [(58400, 58400), (58408, 58408), (58409, 58408), (58410, 58409), (58428, 58427)]
)
def test_told_height_of_the_origin_has_been_through_single_precision(alt_cm: int, told_cm: int) -> None:
    rig = standing()
    rig.lanes.set_origin(Location(HOME.lat, HOME.lng, alt_cm))
    assert rig.core.origin_alt_cm() == told_cm
    down = rig.core.output.now.pos[2] + 0.01 * (alt_cm - told_cm)
    assert rig.core.position()[2] == pytest.approx(down, abs=1e-9)  # float32 of 0.01


def test_sources_that_name_no_camera_leave_it_without_buffers() -> None:
    rig = standing("33131")
    rig.camera()
    assert rig.outcomes == [("pose", "no_buffer"), ("yaw", "no_buffer")]
    assert not EkfSources(lambda _name: 3).ext_nav_enabled()
