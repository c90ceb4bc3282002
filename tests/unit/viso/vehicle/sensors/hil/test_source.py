# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors that a simulator sends: what becomes of its messages, good and bad."""

import math
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import quat_of_euler, scaled
from mav_handlers.wire.messages import HIL_SENSOR, HIL_STATE_QUATERNION
from tests.unit.viso.vehicle.sensors.conftest import LOOP_US
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.hil import (
    UPDATED_ABS_PRESSURE,
    UPDATED_INERTIAL,
    UPDATED_MAG,
    UPDATED_PRESSURE_ALT,
    UPDATED_RESET,
    HilSource,
)
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.vectors import to_body

if TYPE_CHECKING:
    from tests.unit.viso.vehicle.sensors.conftest import MakeLoop

EPOCH_US = 1_700_000_000_000_000
REST = HIL_SENSOR(EPOCH_US, 0.0, 0.0, -GRAVITY_MSS, *(0.0,) * 3, *(0.2, 0.0, 0.5), 1013.25, 0.0, 0.0, 20.0, 0x1FFF)
STATE = HIL_STATE_QUATERNION(EPOCH_US, (1.0, 0.0, 0.0, 0.0), *(0.0,) * 3, 0, 0, 488_000, *(0,) * 8)

FLOATS = [field.name for field in fields(HIL_SENSOR)][1:14]


def after(message: Any, time_us: int, **changes: Any) -> Any:
    """Return a message of a later time of the simulator."""
    return replace(message, time_usec=EPOCH_US + time_us, **changes)


@pytest.fixture
def hil() -> HilSource:
    return HilSource(ImuOptions())


def begin(hil: HilSource, interval_us: int = 2500, count: int = 20) -> int:
    """Send messages at rest and read them; return the time of the last."""
    for number in range(count):
        hil.take_hil_sensor(after(REST, number * interval_us), number * interval_us)
    hil.sense(count * interval_us)
    return (count - 1) * interval_us


class TestInertialData:
    """Specific force and rates of HIL_SENSOR."""

    def test_they_are_multiplied_by_the_time_since_the_message_before(self, hil: HilSource) -> None:
        last_us = begin(hil)
        hil.take_hil_sensor(after(REST, last_us + 4000, xacc=2.0, zgyro=0.5), last_us + 4000)
        sensors = hil.sense(last_us + 4000)
        assert sensors is not None
        assert sensors.delta.del_vel == pytest.approx([0.008, 0.0, -GRAVITY_MSS * 0.004], rel=1e-6)
        assert sensors.delta.del_ang == pytest.approx([0.0, 0.0, 0.002], rel=1e-6)
        assert sensors.delta.del_vel_dt == sensors.delta.del_ang_dt == float(np.float32(0.004))

    def test_first_message_only_begins_the_time(self, hil: HilSource) -> None:
        hil.take_hil_sensor(REST, 0)
        assert hil.sense(2500) is None

    def test_there_is_nothing_without_a_new_message(self, hil: HilSource) -> None:
        last_us = begin(hil)
        assert hil.sense(last_us + 2500) is None
        assert hil.sense(last_us + 200_000) is None
        hil.take_hil_sensor(after(REST, last_us + 2500), last_us + 300_000)
        assert hil.sense(last_us + 300_000) is not None

    def test_several_messages_between_two_passes_add_up(self, hil: HilSource) -> None:
        last_us = begin(hil)
        for number in (1, 2, 3):
            hil.take_hil_sensor(after(REST, last_us + 2500 * number, xacc=float(number)), last_us)
        sensors = hil.sense(last_us + 7500)
        assert sensors is not None
        assert sensors.delta.del_vel[0] == pytest.approx(6.0 * 0.0025, rel=1e-6)
        assert sensors.delta.del_vel_dt == pytest.approx(0.0075, rel=1e-6)

    @pytest.mark.parametrize(("interval_us", "used_us"), [(1, 625), (1000, 1000), (9000, 9000), (80_000, 10_000)])
    def test_intervals_are_limited_to_a_quarter_and_four_times_the_usual(
        self, hil: HilSource, interval_us: int, used_us: int
    ) -> None:
        last_us = begin(hil, count=200)
        hil.take_hil_sensor(after(REST, last_us + interval_us), last_us)
        sensors = hil.sense(last_us)
        assert sensors is not None
        assert 1e6 * sensors.delta.del_vel_dt == pytest.approx(used_us, rel=0.05)

    @pytest.mark.parametrize("interval_us", [2500, 4000, 20_000])
    def test_usual_is_what_the_simulator_sends(self, hil: HilSource, interval_us: int) -> None:
        last_us = begin(hil, interval_us)
        hil.take_hil_sensor(after(REST, last_us + interval_us), last_us)
        sensors = hil.sense(last_us)
        assert sensors is not None
        assert 1e6 * sensors.delta.del_vel_dt == pytest.approx(interval_us)

    def test_what_nobody_asks_for_does_not_pile_up(self, hil: HilSource) -> None:
        begin(hil, count=1)
        for number in range(1, 1000):
            hil.take_hil_sensor(after(REST, 2500 * number), 2500 * number)
        sensors = hil.sense(2_500_000)
        assert sensors is not None
        assert 0.0 < sensors.delta.del_vel_dt <= 0.1
        assert hil.ignored["not_asked_for"] > 0

    def test_sensors_err_as_they_are_told_to(self) -> None:
        hil = HilSource(ImuOptions(errors=SensorErrors(accel_bias_m_s2=(1.0, 0.0, 0.0))))
        last_us = begin(hil)
        hil.take_hil_sensor(after(REST, last_us + 2500), last_us)
        sensors = hil.sense(last_us)
        assert sensors is not None
        assert sensors.delta.del_vel[0] == pytest.approx(0.0025, rel=1e-5)


