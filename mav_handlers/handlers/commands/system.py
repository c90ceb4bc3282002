# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands about the autopilot itself: arming and checks, restart, storage, calibration."""

from typing import Final

from ap_core.fmath import f32, is_zero
from ap_core.param_info import is_equal
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.results import MavResult, accepted_if
from mav_handlers.wire.messages import COMMAND_INT

FORCE_ARM: Final = f32(2989.0)
FORCE_ARM_DISARM: Final = f32(21196.0)
REBOOT: Final = f32(1.0)
REBOOT_TO_BOOTLOADER: Final = f32(3.0)
FORCE_REBOOT: Final = 20190226
ALL_COMPONENTS, AUTOPILOT = 0, 1
FORCE_SAVE_CALIBRATION: Final = 76

_ONE: Final = f32(1)
# param1 to 3 of the requests to provoke a fault.
_DELIBERATE_FAULT: Final = (f32(42.0), f32(24.0), f32(71.0))
_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_NOTICE: Final = 5
_MAV_SEVERITY_INFO: Final = 6


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
    """Run the checks and send failures as texts; always accepted."""
    if ctx.vehicle.copter.is_armed():
        return MavResult.TEMPORARILY_REJECTED
    ctx.vehicle.copter.arming.pre_arm_checks(display=True)
    return MavResult.ACCEPTED


def request_autopilot_capabilities(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Queue AUTOPILOT_VERSION."""
    if not is_equal(f32(command.param1), _ONE):
        return MavResult.FAILED
    ctx.channel.request("AUTOPILOT_VERSION")
    return MavResult.ACCEPTED


def do_send_banner(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Send the banner texts."""
    ctx.vehicle.endpoint.send_banner(ctx.channel)
    return MavResult.ACCEPTED


def preflight_reboot_shutdown(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Restart, armed only when forced (GCS_MAVLINK::handle_preflight_reboot)."""
    param1 = f32(command.param1)
    if command.target_component not in (ALL_COMPONENTS, AUTOPILOT) and not ctx.vehicle.release.reboots_for_others:
        return MavResult.DENIED
    asked = zip((param1, f32(command.param2), f32(command.param3)), _DELIBERATE_FAULT, strict=True)
    if all(is_equal(param, wanted) for param, wanted in asked):
        # FIRMWARE PARITY: the firmware provokes the fault that param4 selects.
        return MavResult.UNSUPPORTED
    if ctx.vehicle.copter.is_armed() and command.y != FORCE_REBOOT:
        return MavResult.FAILED
    if not is_equal(param1, REBOOT) and not is_equal(param1, REBOOT_TO_BOOTLOADER):
        return MavResult.UNSUPPORTED
    ctx.vehicle.reboot_requested = True
    return MavResult.ACCEPTED


def preflight_storage(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Erase all stored parameters, which takes effect after a restart. Saving needs no command."""
    if not ctx.vehicle.release.resets_parameters(command.param1):
        return MavResult.DENIED
    ctx.vehicle.params.forget_stored()
    text = "All parameters reset, reboot board"
    ctx.vehicle.texts.send_text_to(ctx.channel.index, _MAV_SEVERITY_WARNING, text)
    return MavResult.ACCEPTED


def preflight_calibration(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Calibrate gyros or barometer, at once, or keep the old calibration of accelerometers and compasses.

    FIRMWARE PARITY: levelling, the guided accelerometer calibration and the compass-motor calibration do not exist
    here.

    Source: GCS_MAVLINK::_handle_command_preflight_calibration.
    """
    texts = ctx.vehicle.texts
    if ctx.vehicle.copter.is_armed():
        texts.send_text(_MAV_SEVERITY_NOTICE, "Disarm to allow calibration")
        return MavResult.FAILED
    if is_equal(f32(command.param1), _ONE):
        return MavResult.ACCEPTED
    if is_equal(f32(command.param3), _ONE):
        texts.send_text(_MAV_SEVERITY_INFO, "Updating barometer calibration")
        texts.send_text(_MAV_SEVERITY_INFO, "Barometer calibration complete")
        return _calibrate_airspeed(ctx) if ctx.vehicle.release.calibrates_in_steps else MavResult.ACCEPTED
    keeps_old = command.x == FORCE_SAVE_CALIBRATION or is_equal(f32(command.param2), f32(FORCE_SAVE_CALIBRATION))
    return MavResult.ACCEPTED if keeps_old else MavResult.UNSUPPORTED


def _calibrate_airspeed(ctx: Context) -> MavResult:
    # GCS_MAVLINK::_handle_command_preflight_calibration_baro, GCS_MAVLINK_InProgress
    endpoint = ctx.vehicle.endpoint
    if endpoint.calibrating is not None:
        return MavResult.TEMPORARILY_REJECTED
    endpoint.calibrating = ctx.channel, ctx.header
    return MavResult.IN_PROGRESS
