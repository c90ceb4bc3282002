# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that run auxiliary functions and choose a source set."""

from collections.abc import Callable, Mapping
from typing import Final

from ap_core.cint import int_of_float, u8, u16
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.results import MavResult, accepted_if, u32_of_float
from mav_handlers.wire.messages import COMMAND_INT

_MAV_SEVERITY_INFO: Final = 6


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
    return accepted_if(run is not None)


def set_ekf_source_set(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Select a source set, 1..3, without a text."""
    number = u32_of_float(command.param1)
    if not 1 <= number <= 3:
        return MavResult.DENIED
    ctx.vehicle.set_source_set(number - 1)
    return MavResult.ACCEPTED
