# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Auxiliary functions, which commands and switches of the radio run, and the command that chooses a source set."""

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import TYPE_CHECKING, Final

from ap_core.cint import int_of_float, u8, u16
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.results import MavResult, accepted_if, u32_of_float
from mav_handlers.wire.messages import COMMAND_INT

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

VISODOM_ALIGN: Final = 80
EKF_SOURCE_SET: Final = 90

_MAV_SEVERITY_INFO: Final = 6


class SwitchPosition(IntEnum):
    """RC_Channel::AuxSwitchPos."""

    LOW = 0
    MIDDLE = 1
    HIGH = 2


class AuxSource(IntEnum):
    """What runs an auxiliary function (RC_Channel::AuxFuncTrigger::Source)."""

    RC = 1
    MAVLINK = 3
    MISSION = 4


def _align_visual_odom(vehicle: "Vehicle", position: int) -> None:
    if position == SwitchPosition.HIGH:
        vehicle.visual_odom.request_align_yaw_to_ahrs()


def _select_source_set(vehicle: "Vehicle", position: int) -> None:
    index = position if position <= SwitchPosition.HIGH else 0
    vehicle.set_source_set(index)
    vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Using EKF Source Set {index + 1}")


AUX_FUNCTIONS: Final[Mapping[int, Callable[["Vehicle", int], None]]] = {
    VISODOM_ALIGN: _align_visual_odom,
    EKF_SOURCE_SET: _select_source_set,
}


def run_aux_function(vehicle: "Vehicle", function: int, position: int, source: AuxSource, index: int) -> bool:
    """Run a function and log it; return whether there is one of that number (RC_Channel::run_aux_function).

    ``index`` is the channel of the radio or the number of the link, from 0, or of the mission's item.
    """
    run = AUX_FUNCTIONS.get(function)
    if run is not None:
        run(vehicle, position)
    else:
        vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Invalid channel option ({function})")
    vehicle.log.aux_function(function, position, source, index, run is not None)
    return run is not None


def do_aux_function(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Run an auxiliary function: 80 aligns yaw, 90 selects a source set (handle_command_do_aux_function)."""
    if command.param2 > SwitchPosition.HIGH:
        return MavResult.DENIED
    function, position = u16(int_of_float(command.param1)), u8(int_of_float(command.param2))
    return accepted_if(run_aux_function(ctx.vehicle, function, position, AuxSource.MAVLINK, ctx.channel.index))


def set_ekf_source_set(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Select a source set, 1..3, without a text."""
    number = u32_of_float(command.param1)
    if not 1 <= number <= 3:
        return MavResult.DENIED
    ctx.vehicle.set_source_set(number - 1)
    return MavResult.ACCEPTED
