# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of a scripted vehicle say what its trajectory means, and adding up what they say leads back to it."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import quaternion
from hypothesis import given, settings
from hypothesis import strategies as st

from ekf_stub.core.vectors import Quat
from ekf_stub.inputs.measurements import Array
from ekf_stub.inputs.sensors import Sensors
from viso.errors import InputError
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.script.script import ScriptSource, read_script_source
from viso.vehicle.sensors.script.script_file import parse_script
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.vectors import halfway, rotation_between, turned

G = 9.80665
LOOP_US = 2500
START_S = 1.0
START_US = 1_000_000

EIGHT = """start = 1
[[leg]]
shape = "figure_eight"
length_m = 8
width_m = 4
period_s = 12
nose = "path"
"""
ARMED = """delay_s = 2
[[leg]]
shape = "point"
to_ned_m = [4, 0, -2]
duration_s = 4
"""

CURVE = st.sampled_from(["laps = 1", "laps = 2", "bearing_deg = 70", "ramp_s = 1"])
NOSE = st.sampled_from(["", 'nose = "path"'])
LENGTH = st.floats(0.5, 5)
PERIOD = st.floats(6, 12)  # up to 1.3 g
SMOOTH_LEGS = st.one_of(
    st.builds(
        'shape = "point"\nto_ned_m = [{}, {}, {}]\nduration_s = {}\nyaw_deg = {}'.format,
        *[st.floats(-5, 5)] * 3,
        st.floats(4, 8),
        st.integers(-180, 180),
    ),
    st.builds('shape = "hover"\nduration_s = {}\nyaw_deg = {}'.format, st.floats(4, 8), st.integers(-180, 180)),
    st.builds('shape = "line"\nlength_m = {}\nperiod_s = {}\n{}'.format, LENGTH, PERIOD, CURVE),
    st.builds('shape = "circle"\nradius_m = {}\nperiod_s = {}\n{}\n{}'.format, LENGTH, PERIOD, CURVE, NOSE),
    st.builds(
        'shape = "figure_eight"\nlength_m = {}\nwidth_m = {}\nperiod_s = {}\n{}\n{}'.format,
        *(st.floats(2, 5), st.floats(0.5, 2), PERIOD, CURVE, NOSE),  # a narrow one turns the nose too fast
    ),
)
LEGS = SMOOTH_LEGS | st.builds('shape = "square"\nside_m = {}\nperiod_s = {}\nlaps = 1'.format, LENGTH, PERIOD)
# Rates are steady between, but neither where a leg begins or ends nor in the corners of a square.
MOMENTS_S = st.floats(0.01, 3.9)
ATTITUDES = st.sampled_from(["multirotor", "given"])


def make_source(text: str, **options: object) -> ScriptSource:
    return ScriptSource(ImuOptions(**options), parse_script(text, "test"))  # type: ignore[arg-type]  # by keyword


def script_of(attitude: str, leg: str) -> str:
    return f'start = {START_S}\nattitude = "{attitude}"\n[[leg]]\n{leg}\n'


def sense(source: ScriptSource, now_us: int) -> Sensors:
    sensors = source.sense(now_us)
    assert sensors is not None
    return sensors


def test_script_may_move_at_any_time() -> None:
    assert not make_source(script_of("given", 'shape = "hover"\nduration_s = 1')).is_at_rest(1)


def rotation_of(quat: Quat) -> Array:
    rotation: Array = quaternion.as_rotation_matrix(quaternion.quaternion(*quat))
    return rotation


def dead_reckon(source: ScriptSource, end_us: int) -> Iterator[tuple[int, Array, Array, Quat]]:
    """Add up inertial data from the first pass on, and yield time, position, velocity and attitude."""
    sense(source, LOOP_US)
    begin = source.truth(LOOP_US)
    pos, vel, quat = np.array(begin.pos_ned), np.array(begin.vel_ned), begin.quat_wxyz
    for now_us in range(2 * LOOP_US, end_us + 1, LOOP_US):
        delta = sense(source, now_us).delta
        after = turned(quat, tuple(delta.del_ang.tolist()))
        change = rotation_of(halfway(quat, after)) @ delta.del_vel
        change[2] += G * delta.del_vel_dt
        pos, vel, quat = pos + (vel + 0.5 * change) * delta.del_vel_dt, vel + change, after
        yield now_us, pos, vel, quat


def felt_force(source: ScriptSource, time_us: float) -> Array:
    """Return the specific force in the body frame, from the true velocity and attitude."""
    before, after = (source.truth(round(time_us + sign * 50)) for sign in (-1, 1))
    accel = np.subtract(after.vel_ned, before.vel_ned) / 1e-4 - [0, 0, G]
    return rotation_of(source.truth(round(time_us)).quat_wxyz).T @ accel


