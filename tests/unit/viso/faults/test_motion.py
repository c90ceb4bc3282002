# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of position, velocity and attitude."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.core.vectors import euler_of, quat_of_euler, rotated
from tests.unit.viso.faults.rig import (
    BEAT,
    EAST,
    after,
    after_one,
    delta,
    distance,
    encoded,
    every_kind,
    flow,
    mocap,
    odometry,
    passed_over,
    position,
    speed,
)
from viso.geometry.rotation import rotation_from_quat_wxyz

ANGLES = st.floats(-3.1, 3.1)


def place(message: Any) -> tuple[float, float, float]:
    return message.x, message.y, message.z


def body_velocity(message: Any) -> tuple[float, float, float]:
    return message.vx, message.vy, message.vz


@given(roll=ANGLES, pitch=st.floats(-1.5, 1.5), yaw=ANGLES)
def test_angles_and_quaternion_agree_with_matrices(roll: float, pitch: float, yaw: float) -> None:
    quat = quat_of_euler(roll, pitch, yaw)
    assert euler_of(quat) == pytest.approx((roll, pitch, yaw), abs=1e-6)
    vector = (1.0, -2.0, 3.0)
    assert rotated(quat, vector) == pytest.approx(rotation_from_quat_wxyz(quat).dot(np.array(vector)))


def test_glit_moves_every_position() -> None:
    heard = after("kind: glit, x_m: 8, z_m: -1", odometry(), position(), mocap())
    assert [place(message) for message in heard] == [(9.0, 2.0, -5.0)] * 3
    assert heard[0] == odometry(x=9.0, z=-5.0)