class TestRefusal:
    """Messages that are of no use, with the reason."""

    @pytest.mark.parametrize(
        ("message", "reason"),
        [
            (after(REST, 47_500), "repeated"),
            (after(REST, 45_000), "late"),
            (after(REST, 50_000, id=1), "other_sensor"),
            (after(REST, 50_000, xacc=math.nan), "absurd_inertial_data"),
            (after(REST, 50_000, zacc=-1e30), "absurd_inertial_data"),
            (after(REST, 50_000, ygyro=math.inf), "absurd_inertial_data"),
        ],
    )
    def test_reason_is_counted_and_nothing_else_happens(self, hil: HilSource, message: HIL_SENSOR, reason: str) -> None:
        begin(hil)
        hil.take_hil_sensor(message, 50_000)
        assert hil.sense(50_000) is None
        assert hil.ignored == {reason: 1}

    def test_time_that_goes_back_far_begins_anew(self, hil: HilSource) -> None:
        begin(hil)
        for time_us in (-5_000_000, -4_997_500):
            hil.take_hil_sensor(after(REST, time_us), 50_000)
        sensors = hil.sense(50_000)
        assert sensors is not None
        assert sensors.delta.del_vel_dt == pytest.approx(0.0025)
        assert not hil.ignored

    def test_reset_of_the_simulator_begins_time_anew(self, hil: HilSource) -> None:
        begin(hil)
        hil.take_hil_sensor(after(REST, 1000, fields_updated=0x1FFF | UPDATED_RESET), 50_000)
        assert hil.sense(50_000) is None
        hil.take_hil_sensor(after(REST, 3500), 52_500)
        assert hil.sense(52_500) is not None

    def test_lost_sample_is_made_up_for_by_the_next(self, hil: HilSource) -> None:
        last_us = begin(hil)
        hil.take_hil_sensor(after(REST, last_us + 2500, xgyro=math.nan), last_us)
        hil.take_hil_sensor(after(REST, last_us + 5000), last_us)
        sensors = hil.sense(last_us)
        assert sensors is not None
        assert sensors.delta.del_vel_dt == pytest.approx(0.005)

    @pytest.mark.slow
    @settings(max_examples=100)
    @given(
        values=st.tuples(*[st.floats(width=32)] * 13),
        time_us=st.integers(0, (1 << 64) - 1),
        updated=st.integers(0, (1 << 32) - 1),
    )
    def test_any_message_leaves_the_sensors_sane(self, values: tuple[float, ...], time_us: int, updated: int) -> None:
        hil = HilSource(ImuOptions(has_compass=lambda: True))
        changes: dict[str, Any] = dict(zip(FLOATS, values, strict=True))
        message = after(REST, time_us - EPOCH_US, fields_updated=updated, **changes)
        for sent in (REST, message, replace(message, time_usec=(time_us + 2500) % (1 << 64))):
            hil.take_hil_sensor(sent, 0)
            sensors = hil.sense(100_000)
            if sensors is not None:
                assert np.abs([*sensors.delta.del_vel, *sensors.delta.del_ang]).max() < 200.0
                assert 0.0 < sensors.delta.del_vel_dt < 1.0
            assert math.isfinite(hil.yaw_rad())

    @pytest.mark.slow
    @settings(max_examples=100)
    @given(
        quat=st.tuples(*[st.floats(width=32)] * 4),
        whole=st.tuples(*[st.integers(-32768, 32767)] * 3),
        time_us=st.integers(0, (1 << 64) - 1),
        alt=st.integers(-(1 << 31), (1 << 31) - 1),
    )
    def test_any_state_leaves_the_sensors_sane(
        self, quat: tuple[float, ...], whole: tuple[int, ...], time_us: int, alt: int
    ) -> None:
        hil = HilSource(ImuOptions())
        message = replace(
            STATE, time_usec=time_us, attitude_quaternion=quat, alt=alt, vx=whole[0], vy=whole[1], vz=whole[2]
        )
        for state in (STATE, after(STATE, 2500), message, replace(message, time_usec=(time_us + 2500) % (1 << 64))):
            hil.take_hil_state(state, 0)
            sensors = hil.sense(100_000)
            if sensors is not None:
                assert np.abs(sensors.delta.del_vel).max() < 400.0 * sensors.delta.del_vel_dt
            assert math.isfinite(hil.yaw_rad())