@pytest.mark.slow
def test_a_minute_of_eights_adds_up_to_the_truth() -> None:
    source = make_source(EIGHT)
    *_, (now_us, pos, vel, quat) = dead_reckon(source, 60_000_000)
    truth = source.truth(now_us)
    assert np.linalg.norm(truth.vel_ned) > 1
    assert np.linalg.norm(pos - truth.pos_ned) < 0.01
    assert np.linalg.norm(vel - truth.vel_ned) < 1e-4
    assert np.linalg.norm(rotation_between(quat, truth.quat_wxyz)) < 1e-4


@pytest.mark.slow
@settings(max_examples=8)
@given(ATTITUDES, LEGS)
def test_any_shape_adds_up_to_the_truth(attitude: str, leg: str) -> None:
    source = make_source(script_of(attitude, leg))
    *_, (now_us, pos, vel, quat) = dead_reckon(source, 4_000_000)
    truth = source.truth(now_us)
    assert pos == pytest.approx(truth.pos_ned, abs=1e-4)
    assert vel == pytest.approx(truth.vel_ned, abs=1e-5)
    assert rotation_between(quat, truth.quat_wxyz) == pytest.approx((0, 0, 0), abs=1e-6)


@settings(max_examples=40)
@given(ATTITUDES, SMOOTH_LEGS, MOMENTS_S)
def test_velocity_is_the_integral_of_the_force_felt(attitude: str, leg: str, time_s: float) -> None:
    source = make_source(script_of(attitude, leg))
    now_us = START_US + round(1e6 * time_s)
    sense(source, now_us - LOOP_US)
    delta = sense(source, now_us).delta
    begin, middle, end = (felt_force(source, now_us - part * LOOP_US) for part in (1.0, 0.5, 0.0))
    by_simpson = (begin + 4 * middle + end) * (1e-6 * LOOP_US / 6)
    assert delta.del_vel == pytest.approx(by_simpson, abs=2e-6)


@settings(max_examples=40)
@given(ATTITUDES, SMOOTH_LEGS, MOMENTS_S)
def test_rotation_is_that_of_the_true_rates(attitude: str, leg: str, time_s: float) -> None:
    source = make_source(script_of(attitude, leg))
    now_us = START_US + round(1e6 * time_s)
    sense(source, now_us - LOOP_US)
    angles = sense(source, now_us).delta.del_ang
    middle_us, half_us = now_us - LOOP_US // 2, 500
    before, after = (source.truth(middle_us + step_us).quat_wxyz for step_us in (-half_us, half_us))
    turn = rotation_between(before, after)
    assert angles == pytest.approx(np.array(turn) * LOOP_US / (2 * half_us), abs=2e-5)


@settings(max_examples=40)
@given(SMOOTH_LEGS, MOMENTS_S)
def test_multirotor_feels_its_thrust_alone(leg: str, time_s: float) -> None:
    source = make_source(script_of("multirotor", leg))
    now_us = START_US + round(1e6 * time_s)
    sense(source, now_us - LOOP_US)
    ahead, right, down = sense(source, now_us).delta.del_vel / (1e-6 * LOOP_US)
    assert (ahead, right) == pytest.approx((0, 0), abs=1e-3)
    assert down < 0


def test_vehicle_rests_until_the_script_starts() -> None:
    source = make_source(EIGHT, heading_rad=0.5)
    for now_us in range(LOOP_US, START_US + 1, LOOP_US):
        delta = sense(source, now_us).delta
        assert delta.del_vel == pytest.approx([0, 0, -G * 0.0025], abs=1e-9)
        assert delta.del_ang.tolist() == [0, 0, 0]
    assert source.truth(START_US).vel_ned == (0, 0, 0)
    assert np.linalg.norm(source.truth(START_US + 100_000).vel_ned) > 0


def test_script_that_waits_for_arming_starts_after_its_delay() -> None:
    source = make_source(ARMED)
    sense(source, 10_000_000)
    assert source.truth(10_000_000_000).pos_ned == (0, 0, 0)
    source.set_armed(True)
    sense(source, 20_000_000)
    assert source.truth(22_000_000).pos_ned == (0, 0, 0)
    assert source.truth(24_000_000).pos_ned == pytest.approx((2, 0, -1))
    source.set_armed(False)
    sense(source, 21_000_000)
    source.set_armed(True)
    sense(source, 21_002_500)
    assert source.truth(24_000_000).pos_ned == pytest.approx((2, 0, -1))


def test_arming_does_not_start_a_script_that_knows_its_time() -> None:
    source = make_source(EIGHT.replace("start = 1", "start = 5"))
    source.set_armed(True)
    sense(source, LOOP_US)
    assert source.truth(5_000_000).pos_ned == (0, 0, 0)
    assert source.truth(6_000_000).pos_ned != (0, 0, 0)


