# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of commands (GCS_Common.cpp, handle_command_long, handle_command_int, handle_command_int_packet)."""

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Final

import numpy as np

from ap_core.cint import int_of_float, u8, u16, u32
from ap_core.fmath import f32, is_zero
from ap_core.param_info import is_equal
from ap_core.verdict import Verdict
from mav_handlers.context import Context
from mav_handlers.handlers.origin import set_ekf_origin
from mav_handlers.intervals import MAX_INTERVAL_MS, MIN_INTERVAL_MS, default_interval_ms, set_interval
from mav_handlers.ports import Location, OriginResult
from mav_handlers.senders import SENDERS, gps_global_origin, home_position
from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.codec import message_name
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_INT, COMMAND_LONG, MESSAGE_INTERVAL

FORCE_ARM: Final = f32(2989.0)
FORCE_ARM_DISARM: Final = f32(21196.0)
MAV_FRAME_GLOBAL: Final = 0
MAV_FRAME_GLOBAL_RELATIVE_ALT: Final = 3
MESSAGE_INTERVAL_ID: Final = 244
LOCATION_ALT_MAX_M: Final = 83_000
# Above home, above terrain and absolute, each also in its "INT" form.
LOCATION_FRAMES: Final = frozenset({0, 3, 5, 6, 10, 11})

_ONE: Final = f32(1)
_I64_LIMIT: Final = 1 << 63
_MAV_SEVERITY_INFO: Final = 6


class MavResult(IntEnum):
    """MAV_RESULT values that the firmware uses here."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class MavCmd(IntEnum):
    """MAV_CMD values that have a handler, or that carry a location."""

    DO_SET_HOME = 179
    DO_SET_ROI_LOCATION = 195
    DO_REPOSITION = 192
    DO_SET_ROI = 201
    DO_AUX_FUNCTION = 218
    COMPONENT_ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    GET_HOME_POSITION = 410
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    DO_SET_GLOBAL_ORIGIN = 611
    SET_EKF_SOURCE_SET = 42007
    DO_SEND_BANNER = 42428
    EXTERNAL_POSITION_ESTIMATE = 43003


_CARRY_LOCATION: Final = frozenset(
    {
        MavCmd.DO_SET_HOME,
        MavCmd.DO_SET_ROI,
        MavCmd.DO_SET_ROI_LOCATION,
        MavCmd.DO_REPOSITION,
        MavCmd.EXTERNAL_POSITION_ESTIMATE,
        MavCmd.DO_SET_GLOBAL_ORIGIN,
    }
)
_NO_ASSUMED_FRAME: Final = frozenset(
    {MavCmd.DO_REPOSITION, MavCmd.EXTERNAL_POSITION_ESTIMATE, MavCmd.DO_SET_GLOBAL_ORIGIN}
)

Handler = Callable[[Context, COMMAND_INT], MavResult]


def _u32_of_float(value: float) -> int:
    # x86-64 converts to uint32_t through a 64-bit register; NaN and what does not fit there give 0.
    return u32(math.trunc(value)) if -_I64_LIMIT <= value < _I64_LIMIT else 0


def _location_param(value: float, carries_location: bool) -> int:
    if math.isnan(value):
        return 0
    return int_of_float(value * 1e7 if carries_location else value)


def to_command_int(message: COMMAND_LONG) -> COMMAND_INT:
    """Convert a COMMAND_LONG: param5 and 6 become integers, x 1e7 where they are a place.

    Source: GCS_MAVLINK::convert_COMMAND_LONG_to_COMMAND_INT.
    """
    carries_location = message.command in _CARRY_LOCATION
    frame = MAV_FRAME_GLOBAL if message.command == MavCmd.DO_SET_HOME else MAV_FRAME_GLOBAL_RELATIVE_ALT
    return COMMAND_INT(
        message.target_system,
        message.target_component,
        frame,
        message.command,
        0,
        0,
        message.param1,
        message.param2,
        message.param3,
        message.param4,
        _location_param(message.param5, carries_location),
        _location_param(message.param6, carries_location),
        message.param7,
    )


def handle_command_long(ctx: Context, message: COMMAND_LONG) -> Verdict:
    """Run a command and acknowledge it, whatever its confirmation count."""
    command = to_command_int(message)
    result = MavResult.UNSUPPORTED if message.command in _NO_ASSUMED_FRAME else _run(ctx, command)
    return _finish(ctx, command, result, was_long=True)


def handle_command_int(ctx: Context, message: COMMAND_INT) -> Verdict:
    """Run a command and acknowledge it."""
    return _finish(ctx, message, _run(ctx, message), was_long=False)


def _run(ctx: Context, command: COMMAND_INT) -> MavResult:
    handler = COMMANDS.get(command.command)
    return handler(ctx, command) if handler is not None else MavResult.UNSUPPORTED


def _finish(ctx: Context, command: COMMAND_INT, result: MavResult, *, was_long: bool) -> Verdict:
    sender = ctx.header.system_id, ctx.header.component_id
    ctx.channel.send(COMMAND_ACK(command.command, result, 0, 0, *sender))
    ctx.vehicle.log.command(
        (
            command.target_system,
            command.target_component,
            *sender,
            command.frame,
            command.command,
            *(np.float32(p) for p in (command.param1, command.param2, command.param3, command.param4)),
            command.x,
            command.y,
            np.float32(command.z),
            int(result),
            int(was_long),
        )
    )
    return HANDLED


def _accepted(ok: bool) -> MavResult:
    return MavResult.ACCEPTED if ok else MavResult.FAILED


def component_arm_disarm(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Arm or disarm (handle_command_component_arm_disarm)."""
    vehicle = ctx.vehicle
    param1, param2 = f32(command.param1), f32(command.param2)
    if is_equal(param1, _ONE):
        forced = is_equal(param2, FORCE_ARM) or is_equal(param2, FORCE_ARM_DISARM)
        return _accepted(vehicle.is_armed() or vehicle.arm(do_checks=not forced))
    if is_zero(param1):
        forced = is_equal(param2, FORCE_ARM_DISARM)
        return _accepted(not vehicle.is_armed() or vehicle.disarm(force=forced))
    return MavResult.UNSUPPORTED


