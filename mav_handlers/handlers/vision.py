# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of the messages that carry external navigation.

Source: GCS_MAVLink/GCS_Common.cpp (handle_vision_position_estimate, handle_global_vision_position_estimate,
handle_vicon_position_estimate, handle_att_pos_mocap, handle_odometry, handle_vision_speed_estimate,
handle_vision_position_delta).
"""

from typing import Final

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.covariance import pose_errors
from mav_handlers.verdicts import ODOMETRY_FRAMES
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
)

MAV_FRAME_BODY_FRD: Final = 12
MAV_FRAME_LOCAL_FRD: Final = 20

_EulerPose = VISION_POSITION_ESTIMATE | GLOBAL_VISION_POSITION_ESTIMATE | VICON_POSITION_ESTIMATE


def handle_vision_position_estimate(ctx: Context, message: _EulerPose) -> Verdict:
    """Handle a pose with Euler angles. VICON_POSITION_ESTIMATE has no reset counter; none has a quality."""
    timestamp_ms = ctx.correct_time_ms(type(message), message.usec)
    posErr, angErr = pose_errors(message.covariance, ctx.vehicle.release.error_formula)
    reset_counter = 0 if isinstance(message, VICON_POSITION_ESTIMATE) else message.reset_counter
    return ctx.vehicle.visual_odom.handle_pose_estimate_euler(
        message.usec,
        timestamp_ms,
        Vector3f(message.x, message.y, message.z),
        Vector3f(message.roll, message.pitch, message.yaw),
        posErr,
        angErr,
        reset_counter,
        0,
    )


def handle_att_pos_mocap(ctx: Context, message: ATT_POS_MOCAP) -> Verdict:
    """Handle a pose with a quaternion; the release decides how its covariance is used."""
    timestamp_ms = ctx.correct_time_ms(ATT_POS_MOCAP, message.time_usec)
    release = ctx.vehicle.release
    posErr, angErr = release.mocap_errors(message.covariance, release.error_formula)
    return ctx.vehicle.visual_odom.handle_pose_estimate(
        message.time_usec,
        timestamp_ms,
        Vector3f(message.x, message.y, message.z),
        Quaternion(*message.q),
        posErr,
        angErr,
        0,
        0,
    )


def odometry_frames_accepted(message: ODOMETRY) -> bool:
    """Return whether an ODOMETRY has the one pair of frames that the firmware accepts."""
    return message.frame_id == MAV_FRAME_LOCAL_FRD and message.child_frame_id == MAV_FRAME_BODY_FRD


def handle_odometry(ctx: Context, message: ODOMETRY) -> Verdict:
    """Handle a pose, then the velocity rotated by the message's quaternion; one time correction serves both."""
    if not odometry_frames_accepted(message):
        return ODOMETRY_FRAMES
    q = Quaternion(*message.q)
    posErr, angErr = pose_errors(message.pose_covariance, ctx.vehicle.release.error_formula)
    vel = q.rotate_vector(Vector3f(message.vx, message.vy, message.vz))
    timestamp_ms = ctx.correct_time_ms(ODOMETRY, message.time_usec)
    visual_odom = ctx.vehicle.visual_odom
    verdict = visual_odom.handle_pose_estimate(
        message.time_usec,
        timestamp_ms,
        Vector3f(message.x, message.y, message.z),
        q,
        posErr,
        angErr,
        message.reset_counter,
        message.quality,
    )
    # Counter, quality and time are the same, so the velocity gets the pose's verdict.
    visual_odom.handle_vision_speed_estimate(
        message.time_usec, timestamp_ms, vel, message.reset_counter, message.quality
    )
    return verdict


def handle_vision_speed_estimate(ctx: Context, message: VISION_SPEED_ESTIMATE) -> Verdict:
    """Handle a velocity in NED; the release decides how its covariance is used."""
    timestamp_ms = ctx.correct_time_ms(VISION_SPEED_ESTIMATE, message.usec)
    vel = Vector3f(message.x, message.y, message.z)
    return ctx.vehicle.visual_odom.handle_vision_speed_estimate(
        message.usec,
        timestamp_ms,
        vel,
        message.reset_counter,
        0,
        ctx.vehicle.release.velocity_error(message.covariance),
    )


def handle_vision_position_delta(ctx: Context, message: VISION_POSITION_DELTA) -> Verdict:
    """Handle a change of pose; ``time_usec`` is ignored, the time of handling counts."""
    return ctx.vehicle.visual_odom.handle_vision_position_delta_msg(
        message.time_delta_usec,
        Vector3f(*message.angle_delta),
        Vector3f(*message.position_delta),
        f32(message.confidence),
    )
