# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All commands, one row each."""

from collections.abc import Callable, Mapping
from typing import Final

from mav_handlers.context import Context
from mav_handlers.handlers.commands import arming, aux_functions, flight, home, message_intervals, modes, system
from mav_handlers.handlers.commands.results import MavCmd, MavResult
from mav_handlers.wire.messages import COMMAND_INT

CommandHandler = Callable[[Context, COMMAND_INT], MavResult]

COMMANDS: Final[Mapping[int, CommandHandler]] = {
    MavCmd.NAV_LOITER_UNLIM: modes.entering(modes.LOITER),
    MavCmd.NAV_RETURN_TO_LAUNCH: modes.entering(modes.RTL),
    MavCmd.NAV_LAND: modes.entering(modes.LAND),
    MavCmd.NAV_TAKEOFF: modes.nav_takeoff,
    MavCmd.NAV_VTOL_TAKEOFF: modes.nav_takeoff,
    MavCmd.NAV_VTOL_LAND: modes.entering(modes.LAND),
    MavCmd.CONDITION_YAW: flight.condition_yaw,
    MavCmd.DO_SET_MODE: modes.do_set_mode,
    MavCmd.DO_CHANGE_SPEED: flight.do_change_speed,
    MavCmd.DO_SET_HOME: home.do_set_home,
    MavCmd.DO_REPOSITION: flight.do_reposition,
    MavCmd.DO_AUX_FUNCTION: aux_functions.do_aux_function,
    MavCmd.PREFLIGHT_CALIBRATION: system.preflight_calibration,
    MavCmd.PREFLIGHT_STORAGE: system.preflight_storage,
    MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: system.preflight_reboot_shutdown,
    MavCmd.MISSION_START: modes.mission_start,
    MavCmd.COMPONENT_ARM_DISARM: arming.component_arm_disarm,
    MavCmd.RUN_PREARM_CHECKS: arming.run_prearm_checks,
    MavCmd.GET_HOME_POSITION: home.get_home_position,
    MavCmd.GET_MESSAGE_INTERVAL: message_intervals.get_message_interval,
    MavCmd.SET_MESSAGE_INTERVAL: message_intervals.set_message_interval,
    MavCmd.REQUEST_MESSAGE: message_intervals.request_message,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: system.request_autopilot_capabilities,
    MavCmd.DO_SET_GLOBAL_ORIGIN: home.do_set_global_origin,
    MavCmd.SET_EKF_SOURCE_SET: aux_functions.set_ekf_source_set,
    MavCmd.DO_SEND_BANNER: system.do_send_banner,
    MavCmd.EXTERNAL_POSITION_ESTIMATE: home.external_position_estimate,
    MavCmd.EXTERNAL_WIND_ESTIMATE: home.external_wind_estimate,
}
