# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ODOMETRY message of a state, here, through the codec, and as pymavlink and the firmware's handler see it."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from mav_handlers.covariance import pose_errors
from mav_handlers.handlers.vision import odometry_frames_accepted
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ODOMETRY
from viso.companion.odometry.composer import LocalPose
from viso.companion.odometry.message import odometry_message
from viso.companion.odometry.propagation import MotionState
from viso.companion.vio.config import CovarianceEncoding, LocalAlignment
from viso.companion.vio.frames import ENU_TO_NED
from viso.geometry.pose import SE3
from viso.geometry.rotation import so3_exp

ROTATION = so3_exp(np.array([0.0, 0.0, 2.0])).dot(so3_exp(np.array([0.2, -0.1, 0.0])))
STATE = MotionState(
    1_234_567_890_123,
    LocalPose(SE3(ROTATION, np.array([10.0, 20.0, 3.0])), np.diag([1e-4, 2e-4, 3e-4, 0.01, 0.02, 0.03])),
    np.array([4.0, 0.5, -0.25]),
    np.array([0.1, 0.2, 0.3]),
)


def message_of(state: MotionState = STATE, alignment: str = "north", **options: Any) -> ODOMETRY:
    return odometry_message(state, LocalAlignment(alignment), **{"reset_counter": 7, "quality": 80, **options})


def facing(yaw_rad: float) -> MotionState:
    pose = LocalPose(SE3(so3_exp(np.array([0.0, 0.0, yaw_rad])), np.array([10.0, 20.0, 3.0])), np.zeros((6, 6)))
    return dataclasses.replace(STATE, pose=pose)


def test_frames_are_the_only_ones_the_autopilot_takes() -> None:
    assert odometry_frames_accepted(message_of())
    assert odometry_frames_accepted(message_of(alignment="heading0"))


def test_position_aligned_to_north_is_ned() -> None:
    message = message_of()
    assert (message.x, message.y, message.z) == (20.0, 10.0, -3.0)


def test_position_along_the_first_heading_is_forward_right_down() -> None:
    message = message_of(alignment="heading0")
    assert (message.x, message.y, message.z) == (10.0, -20.0, -3.0)


@pytest.mark.parametrize(
    ("yaw_rad", "alignment", "heading_rad"),
    [
        (math.pi / 2, "north", 0.0),
        (0.0, "north", math.pi / 2),
        (-math.pi / 2, "north", math.pi),
        (0.0, "heading0", 0.0),
        (0.5, "heading0", -0.5),
    ],
)
def test_heading_of_the_quaternion(yaw_rad: float, alignment: str, heading_rad: float) -> None:
    quat = Quaternion(*message_of(facing(yaw_rad), alignment).q)
    assert math.cos(float(quat.get_euler_yaw()) - heading_rad) == pytest.approx(1.0, abs=1e-6)
    assert (float(quat.get_euler_roll()), float(quat.get_euler_pitch())) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_velocity_turned_by_the_quaternion_is_that_of_the_world() -> None:
    message = message_of()
    turned = Quaternion(*message.q).rotate_vector(Vector3f(message.vx, message.vy, message.vz))
    expected = ENU_TO_NED.dot(ROTATION).dot(STATE.velocity_b)
    assert [float(value) for value in turned.to_tuple()] == pytest.approx(expected.tolist(), abs=1e-5)


def test_velocity_and_rates_are_in_the_bodys_frd_axes() -> None:
    message = message_of()
    assert (message.vx, message.vy, message.vz) == (4.0, -0.5, 0.25)
    assert (message.rollspeed, message.pitchspeed, message.yawspeed) == (0.1, -0.2, -0.3)


def test_rates_are_nan_without_inertial_data() -> None:
    message = message_of(dataclasses.replace(STATE, gyro_b=None))
    assert all(math.isnan(rate) for rate in (message.rollspeed, message.pitchspeed, message.yawspeed))


def test_stamp_is_the_states_in_microseconds() -> None:
    assert message_of().time_usec == 1_234_567_890


def test_stamp_can_be_another() -> None:
    assert message_of(time_us=5).time_usec == 5


def test_velocity_covariance_is_unknown() -> None:
    assert math.isnan(message_of().velocity_covariance[0])


def test_what_else_the_message_carries() -> None:
    message = message_of()
    assert (message.estimator_type, message.reset_counter, message.quality) == (3, 7, 80)


def test_errors_are_the_same_whatever_the_heading() -> None:
    found = [pose_errors(message_of(facing(yaw)).pose_covariance) for yaw in (0.0, 1.0)]
    assert found[0] == found[1]


def test_encoding_is_handed_on() -> None:
    covariance = np.diag([0.01] * 3 + [0.25] * 3)
    state = dataclasses.replace(STATE, pose=LocalPose(STATE.pose.L_T_B, covariance))
    pos_err, ang_err = pose_errors(message_of(state, encoding=CovarianceEncoding.ARDUPILOT_ERROR).pose_covariance)
    assert (float(pos_err), float(ang_err)) == pytest.approx((0.5, 0.1), rel=1e-6)


def float32_of(message: ODOMETRY) -> dict[str, Any]:
    """Return the fields as float32 leaves them."""
    fields = dataclasses.asdict(message)
    return {name: value if isinstance(value, int) else np.array(value, np.float32) for name, value in fields.items()}


CASES = [
    message_of(),
    message_of(alignment="heading0"),
    message_of(dataclasses.replace(STATE, gyro_b=None), quality=-1, reset_counter=255),
    message_of(encoding=CovarianceEncoding.ARDUPILOT_ERROR, quality=1),
]


@pytest.mark.parametrize("message", CASES)
def test_message_survives_the_codec(message: ODOMETRY) -> None:
    codec = Codec(1, 197)
    codec.feed(codec.encode(message))
    received = codec.next_received()
    assert isinstance(received, Received)
    assert isinstance(received.message, ODOMETRY)
    for name, value in float32_of(message).items():
        np.testing.assert_array_equal(getattr(received.message, name), value, err_msg=name)


@pytest.mark.parametrize("message", CASES)
def test_pymavlink_reads_the_same(message: ODOMETRY) -> None:
    raw = dialect.MAVLink(None).parse_buffer(Codec(1, 197).encode(message))[0]
    assert (raw.get_type(), raw.get_srcSystem(), raw.get_srcComponent()) == ("ODOMETRY", 1, 197)
    for name, value in float32_of(message).items():
        np.testing.assert_array_equal(getattr(raw, name), value, err_msg=name)


@pytest.mark.parametrize("message", CASES)
def test_pymavlink_packs_the_same_bytes(message: ODOMETRY) -> None:
    peer = dialect.MAVLink(None, srcSystem=1, srcComponent=197)
    assert bytes(dialect.MAVLink_odometry_message(**dataclasses.asdict(message)).pack(peer)) == Codec(1, 197).encode(
        message
    )
