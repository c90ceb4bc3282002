# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of received messages, one row a message."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from ap_core.verdict import Verdict
from mav_handlers.context import Context
from mav_handlers.handlers.clocks import handle_system_time, handle_timesync
from mav_handlers.handlers.commands import handle_command_int, handle_command_long
from mav_handlers.handlers.hil import handle_hil_sensor, handle_hil_state_quaternion
from mav_handlers.handlers.missions import (
    handle_mission_clear_all,
    handle_mission_count,
    handle_mission_item,
    handle_mission_request,
    handle_mission_request_int,
    handle_mission_request_list,
    handle_mission_write_partial_list,
)
from mav_handlers.handlers.modes import handle_set_mode
from mav_handlers.handlers.neighbours import (
    handle_adsb_vehicle,
    handle_distance_sensor,
    handle_gps_input,
    handle_landing_target,
    handle_named_value_float,
    handle_optical_flow,
)
from mav_handlers.handlers.origin import handle_set_gps_global_origin
from mav_handlers.handlers.others import (
    handle_autopilot_version_request,
    handle_heartbeat,
    handle_radio_status,
    handle_request_data_stream,
    handle_statustext,
)
from mav_handlers.handlers.params import handle_param_request_list, handle_param_request_read, handle_param_set
from mav_handlers.handlers.transfers import (
    handle_file_transfer_protocol,
    handle_log_erase,
    handle_log_request_data,
    handle_log_request_end,
    handle_log_request_list,
    handle_setup_signing,
)
from mav_handlers.handlers.vision import (
    handle_att_pos_mocap,
    handle_odometry,
    handle_vision_position_delta,
    handle_vision_position_estimate,
    handle_vision_speed_estimate,
)
from mav_handlers.wire import messages as m

VISION_HANDLERS: Final[Mapping[type[m.Message], Callable[[Context, Any], Verdict]]] = {
    m.VISION_POSITION_ESTIMATE: handle_vision_position_estimate,
    m.GLOBAL_VISION_POSITION_ESTIMATE: handle_vision_position_estimate,
    m.VICON_POSITION_ESTIMATE: handle_vision_position_estimate,
    m.ATT_POS_MOCAP: handle_att_pos_mocap,
    m.ODOMETRY: handle_odometry,
    m.VISION_SPEED_ESTIMATE: handle_vision_speed_estimate,
    m.VISION_POSITION_DELTA: handle_vision_position_delta,
}

VISION_MESSAGES: Final = frozenset(VISION_HANDLERS)

HANDLERS: Final[Mapping[type[m.Message], Callable[[Context, Any], Verdict]]] = {
    **VISION_HANDLERS,
    m.HEARTBEAT: handle_heartbeat,
    m.TIMESYNC: handle_timesync,
    m.SYSTEM_TIME: handle_system_time,
    m.PARAM_REQUEST_LIST: handle_param_request_list,
    m.PARAM_REQUEST_READ: handle_param_request_read,
    m.PARAM_SET: handle_param_set,
    m.SET_GPS_GLOBAL_ORIGIN: handle_set_gps_global_origin,
    m.COMMAND_LONG: handle_command_long,
    m.COMMAND_INT: handle_command_int,
    m.REQUEST_DATA_STREAM: handle_request_data_stream,
    m.AUTOPILOT_VERSION_REQUEST: handle_autopilot_version_request,
    m.SET_MODE: handle_set_mode,
    m.MISSION_REQUEST_LIST: handle_mission_request_list,
    m.MISSION_REQUEST: handle_mission_request,
    m.MISSION_REQUEST_INT: handle_mission_request_int,
    m.MISSION_COUNT: handle_mission_count,
    m.MISSION_CLEAR_ALL: handle_mission_clear_all,
    m.MISSION_WRITE_PARTIAL_LIST: handle_mission_write_partial_list,
    m.MISSION_ITEM: handle_mission_item,
    m.MISSION_ITEM_INT: handle_mission_item,
    m.STATUSTEXT: handle_statustext,
    m.RADIO_STATUS: handle_radio_status,
    m.RADIO: handle_radio_status,
    m.GPS_INPUT: handle_gps_input,
    m.OPTICAL_FLOW: handle_optical_flow,
    m.LANDING_TARGET: handle_landing_target,
    m.DISTANCE_SENSOR: handle_distance_sensor,
    m.ADSB_VEHICLE: handle_adsb_vehicle,
    m.NAMED_VALUE_FLOAT: handle_named_value_float,
    m.HIL_SENSOR: handle_hil_sensor,
    m.HIL_STATE_QUATERNION: handle_hil_state_quaternion,
    m.FILE_TRANSFER_PROTOCOL: handle_file_transfer_protocol,
    m.LOG_REQUEST_LIST: handle_log_request_list,
    m.LOG_REQUEST_DATA: handle_log_request_data,
    m.LOG_REQUEST_END: handle_log_request_end,
    m.LOG_ERASE: handle_log_erase,
    m.SETUP_SIGNING: handle_setup_signing,
}

# Messages that the endpoint knows and, like the firmware, does not act on when somebody else sends them.
IGNORED: Final[frozenset[type[m.Message]]] = frozenset(
    {
        m.AHRS,
        m.AHRS2,
        m.ATTITUDE,
        m.ATTITUDE_QUATERNION,
        m.AUTOPILOT_VERSION,
        m.AVAILABLE_MODES,
        m.AVAILABLE_MODES_MONITOR,
        m.BATTERY_STATUS,
        m.COMMAND_ACK,
        m.EKF_STATUS_REPORT,
        m.EXTENDED_SYS_STATE,
        m.GLOBAL_POSITION_INT,
        m.GPS_GLOBAL_ORIGIN,
        m.GPS_RAW_INT,
        m.HIGHRES_IMU,
        m.HOME_POSITION,
        m.HWSTATUS,
        m.LOCAL_POSITION_NED,
        m.LOG_DATA,
        m.LOG_ENTRY,
        m.MEMINFO,
        m.MESSAGE_INTERVAL,
        m.MISSION_ACK,
        m.MISSION_CURRENT,
        m.NAV_CONTROLLER_OUTPUT,
        m.PARAM_ERROR,
        m.PARAM_VALUE,
        m.POWER_STATUS,
        m.RAW_IMU,
        m.RC_CHANNELS,
        m.RC_CHANNELS_RAW,
        m.SCALED_IMU,
        m.SCALED_IMU2,
        m.SCALED_IMU3,
        m.SCALED_PRESSURE,
        m.SCALED_PRESSURE2,
        m.SERVO_OUTPUT_RAW,
        m.SET_HOME_POSITION,
        m.SYS_STATUS,
        m.VFR_HUD,
        m.VIBRATION,
    }
)