def fly_up(hil: HilSource, until_us: int, **changes: Any) -> tuple[int, float] | None:
    """Send for 1.2 s from rest, then with changes; return the last reading of the barometer."""
    baro = None
    for time_us in range(0, until_us, 4000):
        hil.take_hil_sensor(after(REST, time_us, **(changes if time_us > 1_200_000 else {})), time_us)
        sensors = hil.sense(time_us)
        baro = sensors.baro if sensors is not None else baro
    return baro


class TestReadings:
    """Barometer and compass of HIL_SENSOR."""

    def test_height_counts_from_the_average_of_the_first_second(self, hil: HilSource) -> None:
        rng = np.random.default_rng(4)
        for time_us in range(0, 1_500_000, 4000):
            altitude = 488.0 + float(np.float32(0.1 * rng.standard_normal())) + (10.0 if time_us > 1_200_000 else 0.0)
            hil.take_hil_sensor(after(REST, time_us, pressure_alt=altitude), time_us)
            sensors = hil.sense(time_us)
            assert sensors is None or time_us > 1_000_000 or sensors.baro is None
        assert sensors is not None
        assert sensors.baro is not None
        assert sensors.baro[0] == 1450
        assert sensors.baro[1] == pytest.approx(10.0, abs=0.4)

    def test_marked_altitude_is_preferred(self, hil: HilSource) -> None:
        baro = fly_up(hil, 1_500_000, pressure_alt=5.0, abs_pressure=900.0)
        assert baro == (1450, 5.0)

    def test_pressure_is_turned_into_height_by_the_standard_atmosphere(self, hil: HilSource) -> None:
        updated = UPDATED_INERTIAL | UPDATED_ABS_PRESSURE
        ground = replace(REST, fields_updated=updated)
        for time_us in range(0, 1_500_000, 4000):
            pressure = 1013.25 if time_us < 1_200_000 else 898.746  # of 1000 m
            hil.take_hil_sensor(after(ground, time_us, abs_pressure=pressure), time_us)
            sensors = hil.sense(time_us)
        assert sensors is not None
        assert sensors.baro is not None
        assert sensors.baro[1] == pytest.approx(1000.0, abs=0.5)

    @pytest.mark.parametrize("pressure", [math.nan, 0.0, -5.0, 5000.0])
    def test_absurd_pressure_is_ignored(self, hil: HilSource, pressure: float) -> None:
        fly_up(hil, 1_500_000, abs_pressure=pressure, fields_updated=UPDATED_INERTIAL | UPDATED_ABS_PRESSURE)
        assert set(hil.ignored) == {"absurd_pressure"}

    def test_barometer_that_falls_silent_is_not_read_again(self, hil: HilSource) -> None:
        baro = fly_up(hil, 3_000_000, fields_updated=UPDATED_INERTIAL | UPDATED_MAG)
        assert baro == (1250, 0.0)

    def test_pressure_altitude_that_is_not_marked_is_not_used(self, hil: HilSource) -> None:
        assert not REST.fields_updated & ~0x1FFF & UPDATED_PRESSURE_ALT
        baro = fly_up(hil, 1_500_000, pressure_alt=50.0, fields_updated=0x1FFF & ~UPDATED_PRESSURE_ALT)
        assert baro is not None
        assert baro[1] == pytest.approx(0.0, abs=0.01)

    def test_field_of_gauss_becomes_milligauss(self) -> None:
        hil = HilSource(ImuOptions(has_compass=lambda: True))
        begin(hil, count=100)
        hil.take_hil_sensor(after(REST, 300_000), 300_000)
        sensors = hil.sense(300_000)
        assert sensors is not None
        assert sensors.mag is not None
        assert sensors.mag[0] == 250_000
        assert sensors.mag[1] == pytest.approx([200.0, 0.0, 500.0])

    @pytest.mark.parametrize("gauss", [math.nan, 11.0])
    def test_absurd_field_is_ignored(self, gauss: float) -> None:
        hil = HilSource(ImuOptions(has_compass=lambda: True))
        hil.take_hil_sensor(after(REST, 0, ymag=gauss), 0)
        assert hil.ignored == {"absurd_field": 1}

    def test_compass_that_says_nothing_is_not_read(self) -> None:
        hil = HilSource(ImuOptions(has_compass=lambda: True))
        for time_us in (0, 60_000):
            hil.take_hil_sensor(after(REST, time_us, fields_updated=UPDATED_INERTIAL), time_us)
        sensors = hil.sense(60_000)
        assert sensors is not None
        assert sensors.mag is None

    def test_there_is_no_compass_unless_it_is_in_use(self, hil: HilSource) -> None:
        last_us = begin(hil, count=100)
        hil.take_hil_sensor(after(REST, last_us + 2500), last_us)
        sensors = hil.sense(last_us)
        assert sensors is not None
        assert sensors.mag is None


