# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that arm, disarm and check."""

from typing import Final

from ap_core.fmath import f32, is_zero
from ap_core.param_info import is_equal
from mav_handlers.context import Context
from mav_handlers.handlers.commands.results import MavResult, accepted_if
from mav_handlers.wire.messages import COMMAND_INT

FORCE_ARM: Final = f32(2989.0)
FORCE_ARM_DISARM: Final = f32(21196.0)

_ONE: Final = f32(1)


def component_arm_disarm(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Arm or disarm (handle_command_component_arm_disarm)."""
    vehicle = ctx.vehicle
    param1, param2 = f32(command.param1), f32(command.param2)
    if is_equal(param1, _ONE):
        forced = is_equal(param2, FORCE_ARM) or is_equal(param2, FORCE_ARM_DISARM)
        return accepted_if(vehicle.copter.is_armed() or vehicle.copter.arm(do_checks=not forced))
    if is_zero(param1):
        forced = is_equal(param2, FORCE_ARM_DISARM)
        return accepted_if(not vehicle.copter.is_armed() or vehicle.copter.disarm(force=forced))
    return MavResult.UNSUPPORTED


def run_prearm_checks(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Run the checks and tell failures as texts; accepted whatever the outcome."""
    if ctx.vehicle.copter.is_armed():
        return MavResult.TEMPORARILY_REJECTED
    ctx.vehicle.copter.arming.pre_arm_checks(display=True)
    return MavResult.ACCEPTED