def test_vgli_is_in_the_local_frame() -> None:
    assert place(after_one("kind: vgli, y_m_s: 4", speed())) == (1.0, 4.0, 0.0)
    heard = after_one("kind: vgli, y_m_s: 4", odometry(q=EAST))
    assert body_velocity(heard) == pytest.approx((5.0, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("kind", ["p_sd", "v_sd"])
def test_noise_has_the_spread_that_it_should(kind: str) -> None:
    name = "sd_m" if kind == "p_sd" else "sd_m_s"
    clean: Any = odometry() if kind == "p_sd" else speed()
    heard = after(f"kind: {kind}, {name}: 0.5", *[clean] * 500)
    errors = np.array([place(message) for message in heard]) - place(clean)
    assert errors.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.1)
    assert errors.std(axis=0) == pytest.approx([0.5] * 3, abs=0.06)


def test_camera_at_another_place_moves_with_the_attitude() -> None:
    heard = after_one("kind: pos, x_m: 2, z_m: 1", odometry(q=EAST, yawspeed=0.5))
    assert place(heard) == pytest.approx((1.0, 4.0, -3.0), abs=1e-6)
    assert body_velocity(heard) == pytest.approx((1.0, 1.0, 0.0))


def test_camera_at_another_place_says_nothing_of_velocity_while_rates_are_unknown() -> None:
    heard = after_one("kind: pos, x_m: 2", odometry(yawspeed=math.nan))
    assert body_velocity(heard) == (1.0, 0.0, 0.0)
    assert place(heard) == (3.0, 2.0, -4.0)


def test_yaw_turns_the_local_frame() -> None:
    pose, velocity, odom = after("kind: yaw, yaw_deg: 90", position(), speed(), odometry())
    assert place(pose) == pytest.approx((2.0, -1.0, -4.0), abs=1e-6)
    assert pose.yaw == pytest.approx(-math.pi / 2)
    assert place(velocity) == pytest.approx((0.0, -1.0, 0.0), abs=1e-6)
    assert body_velocity(odom) == (1.0, 0.0, 0.0)
    assert euler_of(odom.q) == pytest.approx((0, 0, -math.pi / 2))


def test_yawerr_turns_the_attitude_alone() -> None:
    pose, odom, mocapped = after("kind: yawerr, yaw_deg: 90", position(yaw=3.0), odometry(), mocap())
    assert pose.yaw == pytest.approx(3.0 + math.pi / 2 - math.tau)
    assert place(pose) == place(odom) == (1.0, 2.0, -4.0)
    assert odom.q == mocapped.q == pytest.approx(EAST)


def test_drift_grows_with_time() -> None:
    heard = after("kind: drift, y_m_s: 10, yaw_deg_s: 90, start_s: 0.1", *[position()] * 4)
    assert [message.y for message in heard] == pytest.approx([2.0, 2.0, 3.0, 4.0])
    assert [math.degrees(message.yaw) for message in heard] == pytest.approx([0, 0, 9, 18], abs=1e-4)


def test_scale_is_of_positions_velocities_and_changes() -> None:
    odom, pose, velocity, change = after("kind: scale, factor: 1000", odometry(), position(), speed(), delta())
    assert place(odom) == place(pose) == (1000.0, 2000.0, -4000.0)
    assert body_velocity(odom) == place(velocity) == (1000.0, 0.0, 0.0)
    assert change.position_delta == (1000.0, 2000.0, 4000.0)


def test_scale_is_of_flow_and_distances() -> None:
    seen, down = after("kind: scale, factor: 1.5, messages: [OPTICAL_FLOW, DISTANCE_SENSOR]", flow(), distance())
    assert (seen.flow_x, seen.flow_y, seen.flow_comp_m_x, seen.flow_rate_y) == (6, -3, 0.75, -0.75)
    assert down == distance(current_distance=225)


def test_frozen_distances_are_stamped_anew() -> None:
    told = [distance(time_boot_ms=5000 + number, current_distance=150 + number) for number in range(2)]
    assert after("kind: frozen, messages: DISTANCE_SENSOR", *told) == [told[0], distance(time_boot_ms=5001)]


def test_each_sensor_is_frozen_by_itself() -> None:
    finders = [distance(current_distance=cm, id=index, orientation=where) for cm, index, where in (
        (100, 0, 25), (500, 1, 25), (300, 0, 0), (101, 0, 25), (501, 1, 25), (301, 0, 0),
    )]  # fmt: skip
    assert after("kind: frozen, messages: DISTANCE_SENSOR", *finders) == 2 * finders[:3]
    flows = [flow(sensor_id=index, flow_x=x) for index, x in ((0, 4), (1, 8), (0, 5), (1, 9))]
    assert after("kind: frozen, messages: OPTICAL_FLOW", *flows) == 2 * flows[:2]


def test_frozen_repeats_the_first_of_its_window_with_stamps_that_go_on() -> None:
    told = [odometry(number, x=float(number)) for number in range(4)]
    heard = after("kind: frozen, start_s: 0.1, end_s: 0.3", *told)
    assert heard == [told[0], told[1], odometry(2, x=1.0), told[3]]


def test_reset_jumps_and_counts_from_then_on() -> None:
    heard = after("kind: reset, x_m: 3, yaw_deg: 90, count: 2, at_s: 0.1", *[odometry(reset_counter=255)] * 3)
    assert [message.reset_counter for message in heard] == [255, 1, 1]
    assert place(heard[1]) == pytest.approx((1.0, 1.0, -4.0), abs=1e-6)
    assert heard[1].q == pytest.approx(EAST)


def test_secret_reset_does_not_count_and_counter_may_change_without_a_jump() -> None:
    assert after_one("kind: reset, x_m: 3, count: 0", odometry()) == odometry(x=4.0)
    assert after_one("kind: reset", speed()) == speed(reset_counter=1)
    assert after_one("kind: reset, x_m: 1", mocap()) == mocap(x=2.0)


def test_degrees_are_of_angles_and_their_changes() -> None:
    pose, change = after("kind: degrees", position(roll=1.0, yaw=-2.0), delta())
    assert (pose.roll, pose.pitch, pose.yaw) == pytest.approx((57.29578, 0.0, -114.59156))
    assert change.angle_delta == pytest.approx((14.323945, 0.0, -28.64789))


def test_quaternion_in_another_order_or_length() -> None:
    q = (0.5, 0.25, 0.125, -0.75)
    assert after_one("kind: quat_xyzw", odometry(q=q)).q == (0.25, 0.125, -0.75, 0.5)
    assert after_one("kind: quat_norm, norm: 2", mocap(q=q)).q == (1.0, 0.5, 0.25, -1.5)


CHANGES_NOTHING = {
    "glit": (speed(), delta()),
    "vgli": (position(), delta(), mocap()),
    "pos": (speed(), delta()),
    "yaw": (delta(),),
    "yawerr": (speed(), delta()),
    "drift": (speed(), delta()),
    "reset": (delta(),),
    "degrees": (odometry(), speed(), mocap()),
    "quat_xyzw": (position(), speed(), delta()),
    "scale": (),
    "frozen": (),
}


@pytest.mark.parametrize("kind", CHANGES_NOTHING)
def test_message_with_nothing_to_change_is_passed_over(kind: str) -> None:
    for message in (*CHANGES_NOTHING[kind], BEAT):
        assert passed_over(f"kind: {kind}", encoded(message)[0]) == {"nothing in it to change": 1}


@pytest.mark.parametrize("kind", [
    "yawerr", "yaw", "axes, world_axes: ENU, body_axes: FLU", "pos, x_m: 1", "vgli, x_m_s: 1", "reset, yaw_deg: 3",
    "drift, yaw_deg_s: 5", "degrees", "scale"
])  # fmt: skip
@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_numbers_that_are_none_are_borne(kind: str, wrong: float) -> None:
    odom = odometry(x=wrong, q=(wrong,) * 4, vx=wrong, rollspeed=wrong)
    messages = (odom, position(x=wrong, roll=wrong, pitch=wrong, yaw=wrong), speed(x=wrong))
    assert len(after(f"kind: {kind}", *messages, *every_kind())) == 10
