# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes mixed up."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.faults.rig import (
    BEAT,
    after_one,
    delta,
    encoded,
    flow,
    mocap,
    odometry,
    passed_over,
    position,
    speed,
)
from viso.geometry.frame_change import axes_matrix
from viso.geometry.rotation import rotation_from_quat_wxyz

ENU_FLU = "kind: axes, world_axes: ENU, body_axes: FLU"
RIGHT_HANDED = ("NED", "ENU", "NWU", "FRD", "FLU", "RDF", "BLD", "DBL")
# z may be turned only with x and y: these are left-handed.
LEFT_HANDED = ("NEU", "END", "FLD", "RFD")


def test_enu_for_ned_and_flu_for_frd() -> None:
    heard = after_one(ENU_FLU, odometry(vx=1.0, vy=2.0, vz=4.0))
    assert (heard.x, heard.y, heard.z) == (2.0, 1.0, 4.0)
    assert (heard.vx, heard.vy, heard.vz) == (1.0, -2.0, -4.0)


def test_heading_north_is_a_yaw_of_90_degrees_in_enu() -> None:
    heard = after_one(ENU_FLU, position(yaw=0.0))
    assert (heard.roll, heard.pitch, heard.yaw) == pytest.approx((0, 0, math.pi / 2), abs=1e-6)


def test_velocity_of_its_own_message_is_in_the_world() -> None:
    heard = after_one(ENU_FLU, speed(x=1.0, y=2.0, z=4.0))
    assert (heard.x, heard.y, heard.z) == (2.0, 1.0, -4.0)


def test_changes_are_in_the_body() -> None:
    heard = after_one(ENU_FLU, delta())
    assert (heard.position_delta, heard.angle_delta) == ((1.0, -2.0, -4.0), (0.25, -0.0, 0.5))


def test_changes_of_position_alone_and_of_angle_alone() -> None:
    assert after_one(f"{ENU_FLU}, of: vectors", delta()) == delta(position_delta=(1.0, -2.0, -4.0))
    assert after_one(f"{ENU_FLU}, of: attitude", delta()) == delta(angle_delta=(0.25, -0.0, 0.5))


def test_message_without_a_pose_is_passed_over() -> None:
    assert passed_over(ENU_FLU, encoded(BEAT)[0]) == {"nothing in it to change": 1}


def test_vectors_alone_may_be_in_left_handed_axes() -> None:
    heard = after_one("kind: axes, world_axes: NEU, of: vectors", odometry(q=(0.5, 0.5, 0.5, 0.5)))
    assert heard == odometry(z=4.0, q=(0.5, 0.5, 0.5, 0.5))


def test_attitude_alone() -> None:
    heard = after_one("kind: axes, body_axes: FLU, of: attitude", mocap())
    assert (heard.x, heard.y, heard.z) == (1.0, 2.0, -4.0)
    assert np.abs(heard.q) == pytest.approx([0, 1, 0, 0], abs=1e-7)
    assert passed_over("kind: axes, body_axes: FLU, of: attitude", encoded(speed())[0])


def test_rates_turn_with_the_body_as_axial_vectors() -> None:
    told = odometry(rollspeed=1.0, pitchspeed=2.0, yawspeed=4.0)
    right = after_one("kind: axes, body_axes: FLU", told)
    assert (right.rollspeed, right.pitchspeed, right.yawspeed) == (1.0, -2.0, -4.0)
    left = after_one("kind: axes, world_axes: NEU, body_axes: FRU", told)
    assert (left.rollspeed, left.pitchspeed, left.yawspeed) == (-1.0, -2.0, 4.0)


@pytest.mark.parametrize(("body", "rates"), [("RBD", (-2, -4)), ("BLD", (-4, 2)), ("FLD", (-4, -2)), ("RFD", (2, -4))])
def test_flow_turns_with_the_body_as_an_axial_vector(body: str, rates: tuple[int, int]) -> None:
    heard = after_one(f"kind: axes, messages: OPTICAL_FLOW, body_axes: {body}, of: vectors", flow())
    assert (heard.flow_x, heard.flow_y) == rates
    assert (4 * heard.flow_rate_x, 4 * heard.flow_rate_y) == rates


def test_flow_has_no_attitude() -> None:
    fault = "kind: axes, body_axes: FLU, world_axes: NWU, of: attitude"
    assert passed_over(fault, encoded(flow())[0]) == {"nothing in it to change": 1}


def test_nan_stays_on_its_axis() -> None:
    heard = after_one(ENU_FLU, speed(x=math.nan, y=2.0))
    assert heard.x == 2.0
    assert math.isnan(heard.y)


@given(
    world_body=st.one_of(
        *[st.tuples(st.sampled_from(axes), st.sampled_from(axes)) for axes in (RIGHT_HANDED, LEFT_HANDED)]
    ),
    q=st.tuples(*[st.floats(0.1, 1.0)] * 4),
)
def test_attitude_is_that_of_the_matrices(world_body: tuple[str, str], q: tuple[float, ...]) -> None:
    told = tuple(np.array(q) / math.hypot(*q))
    world, body = world_body
    heard = after_one(f"kind: axes, world_axes: {world}, body_axes: {body}", odometry(q=told))
    expected = axes_matrix(world).T @ rotation_from_quat_wxyz(told) @ axes_matrix(body)
    assert rotation_from_quat_wxyz(heard.q) == pytest.approx(expected, abs=1e-6)
