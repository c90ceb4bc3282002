# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that change the flight mode, or start a takeoff or a mission (ArduCopter/GCS_MAVLink_Copter.cpp)."""

from typing import Final

from ap_core.cint import int_of_float, u8, u16
from ap_core.fmath import f32, is_zero
from ap_core.param_info import is_equal
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.results import MavResult, accepted_if, u32_of_float
from mav_handlers.wire.messages import COMMAND_INT

MAV_FRAME_GLOBAL_RELATIVE_ALT: Final = 3
MODE_FLAG_CUSTOM: Final = 1
SAFETY_SWITCH: Final = 128
AUTO: Final = 3
LOITER: Final = 5
RTL: Final = 6
LAND: Final = 9

_CENTI: Final = f32(100)


def set_mode(ctx: Context, base_mode: int, custom_mode: int) -> MavResult:
    """Enter a mode by number, or set the safety switch (GCS_MAVLINK::_set_mode_common).

    Args:
        ctx: the surroundings of the message.
        base_mode: bit 0 selects the mode number; exactly 128 selects the safety switch.
        custom_mode: number of the mode, eight bits; for the switch 0 is off, 1 on.
    """
    if base_mode & MODE_FLAG_CUSTOM:
        return accepted_if(ctx.vehicle.copter.set_mode(u8(custom_mode)))
    if base_mode != SAFETY_SWITCH or custom_mode > 1:
        return MavResult.DENIED
    ctx.vehicle.copter.safety_on = custom_mode == 1
    return MavResult.ACCEPTED


def do_set_mode(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Do what SET_MODE does."""
    return set_mode(ctx, u8(int_of_float(command.param1)), u32_of_float(command.param2))


def nav_loiter_unlim(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Enter LOITER."""
    return accepted_if(ctx.vehicle.copter.set_mode(LOITER))


def nav_return_to_launch(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Enter RTL."""
    return accepted_if(ctx.vehicle.copter.set_mode(RTL))


def nav_land(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Enter LAND."""
    return accepted_if(ctx.vehicle.copter.set_mode(LAND))


def mission_start(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Enter AUTO and begin; a range of mission items is not supported (handle_MAV_CMD_MISSION_START)."""
    if not is_zero(f32(command.param1)) or not is_zero(f32(command.param2)):
        return MavResult.DENIED
    copter = ctx.vehicle.copter
    if not copter.set_mode(AUTO):
        return MavResult.FAILED
    if copter.is_armed():
        copter.landing.allow_lift_off()
    copter.mission.start_unless_running()
    return MavResult.ACCEPTED


def do_set_mission_current(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Go on with the item of number param1; param2 of 1 restarts the mission there.

    Source: GCS_MAVLINK::handle_command_do_set_mission_current.
    """
    mission, seq = ctx.vehicle.copter.mission, u32_of_float(command.param1)
    if u16(seq) >= mission.count():
        return MavResult.DENIED
    restarts = is_equal(f32(command.param2), f32(1))
    if restarts:
        mission.reset()
    if not mission.set_current(u16(seq)):
        return MavResult.FAILED
    if restarts:
        mission.resume()
    ctx.channel.request("MISSION_CURRENT")
    return MavResult.ACCEPTED


def do_jump_tag(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Go on at the first JUMP_TAG of number param1 (GCS_MAVLINK::handle_command_do_jump_tag)."""
    mission, tag = ctx.vehicle.copter.mission, u32_of_float(command.param1)
    if tag != u16(tag):
        return MavResult.DENIED
    seq = mission.tagged(tag)
    if not seq or not mission.set_current(seq):
        return MavResult.FAILED
    ctx.channel.request("MISSION_CURRENT")
    return MavResult.ACCEPTED


def nav_takeoff(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Take off to an altitude in m above home; a non-zero param3 leaves horizontal control to the pilot.

    Source: GCS_MAVLINK_Copter::handle_MAV_CMD_NAV_TAKEOFF.
    """
    if command.frame != MAV_FRAME_GLOBAL_RELATIVE_ALT:
        return MavResult.DENIED
    altitude_cm = float(f32(command.z) * _CENTI)
    return accepted_if(ctx.vehicle.copter.take_off(altitude_cm, must_navigate=is_zero(f32(command.param3))))