class TestHeading:
    """What a simple estimate starts from."""

    def test_it_is_that_of_the_options_while_nothing_is_known(self) -> None:
        assert HilSource(ImuOptions(heading_rad=0.7)).yaw_rad() == 0.7

    @pytest.mark.parametrize("rpy_deg", [(0.0, 0.0, 50.0), (10.0, -20.0, -120.0)])
    def test_it_is_what_the_compass_shows(self, rpy_deg: tuple[float, float, float]) -> None:
        hil = HilSource(ImuOptions(has_compass=lambda: True))
        roll, pitch, yaw = map(math.radians, rpy_deg)
        quat = quat_of_euler(roll, pitch, yaw)
        force = dict(zip(("xacc", "yacc", "zacc"), to_body(quat, (0.0, 0.0, -GRAVITY_MSS)), strict=True))
        field = dict(zip(("xmag", "ymag", "zmag"), scaled(to_body(quat, (238.0, 0.0, -529.0)), 1e-3), strict=True))
        for time_us in (0, 60_000):
            hil.take_hil_sensor(after(REST, time_us, **force, **field), time_us)
            hil.sense(60_000)
        assert hil.yaw_rad() == pytest.approx(yaw, abs=1e-6)

    def test_it_is_that_of_the_simulated_vehicle(self, hil: HilSource) -> None:
        quat = quat_of_euler(0.1, 0.2, 2.0)
        hil.take_hil_state(replace(STATE, attitude_quaternion=quat), 0)
        assert hil.yaw_rad() == pytest.approx(2.0)


