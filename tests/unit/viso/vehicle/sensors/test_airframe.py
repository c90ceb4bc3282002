# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the point mass moves, and that its sensors feel just that."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given, settings
from hypothesis import strategies as st

from ekf_stub.core.inertial import GRAVITY_MSS
from viso.vehicle.sensors.airframe import MOTORS_OFF, AirframeState, Demand, moved
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions

PASS_US = 2500
HOVER = Demand(thrust_m_s2=GRAVITY_MSS)


def after(state: AirframeState, demand: Demand, seconds: float) -> AirframeState:
    for _ in range(round(seconds * 400)):
        state = moved(state, demand, 1e-6 * PASS_US)
    return state


def test_on_the_ground_with_its_motors_off_it_rests() -> None:
    assert after(AirframeState(), MOTORS_OFF, 1.0) == AirframeState()
    assert AirframeState().is_at_rest()


def test_thrust_that_is_its_weight_keeps_it_in_the_air() -> None:
    state = after(AirframeState(pos=(0.0, 0.0, -5.0), thrust_m_s2=GRAVITY_MSS), HOVER, 5.0)
    assert state.pos == pytest.approx((0.0, 0.0, -5.0), abs=1e-9)
    assert not state.is_at_rest()


def test_dropped_it_lands_on_its_legs_and_comes_to_rest() -> None:
    state = after(AirframeState(pos=(1.0, 2.0, -0.2), vel=(0.3, 0.0, 0.0)), MOTORS_OFF, 3.0)
    assert state.is_at_rest()
    assert state.pos[2] == 0.0
    assert state.pos[0] > 1.0


@pytest.mark.parametrize(
    ("lean", "yaw", "ahead"),
    [
        (Demand(pitch=-0.2, thrust_m_s2=GRAVITY_MSS), 0.0, (1, 0)),
        (Demand(pitch=-0.2, thrust_m_s2=GRAVITY_MSS), math.pi / 2, (0, 1)),
        (Demand(roll=0.2, thrust_m_s2=GRAVITY_MSS), 0.0, (0, 1)),
        (Demand(roll=0.2, thrust_m_s2=GRAVITY_MSS), math.pi / 2, (-1, 0)),
    ],
)
def test_it_goes_where_it_leans(lean: Demand, yaw: float, ahead: tuple[int, int]) -> None:
    state = AirframeState(pos=(0.0, 0.0, -50.0), rpy=(0.0, 0.0, yaw), thrust_m_s2=GRAVITY_MSS)
    state = after(state, lean, 2.0)
    along = state.vel[0] * ahead[0] + state.vel[1] * ahead[1]
    assert along == pytest.approx(GRAVITY_MSS * math.sin(0.2) * 1.9, rel=0.2)
    assert math.hypot(*state.vel[:2]) == pytest.approx(along)


def test_it_turns_at_the_rate_that_is_demanded() -> None:
    state = after(AirframeState(pos=(0.0, 0.0, -5.0)), HOVER._replace(turn_rad_s=0.5), 2.0)
    assert state.rpy[2] == pytest.approx(0.5 * 1.9, abs=0.01)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-0.4, 0.4)] * 2, st.floats(5.0, 15.0), st.floats(-1.0, 1.0)), max_size=4))
def test_what_inertial_sensors_say_adds_up_to_its_motion(demands: list[tuple[float, float, float, float]]) -> None:
    source = FlyingSource(ImuOptions())
    source.airframe.state = AirframeState(pos=(0.0, 0.0, -50.0), thrust_m_s2=GRAVITY_MSS)
    vel, quat = np.zeros(3), quaternion.quaternion(1.0, 0.0, 0.0, 0.0)
    for number in range(40 * len(demands)):
        source.airframe.demand(Demand(*demands[number // 40]))
        sensors = source.sense((number + 1) * PASS_US)
        assert sensors is not None
        turn = sensors.delta.del_ang
        half = quat * quaternion.quaternion(1.0, *(0.25 * turn)).normalized()
        felt = (half * quaternion.quaternion(0.0, *sensors.delta.del_vel) * half.conj()).vec
        vel += felt + np.array([0.0, 0.0, GRAVITY_MSS * sensors.delta.del_vel_dt])
        quat = (quat * quaternion.quaternion(1.0, *(0.5 * turn))).normalized()
    truth = source.airframe.truth()
    assert vel == pytest.approx(np.array(truth.vel_ned), abs=1e-3)
    assert abs(np.dot([quat.w, quat.x, quat.y, quat.z], truth.quat_wxyz)) == pytest.approx(1.0, abs=1e-5)


def test_what_is_said_beforehand_is_what_comes() -> None:
    told, single = FlyingSource(ImuOptions()), FlyingSource(ImuOptions())
    for source in (told, single):
        source.airframe.state = AirframeState(pos=(0.0, 0.0, -5.0), thrust_m_s2=GRAVITY_MSS)
        source.airframe.demand(Demand(0.1, -0.1, 9.0, 0.3))
        source.sense(1_000_000)
    times_us = range(1_000_000 + PASS_US, 1_000_000 + 11 * PASS_US, PASS_US)
    rows = told.ahead(times_us)
    told.pass_over(times_us[:4])
    rows_again = told.ahead(times_us[4:])
    for number, time_us in enumerate(times_us):
        sensors = single.sense(time_us)
        assert sensors is not None
        assert rows[number, :3] == pytest.approx(sensors.delta.del_vel, abs=0)
        if number >= 4:
            assert rows_again[number - 4] == pytest.approx(rows[number], abs=0)
    told.pass_over(times_us[4:])
    assert told.airframe.state == single.airframe.state
