# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of received messages, one row a message."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from ap_core.verdict import Verdict
from mav_handlers.context import Context
from mav_handlers.handlers.clocks import handle_system_time, handle_timesync
from mav_handlers.handlers.commands import handle_command_int, handle_command_long
from mav_handlers.handlers.origin import handle_set_gps_global_origin
from mav_handlers.handlers.others import (
    handle_autopilot_version_request,
    handle_heartbeat,
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
    m.STATUSTEXT: handle_statustext,
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
        m.ATTITUDE,
        m.AUTOPILOT_VERSION,
        m.COMMAND_ACK,
        m.GPS_GLOBAL_ORIGIN,
        m.HOME_POSITION,
        m.LOCAL_POSITION_NED,
        m.LOG_DATA,
        m.LOG_ENTRY,
        m.MESSAGE_INTERVAL,
        m.NAMED_VALUE_FLOAT,
        m.PARAM_VALUE,
        m.RADIO_STATUS,
        m.SET_MODE,
        m.SYS_STATUS,
    }
)