def test_pass_gets_all_that_happened_since_the_last_one() -> None:
    fine, coarse = make_source(ARMED), make_source(ARMED)
    for source in (fine, coarse):
        source.set_armed(True)
        sense(source, LOOP_US)
        sense(source, 2_400_000)
    angles = sum(sense(fine, now_us).delta.del_ang for now_us in range(2_402_500, 2_500_001, LOOP_US))
    delta = sense(coarse, 2_500_000).delta
    assert delta.del_vel_dt == delta.del_ang_dt == float(np.float32(0.1))
    assert delta.del_ang == pytest.approx(angles, abs=1e-7)
    assert abs(delta.del_ang[1]) > 0.01


def test_time_that_has_been_brings_nothing_new() -> None:
    source = make_source(EIGHT)
    sense(source, 3_000_000)
    assert source.sense(3_000_000) is None
    assert source.sense(2_999_999) is None
    assert sense(source, 3_002_500).delta.del_vel_dt == pytest.approx(0.0025)


def test_barometer_reads_the_height_when_it_was_read() -> None:
    source = make_source(ARMED)
    source.set_armed(True)
    sense(source, LOOP_US)
    seen = {sense(source, now_us).baro for now_us in range(2 * LOOP_US, 8_000_000, LOOP_US)} - {None}
    assert len(seen) == 80
    for baro in seen:
        assert baro is not None
        assert baro[1] == pytest.approx(-source.truth(1000 * baro[0]).pos_ned[2], abs=1e-6)


@settings(max_examples=40)
@given(LEGS, st.floats(0.0, 6.0))
def test_compass_tells_the_true_yaw(leg: str, time_s: float) -> None:
    source = make_source(script_of("multirotor", leg), has_compass=lambda: True)
    sensors = sense(source, START_US + round(1e6 * time_s))
    assert sensors.mag is not None
    assert sensors.declination == 0
    truth = source.truth(sensors.mag[0])
    north, east, down = rotation_of(truth.quat_wxyz) @ sensors.mag[1]
    assert (north, east, down) == pytest.approx((238.08746, 0, -528.91174), abs=1e-3)


def test_vehicle_without_a_compass_has_no_field() -> None:
    assert sense(make_source(EIGHT), START_US).mag is None


def test_heading_is_told_within_half_a_turn() -> None:
    source = make_source(EIGHT.replace("start = 1", "start = 1\nheading_deg = 350"))
    sense(source, LOOP_US)
    assert source.yaw_rad() == pytest.approx(math.radians(-10))
    sense(source, 5_000_000)
    w, x, y, z = source.truth(5_000_000).quat_wxyz
    assert source.yaw_rad() == pytest.approx(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def test_sensors_are_exact_in_single_precision() -> None:
    source = make_source(EIGHT, has_compass=lambda: True)
    sensors = sense(source, 5_000_000)
    assert sensors.baro is not None
    assert sensors.mag is not None
    delta = sensors.delta
    numbers = np.array([*delta.del_vel, *delta.del_ang, delta.del_vel_dt, delta.del_ang_dt, *sensors.mag[1]])
    assert np.array_equal(numbers, numbers.astype(np.float32))
    assert sensors.baro[1] == np.float32(sensors.baro[1])


def test_errors_are_those_of_the_options() -> None:
    ideal, biased, noisy, again = (
        make_source(EIGHT, errors=errors, seed=5)
        for errors in (
            SensorErrors(),
            SensorErrors(gyro_bias_deg_s=(1.0, 0.0, 0.0)),
            *[SensorErrors(gyro_noise_deg_s_rthz=1.0)] * 2,
        )
    )
    angles = [sense(source, 3_000_000).delta.del_ang for source in (ideal, biased, noisy, again)]
    assert (angles[1] - angles[0]) / 0.0025 == pytest.approx([math.radians(1), 0, 0], abs=1e-6)
    assert angles[2].tolist() == angles[3].tolist() != angles[0].tolist()


def test_source_is_made_from_a_file_that_is_read_once(tmp_path: Path) -> None:
    path = tmp_path / "flight.toml"
    path.write_text(EIGHT)
    make = read_script_source(str(path))
    path.unlink()
    assert make(ImuOptions(heading_rad=0.25)).yaw_rad() == 0.25


def test_example_needs_no_file() -> None:
    assert read_script_source("figure_eight")(ImuOptions()).truth(0).pos_ned == (0, 0, 0)


def test_missing_script_is_an_error_that_names_the_examples(tmp_path: Path) -> None:
    path = tmp_path / "none.toml"
    with pytest.raises(InputError) as raised:
        read_script_source(str(path))
    examples = "examples that need no file are figure_eight, hand_held, square"
    assert str(raised.value) == f"{path}: No such file or directory; {examples}"


def test_unusable_script_is_an_error_before_the_vehicle_boots(tmp_path: Path) -> None:
    path = tmp_path / "flight.toml"
    path.write_text("start = 1\n")
    with pytest.raises(InputError) as raised:
        read_script_source(str(path))
    assert str(raised.value) == f"{path}: leg: missing"
