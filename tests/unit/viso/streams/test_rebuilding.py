# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is undone between record and message: scale, errors, orientation."""

import math
import struct

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.rotations import Rotation, rotate_vector
from ap_core.vector3 import Vector3f
from mav_handlers.covariance import ErrorFormula, cube_root_of_squares, pose_errors, root_of_sum
from viso.streams.rebuilding import DeltaRecord, PoseRecord, Rebuilder, VelocityRecord, covariance_of, unscaled

LENGTHS = st.floats(-1000, 1000, width=32)
ERRORS = st.floats(0.00999999977648258209228515625, 100, width=32)
STILL = (0.0, 0.0, 0.0)


def pose(**fields: object) -> PoseRecord:
    values = PoseRecord(1_000_000, 42, 990, (1.0, 2.0, -3.0), (0.0, 0.0, 90.0), 0.2, 0.2, 7, 55)
    return values._replace(**fields)  # type: ignore[arg-type]


def bits(value: float) -> bytes:
    return struct.pack("<f", value)


@given(LENGTHS, st.sampled_from([1.0, 1.1, 0.5, 2.4, 100.0]))
def test_scaled_position_comes_back(value: float, factor: float) -> None:
    scale = f32(factor)
    logged = float(f32(value) * scale)
    assert float(f32(unscaled(logged, scale)) * scale) == logged


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_position_that_is_no_number_stays_so(value: float) -> None:
    assert bits(unscaled(value, f32(1.1))) == bits(value)


def test_scale_of_zero_leaves_nothing() -> None:
    assert unscaled(3.0, f32(0)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("formula", [cube_root_of_squares, root_of_sum])
@settings(deadline=None, max_examples=60)
@given(pos_err=ERRORS, ang_err=ERRORS)
@example(pos_err=1.0, ang_err=61.35748291015625)  # which takes a last variance that is further off
def test_covariance_gives_the_errors_to_the_last_bit(formula: ErrorFormula, pos_err: float, ang_err: float) -> None:
    assert tuple(map(float, pose_errors(covariance_of(pos_err, ang_err, formula), formula))) == (pos_err, ang_err)


def test_variances_of_three_axes_are_alike() -> None:
    elements = covariance_of(0.5, 0.0, root_of_sum)
    assert elements[0] == elements[6] == pytest.approx(elements[11], rel=1e-6)
    assert sum(element != 0 for element in elements) == 3


@pytest.mark.parametrize("nothing", [0.0, math.nan])
def test_no_error_means_an_unknown_covariance(nothing: float) -> None:
    assert math.isnan(covariance_of(nothing, nothing, root_of_sum)[0])


def test_least_error_tells_no_covariance() -> None:
    rebuilder = Rebuilder(root_of_sum)
    rebuilder.set_param("VISO_POS_M_NSE", 0.2)
    least = float(f32(0.2))
    assert math.isnan(rebuilder.vision_position_estimate(pose(pos_err=least, ang_err=least)).covariance[0])
    more = rebuilder.vision_position_estimate(pose(pos_err=0.5, ang_err=least)).covariance
    assert more[0] > 0
    assert more[15] == 0


def test_odometry_has_the_accepted_frames_and_a_velocity_in_the_body() -> None:
    velocity = VelocityRecord(1_000_000, 42, 990, (0.0, 2.0, 0.0), 7, 55)
    message = Rebuilder(root_of_sum).odometry(pose(), velocity)
    assert (message.time_usec, message.frame_id, message.child_frame_id) == (42, 20, 12)
    assert (message.reset_counter, message.quality) == (7, 55)
    assert (message.vx, message.vy, message.vz) == pytest.approx((2.0, 0.0, 0.0), abs=1e-6)


def test_orientation_is_undone_once_the_camera_is_aligned() -> None:
    rebuilder = Rebuilder(root_of_sum)
    rebuilder.set_param("VISO_TYPE", 2)
    rebuilder.set_param("VISO_ORIENT", Rotation.YAW_180)
    level = pose(rpy_deg=STILL)
    assert rebuilder.vision_position_estimate(level).yaw == pytest.approx(0.0)
    rebuilder.aligned = True
    assert abs(rebuilder.vision_position_estimate(level).yaw) == pytest.approx(math.pi)


def test_backend_that_aligns_nothing_has_no_orientation() -> None:
    rebuilder = Rebuilder(root_of_sum)
    rebuilder.set_param("VISO_TYPE", 1)
    rebuilder.set_param("VISO_ORIENT", Rotation.YAW_180)
    rebuilder.aligned = True
    assert rebuilder.vision_position_estimate(pose(rpy_deg=STILL)).yaw == 0


@pytest.mark.parametrize("orientation", [Rotation.NONE, Rotation.YAW_90, Rotation.ROLL_180, Rotation.PITCH_270])
def test_orientation_of_a_delta_is_undone_exactly(orientation: Rotation) -> None:
    rebuilder = Rebuilder(root_of_sum)
    rebuilder.set_param("VISO_ORIENT", orientation)
    given_m = Vector3f(0.25, -1.5, 3.0)
    logged = rotate_vector(given_m, orientation, InternalErrors())
    x, y, z = map(float, logged.to_tuple())
    delta = rebuilder.vision_position_delta(DeltaRecord(5, float(f32(33333) * f32(1e-6)), STILL, (x, y, z), 80.0))
    assert delta.position_delta == tuple(map(float, given_m.to_tuple()))
    assert (delta.time_delta_usec, delta.confidence) == (33333, 80.0)


@pytest.mark.parametrize("duration_s", [math.nan, math.inf, -1.0, 1e30])
def test_duration_that_cannot_be_is_none(duration_s: float) -> None:
    assert (
        Rebuilder(root_of_sum).vision_position_delta(DeltaRecord(5, duration_s, STILL, STILL, 80.0)).time_delta_usec
        == 0
    )


def test_parameters_of_others_change_nothing() -> None:
    rebuilder = Rebuilder(root_of_sum)
    rebuilder.set_param("PILOT_SPEED_UP", 250)
    assert rebuilder.orientation == 0
    assert not rebuilder.aligns
    assert np.isfinite(rebuilder.vision_position_estimate(pose()).x)
