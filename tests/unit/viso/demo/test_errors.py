# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors against the truth: those that are put in come out."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
import quaternion

from ekf_stub.reports import AidingMode, FilterFlag
from mav_handlers.wire.messages import ODOMETRY
from tests.unit.viso.demo.hops import between
from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.companion.world.ground import generate_texture
from viso.demo.errors import PoseErrors, estimate_errors, odometry_errors, truth
from viso.demo.loop import LoopSetup
from viso.demo.record import Arrived, Estimate
from viso.demo.survey_flight import SurveyPlan, survey_flight
from viso.geometry.rotation import Array, quat_wxyz_from_rotation

PLAN = SurveyPlan(climb_s=1.0, cruise_s=5.0, height_m=10.0)
SETUP = LoopSetup(flight=survey_flight(PLAN, 20.0, texture=generate_texture(size_px=64)), companion_us=2_000_000)
OFFSET_NED = np.array([3.0, 4.0, -0.5])
TURN_RAD = 0.1
TILT_RAD = 0.02
TIME_US = 11_000_000


def true_pose(time_us: int) -> tuple[Array, Array]:
    """Return where the vehicle is, straight from the world's."""
    start = SETUP.flight.truth(SETUP.flight.start_ns)
    pose = SETUP.flight.truth(SETUP.flight.start_ns + (time_us - SETUP.companion_us) * 1000)
    return ENU_TO_NED.dot(pose.t - start.t), ENU_TO_NED.dot(pose.R).dot(FLU_TO_FRD)


def wrong_pose(time_us: int) -> tuple[Any, Any]:
    """Return a pose that is off by what is known."""
    position, rotation = true_pose(time_us)
    turn = quaternion.as_rotation_matrix(quaternion.from_rotation_vector([0.0, 0.0, TURN_RAD]))
    lean = quaternion.as_rotation_matrix(quaternion.from_rotation_vector([TILT_RAD, 0.0, 0.0]))
    return tuple(position + OFFSET_NED), tuple(quat_wxyz_from_rotation(turn.dot(lean).dot(rotation)).tolist())


def message(time_us: int, quality: int = 80) -> Arrived:
    """Return a message with the wrong pose, 10 ms after its time."""
    (x, y, z), quat = wrong_pose(time_us)
    covariance = [0.0] * 21
    covariance[0], covariance[6], covariance[11] = 4.0, 9.0, 0.25
    stamp_us, still = SETUP.companion_time_us(time_us), (0.0,) * 6
    told = ODOMETRY(stamp_us, 20, 12, x, y, z, quat, *still, tuple(covariance), (0.0,) * 21, 0, 3, quality)
    return Arrived(time_us + 10_000, told, True)


def check_errors(errors: PoseErrors) -> None:
    """Check that the errors are those that were put in."""
    assert errors.t_s == pytest.approx([1e-6 * TIME_US])
    assert errors.errors_ned[0] == pytest.approx(OFFSET_NED, abs=1e-9)
    assert errors.horizontal_m == pytest.approx([5.0])
    assert errors.sigmas_m[0] == pytest.approx([2.0, 3.0, 0.5])
    assert errors.tilt_rad == pytest.approx([TILT_RAD], rel=1e-3)
    assert errors.yaw_rad == pytest.approx([TURN_RAD], abs=0.01)


def test_errors_of_a_message_are_those_at_its_stamp() -> None:
    check_errors(odometry_errors(SETUP, [message(TIME_US)]))


def test_errors_of_an_estimate_are_those_at_its_time() -> None:
    pos_ned, quat = wrong_pose(TIME_US)
    state = FilterFlag.HORIZ_POS_ABS, AidingMode.ABSOLUTE, True, True
    check_errors(estimate_errors(SETUP, [Estimate(TIME_US, pos_ned, (2.0, 3.0, 0.5), (0.0, 0.0), quat, *state)]))


def test_lost_poses_are_left_out() -> None:
    assert len(odometry_errors(SETUP, [message(TIME_US, -1), message(TIME_US + 50_000, 1)])) == 1


def test_estimates_without_a_position_are_left_out() -> None:
    state = FilterFlag.UNINITIALISED, AidingMode.NONE, False, False
    assert len(estimate_errors(SETUP, [Estimate(TIME_US, None, None, None, None, *state)])) == 0


def test_no_pose_has_no_errors() -> None:
    errors = odometry_errors(SETUP, [])
    assert (len(errors), errors.errors_ned.shape) == (0, (0, 3))
    assert len(errors.in_flight()) == 0


def test_difference_of_headings_is_the_shorter_way() -> None:
    arrived = message(TIME_US)
    w, x, y, z = arrived.message.q
    half_turn = quaternion.quaternion(math.cos(1.5), 0.0, 0.0, math.sin(1.5)) * quaternion.quaternion(w, x, y, z)
    turned = dataclasses.replace(arrived.message, q=tuple(quaternion.as_float_array(half_turn).tolist()))
    errors = odometry_errors(SETUP, [arrived._replace(message=turned)])
    assert errors.yaw_rad == pytest.approx([3.0 + TURN_RAD], abs=0.02)


def test_flight_is_what_is_above_the_ground() -> None:
    errors = odometry_errors(SETUP, [message(time_us) for time_us in (2_500_000, 8_000_000, TIME_US)])
    assert errors.in_flight().t_s == pytest.approx([8.0, 11.0])


def test_span_of_time_has_its_begin_and_not_its_end() -> None:
    errors = odometry_errors(SETUP, [message(time_us) for time_us in (2_500_000, 8_000_000, TIME_US)])
    assert between(errors, 8.0, 11.0).t_s == pytest.approx([8.0])


def test_vehicle_stands_in_its_origin_before_the_companion_comes_up() -> None:
    assert truth(SETUP, np.array([0.0, 2.0]))[0] == pytest.approx(0.0, abs=1e-12)
