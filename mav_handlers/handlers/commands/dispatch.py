# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of commands (GCS_Common.cpp, handle_command_long, handle_command_int, handle_command_int_packet)."""

import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from ap_core.cint import int_of_float
from ap_core.fmath import f32
from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.handlers.commands import aux_functions, flight, home, message_intervals, modes, system
from mav_handlers.handlers.commands.results import MavCmd, MavResult
from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_INT, COMMAND_LONG

MAV_FRAME_GLOBAL: Final = 0
MAV_FRAME_GLOBAL_RELATIVE_ALT: Final = 3

_UNITS_PER_DEGREE: Final = f32(1e7)
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


CommandHandler = Callable[[Context, COMMAND_INT], MavResult]

COMMANDS: Final[Mapping[int, CommandHandler]] = {
    MavCmd.NAV_LOITER_UNLIM: modes.nav_loiter_unlim,
    MavCmd.NAV_RETURN_TO_LAUNCH: modes.nav_return_to_launch,
    MavCmd.NAV_LAND: modes.nav_land,
    MavCmd.NAV_TAKEOFF: modes.nav_takeoff,
    MavCmd.NAV_VTOL_TAKEOFF: modes.nav_takeoff,
    MavCmd.NAV_VTOL_LAND: modes.nav_land,
    MavCmd.CONDITION_YAW: flight.condition_yaw,
    MavCmd.DO_SET_MODE: modes.do_set_mode,
    MavCmd.DO_CHANGE_SPEED: flight.do_change_speed,
    MavCmd.DO_SET_HOME: home.do_set_home,
    MavCmd.DO_REPOSITION: flight.do_reposition,
    MavCmd.DO_AUX_FUNCTION: aux_functions.do_aux_function,
    MavCmd.DO_SET_MISSION_CURRENT: modes.do_set_mission_current,
    MavCmd.PREFLIGHT_CALIBRATION: system.preflight_calibration,
    MavCmd.PREFLIGHT_STORAGE: system.preflight_storage,
    MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: system.preflight_reboot_shutdown,
    MavCmd.MISSION_START: modes.mission_start,
    MavCmd.COMPONENT_ARM_DISARM: system.component_arm_disarm,
    MavCmd.RUN_PREARM_CHECKS: system.run_prearm_checks,
    MavCmd.GET_HOME_POSITION: home.get_home_position,
    MavCmd.GET_MESSAGE_INTERVAL: message_intervals.get_message_interval,
    MavCmd.SET_MESSAGE_INTERVAL: message_intervals.set_message_interval,
    MavCmd.REQUEST_MESSAGE: message_intervals.request_message,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: system.request_autopilot_capabilities,
    MavCmd.DO_JUMP_TAG: modes.do_jump_tag,
    MavCmd.DO_SET_GLOBAL_ORIGIN: home.do_set_global_origin,
    MavCmd.SET_EKF_SOURCE_SET: aux_functions.set_ekf_source_set,
    MavCmd.DO_SEND_BANNER: system.do_send_banner,
    MavCmd.EXTERNAL_POSITION_ESTIMATE: home.external_position_estimate,
    MavCmd.EXTERNAL_WIND_ESTIMATE: home.external_wind_estimate,
}
"""All commands, one row each."""


def _location_param(value: float, carries_location: bool) -> int:
    # convert_COMMAND_LONG_loc_param: the firmware's constants are float32, so that degrees lose up to a metre.
    if math.isnan(value):
        return 0
    return int_of_float(float(f32(value) * _UNITS_PER_DEGREE) if carries_location else value)


def to_command_int(message: COMMAND_LONG) -> COMMAND_INT:
    """Convert a COMMAND_LONG: param5 and 6 become integers, x 1e7 in float32 where they are a place.

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
    if handler is None or command.command in ctx.vehicle.release.unknown_commands:
        return MavResult.UNSUPPORTED
    return handler(ctx, command)


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
