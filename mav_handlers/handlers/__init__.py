# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of received messages, one row a message."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.handlers import (
    clocks,
    commands,
    guided,
    missions,
    neighbours,
    others,
    params,
    radio,
    transfers,
    vision,
)
from mav_handlers.wire import messages as m

VISION_HANDLERS: Final[Mapping[type[m.Message], Callable[[Context, Any], Verdict]]] = {
    m.VISION_POSITION_ESTIMATE: vision.handle_vision_position_estimate,
    m.GLOBAL_VISION_POSITION_ESTIMATE: vision.handle_vision_position_estimate,
    m.VICON_POSITION_ESTIMATE: vision.handle_vision_position_estimate,
    m.ATT_POS_MOCAP: vision.handle_att_pos_mocap,
    m.ODOMETRY: vision.handle_odometry,
    m.VISION_SPEED_ESTIMATE: vision.handle_vision_speed_estimate,
    m.VISION_POSITION_DELTA: vision.handle_vision_position_delta,
}

VISION_MESSAGES: Final = frozenset(VISION_HANDLERS)
VISION_NAMES: Final = frozenset(cls.__name__ for cls in VISION_MESSAGES)
"""The names of the messages of external navigation."""

HANDLERS: Final[Mapping[type[m.Message], Callable[[Context, Any], Verdict]]] = {
    **VISION_HANDLERS,
    m.HEARTBEAT: others.handle_heartbeat,
    m.TIMESYNC: clocks.handle_timesync,
    m.SYSTEM_TIME: clocks.handle_system_time,
    m.PARAM_REQUEST_LIST: params.handle_param_request_list,
    m.PARAM_REQUEST_READ: params.handle_param_request_read,
    m.PARAM_SET: params.handle_param_set,
    m.SET_GPS_GLOBAL_ORIGIN: others.handle_set_gps_global_origin,
    m.COMMAND_LONG: commands.handle_command_long,
    m.COMMAND_INT: commands.handle_command_int,
    m.REQUEST_DATA_STREAM: others.handle_request_data_stream,
    m.AUTOPILOT_VERSION_REQUEST: others.handle_autopilot_version_request,
    m.SET_MODE: others.handle_set_mode,
    m.MISSION_REQUEST_LIST: missions.handle_mission_request_list,
    m.MISSION_REQUEST: missions.handle_mission_request,
    m.MISSION_REQUEST_INT: missions.handle_mission_request_int,
    m.MISSION_COUNT: missions.handle_mission_count,
    m.MISSION_CLEAR_ALL: missions.handle_mission_clear_all,
    m.MISSION_WRITE_PARTIAL_LIST: missions.handle_mission_write_partial_list,
    m.MISSION_SET_CURRENT: missions.handle_mission_set_current,
    m.MISSION_ITEM: missions.handle_mission_item,
    m.MISSION_ITEM_INT: missions.handle_mission_item,
    m.STATUSTEXT: others.handle_statustext,
    m.RADIO_STATUS: others.handle_radio_status,
    m.RADIO: others.handle_radio_status,
    m.GPS_INPUT: neighbours.handle_gps_input,
    m.OPTICAL_FLOW: neighbours.handle_optical_flow,
    m.LANDING_TARGET: neighbours.handle_landing_target,
    m.DISTANCE_SENSOR: neighbours.handle_distance_sensor,
    m.ADSB_VEHICLE: neighbours.handle_adsb_vehicle,
    m.NAMED_VALUE_FLOAT: neighbours.handle_named_value_float,
    m.SET_POSITION_TARGET_LOCAL_NED: guided.handle_set_position_target_local_ned,
    m.SET_POSITION_TARGET_GLOBAL_INT: guided.handle_set_position_target_global_int,
    m.RC_CHANNELS_OVERRIDE: radio.handle_rc_channels_override,
    m.HIL_SENSOR: neighbours.handle_hil_sensor,
    m.HIL_STATE_QUATERNION: neighbours.handle_hil_state_quaternion,
    m.FILE_TRANSFER_PROTOCOL: transfers.handle_file_transfer_protocol,
    m.LOG_REQUEST_LIST: transfers.handle_log_request_list,
    m.LOG_REQUEST_DATA: transfers.handle_log_request_data,
    m.LOG_REQUEST_END: transfers.handle_log_request_end,
    m.LOG_ERASE: transfers.handle_log_erase,
    m.SETUP_SIGNING: transfers.handle_setup_signing,
}