class TestState:
    """HIL_STATE_QUATERNION, from which the sensors are made."""

    def test_at_rest_only_gravity_is_felt(self, hil: HilSource) -> None:
        quat = quat_of_euler(0.3, -0.2, 1.0)
        for time_us in (0, 4000):
            state = after(STATE, time_us, attitude_quaternion=quat)
            hil.take_hil_state(state, time_us)
        sensors = hil.sense(4000)
        assert sensors is not None
        assert sensors.delta.del_vel == pytest.approx(to_body(quat, (0.0, 0.0, -GRAVITY_MSS * 0.004)), rel=1e-6)
        assert sensors.delta.del_ang == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)

    def test_change_of_velocity_and_attitude_is_felt(self, hil: HilSource) -> None:
        quat = quat_of_euler(0.0, 0.0, 0.01)
        hil.take_hil_state(STATE, 0)
        state = after(STATE, 10_000, attitude_quaternion=quat, vx=2, vz=-5)
        hil.take_hil_state(state, 10_000)
        sensors = hil.sense(10_000)
        assert sensors is not None
        assert sensors.delta.del_ang == pytest.approx([0.0, 0.0, 0.01], rel=1e-5)
        assert sensors.delta.del_vel == pytest.approx([0.02, -0.0001, -0.05 - GRAVITY_MSS * 0.01], rel=1e-3)

    def test_height_counts_from_the_first_second(self, hil: HilSource) -> None:
        for time_us in range(0, 1_500_000, 4000):
            hil.take_hil_state(after(STATE, time_us, alt=488_000 if time_us < 1_200_000 else 491_500), time_us)
            sensors = hil.sense(time_us)
        assert sensors is not None
        assert sensors.baro == (1450, 3.5)

    def test_sensors_themselves_are_preferred(self, hil: HilSource) -> None:
        last_us = begin(hil)
        for number in (1, 2, 3):
            hil.take_hil_state(after(STATE, 2500 * number), last_us + 2500)
        assert hil.sense(last_us + 2500) is None
        assert hil.ignored["state_beside_sensor"] == 3

    def test_it_steps_in_when_the_sensors_have_stopped(self, hil: HilSource) -> None:
        last_us = begin(hil)
        for number in (1, 2, 3):
            hil.take_hil_state(after(STATE, 2500 * number), last_us + 1_000_000)
        sensors = hil.sense(last_us + 1_000_000)
        assert sensors is not None
        assert sensors.delta.del_vel_dt == pytest.approx(0.005)

    @pytest.mark.parametrize(
        ("state", "reason"),
        [
            (STATE, "repeated"),
            (after(STATE, 0 - 500), "late"),
            (after(STATE, 200_000), "after_gap"),
            (after(STATE, 2500, attitude_quaternion=(math.nan, 0.0, 0.0, 0.0)), "absurd_attitude"),
            (after(STATE, 2500, attitude_quaternion=(0.0, 0.0, 0.0, 0.0)), "absurd_attitude"),
            (after(STATE, 2500, attitude_quaternion=(0.0, 0.0, 0.0, 1.0)), "absurd_inertial_data"),
            (after(STATE, 2500, vx=30_000), "absurd_inertial_data"),
        ],
    )
    def test_what_cannot_be_used_is_counted(self, hil: HilSource, state: HIL_STATE_QUATERNION, reason: str) -> None:
        hil.take_hil_state(STATE, 0)
        hil.take_hil_state(state, 2500)
        assert hil.sense(2500) is None
        assert hil.ignored == {reason: 1}


def test_arming_does_not_touch_it(hil: HilSource) -> None:
    hil.set_armed(True)
    assert hil.sense(2500) is None


def simulate(t: float) -> tuple[float, float]:
    """Return velocity and acceleration north of a vehicle that swings back and forth from 6 s on."""
    since = max(0.0, t - 6.0)
    envelope, growth = (1.0 - math.exp(-since)) ** 2, 2.0 * (1.0 - math.exp(-since)) * math.exp(-since)
    return envelope * math.sin(since), envelope * math.cos(since) + growth * math.sin(since)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("by_state", "end_us"),
    [
        (False, 10_000_000),
        pytest.param(True, 10_000_000, marks=pytest.mark.slow),
        pytest.param(False, 20_000_000, marks=pytest.mark.slow),
        pytest.param(True, 20_000_000, marks=pytest.mark.slow),
    ],
)
def test_filter_follows_a_simulator(make_loop: "MakeLoop", hil: HilSource, by_state: bool, end_us: int) -> None:
    loop = make_loop(hil)
    north, worst = 0.0, 0.0
    passes = 0
    while loop.now_us < end_us:
        time_us = loop.now_us + LOOP_US
        speed, accel = simulate(1e-6 * time_us - 0.00125)
        north += 1e-6 * LOOP_US * speed
        if by_state:
            hil.take_hil_state(after(STATE, time_us, vx=round(100.0 * simulate(1e-6 * time_us)[0])), time_us)
        else:
            hil.take_hil_sensor(after(REST, time_us, xacc=accel), time_us)
        passes += loop.run_pass()
        if time_us % 32_500 == 0:
            loop.tell_pose((north, 0.0, 0.0), delay_ms=0)
        if time_us > 7_000_000:
            worst = max(worst, abs(loop.core.position()[0] - north))
    assert passes == end_us // LOOP_US - 1
    assert loop.is_aided()
    assert worst < 0.05
    assert not hil.ignored


@pytest.mark.slow
def test_filter_rests_while_the_simulator_is_silent(make_loop: "MakeLoop", hil: HilSource) -> None:
    loop = make_loop(hil)
    for time_us in (*range(0, 8_000_000, LOOP_US), *range(9_000_000, 12_000_000, LOOP_US)):
        loop.now_us = time_us
        hil.take_hil_sensor(after(REST, time_us), time_us)
        loop.run_pass()
    assert not loop.run_pass()
    assert np.abs(loop.report().vel_ned).max() < 0.05
