# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All commands, one row each."""

from collections.abc import Callable, Mapping
from typing import Final

from mav_handlers.context import Context
from mav_handlers.handlers.commands.arming import component_arm_disarm, run_prearm_checks
from mav_handlers.handlers.commands.aux_functions import do_aux_function, set_ekf_source_set
from mav_handlers.handlers.commands.home import (
    do_set_global_origin,
    do_set_home,
    external_position_estimate,
    external_wind_estimate,
    get_home_position,
)
from mav_handlers.handlers.commands.message_intervals import (
    get_message_interval,
    request_message,
    set_message_interval,
)
from mav_handlers.handlers.commands.modes import (
    do_set_mode,
    mission_start,
    nav_land,
    nav_loiter_unlim,
    nav_return_to_launch,
    nav_takeoff,
)
from mav_handlers.handlers.commands.results import MavCmd, MavResult
from mav_handlers.handlers.commands.system import (
    do_send_banner,
    preflight_calibration,
    preflight_reboot_shutdown,
    preflight_storage,
    request_autopilot_capabilities,
)
from mav_handlers.wire.messages import COMMAND_INT

CommandHandler = Callable[[Context, COMMAND_INT], MavResult]

COMMANDS: Final[Mapping[int, CommandHandler]] = {
    MavCmd.NAV_LOITER_UNLIM: nav_loiter_unlim,
    MavCmd.NAV_RETURN_TO_LAUNCH: nav_return_to_launch,
    MavCmd.NAV_LAND: nav_land,
    MavCmd.NAV_TAKEOFF: nav_takeoff,
    MavCmd.NAV_VTOL_TAKEOFF: nav_takeoff,
    MavCmd.NAV_VTOL_LAND: nav_land,
    MavCmd.DO_SET_MODE: do_set_mode,
    MavCmd.DO_SET_HOME: do_set_home,
    MavCmd.DO_AUX_FUNCTION: do_aux_function,
    MavCmd.PREFLIGHT_CALIBRATION: preflight_calibration,
    MavCmd.PREFLIGHT_STORAGE: preflight_storage,
    MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: preflight_reboot_shutdown,
    MavCmd.MISSION_START: mission_start,
    MavCmd.COMPONENT_ARM_DISARM: component_arm_disarm,
    MavCmd.RUN_PREARM_CHECKS: run_prearm_checks,
    MavCmd.GET_HOME_POSITION: get_home_position,
    MavCmd.GET_MESSAGE_INTERVAL: get_message_interval,
    MavCmd.SET_MESSAGE_INTERVAL: set_message_interval,
    MavCmd.REQUEST_MESSAGE: request_message,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: request_autopilot_capabilities,
    MavCmd.DO_SET_GLOBAL_ORIGIN: do_set_global_origin,
    MavCmd.SET_EKF_SOURCE_SET: set_ekf_source_set,
    MavCmd.DO_SEND_BANNER: do_send_banner,
    MavCmd.EXTERNAL_POSITION_ESTIMATE: external_position_estimate,
    MavCmd.EXTERNAL_WIND_ESTIMATE: external_wind_estimate,
}