def run_prearm_checks(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Run the checks and tell failures as texts; accepted whatever the outcome."""
    if ctx.vehicle.is_armed():
        return MavResult.TEMPORARILY_REJECTED
    ctx.vehicle.run_prearm_checks()
    return MavResult.ACCEPTED


def _align_visual_odom(ctx: Context, position: int) -> None:
    if position == 2:
        ctx.vehicle.visual_odom.request_align_yaw_to_ahrs()


def _select_source_set(ctx: Context, position: int) -> None:
    index = position if position <= 2 else 0
    ctx.vehicle.set_source_set(index)
    ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Using EKF Source Set {index + 1}")


AUX_FUNCTIONS: Final[Mapping[int, Callable[[Context, int], None]]] = {
    80: _align_visual_odom,
    90: _select_source_set,
}


def do_aux_function(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Run an RC auxiliary function: 80 aligns yaw, 90 selects a source set (handle_command_do_aux_function)."""
    if command.param2 > 2:
        return MavResult.DENIED
    function, position = u16(int_of_float(command.param1)), u8(int_of_float(command.param2))
    run = AUX_FUNCTIONS.get(function)
    if run is not None:
        run(ctx, position)
    else:
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Invalid channel option ({function})")
    ctx.vehicle.log.aux_function(function, position, run is not None)
    return _accepted(run is not None)


def set_ekf_source_set(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Select a source set, 1..3, without a text."""
    number = _u32_of_float(command.param1)
    if not 1 <= number <= 3:
        return MavResult.DENIED
    ctx.vehicle.set_source_set(number - 1)
    return MavResult.ACCEPTED


def set_message_interval(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Set a message's interval in us; -1 stops it, 0 restores the default (set_message_interval)."""
    if not is_zero(f32(command.param3)):
        return MavResult.DENIED
    msg_id, interval_us = _u32_of_float(command.param1), int_of_float(command.param2)
    name = message_name(msg_id)
    if name is None or name not in SENDERS:
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"No ap_message for mavlink id ({msg_id})")
        return MavResult.DENIED
    if interval_us < -1:
        return MavResult.DENIED
    interval_ms: int | None = min(max(interval_us // 1000, 1), MAX_INTERVAL_MS)
    if interval_us == 0:
        interval_ms = default_interval_ms(ctx.vehicle, ctx.channel, name)
    elif interval_us == -1:
        interval_ms = None
    if interval_ms is not None and interval_ms < MIN_INTERVAL_MS:
        text = f"Requested rate for message ID {msg_id} too fast. Increase SCHED_LOOP_RATE"
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, text)
        return MavResult.DENIED
    set_interval(ctx.channel, name, interval_ms, ctx.now_us)
    return MavResult.ACCEPTED


def _tell_message_interval(ctx: Context, wanted: float) -> MavResult:
    if not ctx.channel.has_room():
        return MavResult.TEMPORARILY_REJECTED
    msg_id = _u32_of_float(wanted)
    name = message_name(msg_id)
    if msg_id >= 65536 or name is None or name not in SENDERS:
        ctx.channel.send(MESSAGE_INTERVAL(msg_id & 0xFFFF, 0))
        return MavResult.FAILED
    interval_ms = ctx.channel.intervals_ms.get(name)
    ctx.channel.send(MESSAGE_INTERVAL(msg_id, -1 if interval_ms is None else interval_ms * 1000))
    return MavResult.ACCEPTED


def get_message_interval(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Tell a message's interval, ahead of the acknowledgement."""
    return _tell_message_interval(ctx, command.param1)


def request_message(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Queue a message to be sent once, after the acknowledgement; it may turn out to have nothing to say."""
    msg_id = _u32_of_float(command.param1)
    if msg_id == MESSAGE_INTERVAL_ID:
        return _tell_message_interval(ctx, command.param2)
    name = message_name(msg_id)
    if name is None or name not in SENDERS:
        return MavResult.FAILED
    ctx.endpoint.request_message(ctx.channel, name)
    return MavResult.ACCEPTED


def request_autopilot_capabilities(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Queue AUTOPILOT_VERSION."""
    if not is_equal(f32(command.param1), _ONE):
        return MavResult.FAILED
    ctx.endpoint.request_message(ctx.channel, "AUTOPILOT_VERSION")
    return MavResult.ACCEPTED


def get_home_position(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Send home and origin ahead of the acknowledgement."""
    home = home_position(ctx.vehicle, ctx.channel, ctx.now_us)
    if home is None:
        return MavResult.FAILED
    ctx.channel.send(home)
    origin = gps_global_origin(ctx.vehicle, ctx.channel, ctx.now_us)
    if origin is not None:
        ctx.channel.send(origin)
    return MavResult.ACCEPTED


_ORIGIN_RESULTS: Final = {
    OriginResult.SET: MavResult.ACCEPTED,
    OriginResult.INVALID: MavResult.DENIED,
    OriginResult.FAILED: MavResult.FAILED,
}


def do_set_global_origin(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Set the EKF origin: degE7 and metres."""
    if math.isnan(command.z) or abs(command.z) > LOCATION_ALT_MAX_M:
        return MavResult.DENIED
    if command.frame not in LOCATION_FRAMES:
        ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Unknown mavlink coordinate frame {command.frame}")
        return MavResult.DENIED
    location = Location(command.x, command.y, int_of_float(float(np.float32(command.z) * np.float32(100))))
    return _ORIGIN_RESULTS[set_ekf_origin(ctx, location)]


def do_send_banner(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Introduce the vehicle in texts."""
    ctx.endpoint.send_banner()
    return MavResult.ACCEPTED


COMMANDS: Final[Mapping[int, Handler]] = {
    MavCmd.COMPONENT_ARM_DISARM: component_arm_disarm,
    MavCmd.RUN_PREARM_CHECKS: run_prearm_checks,
    MavCmd.DO_AUX_FUNCTION: do_aux_function,
    MavCmd.SET_EKF_SOURCE_SET: set_ekf_source_set,
    MavCmd.SET_MESSAGE_INTERVAL: set_message_interval,
    MavCmd.GET_MESSAGE_INTERVAL: get_message_interval,
    MavCmd.REQUEST_MESSAGE: request_message,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: request_autopilot_capabilities,
    MavCmd.GET_HOME_POSITION: get_home_position,
    MavCmd.DO_SET_GLOBAL_ORIGIN: do_set_global_origin,
    MavCmd.DO_SEND_BANNER: do_send_banner,
}
