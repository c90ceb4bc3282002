# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules by which the endpoint decides about a frame or a message."""

from collections.abc import Mapping
from typing import Final

from ap_core.verdict import Rule, Verdict, VerdictKind, dropped
from ap_visualodom import verdicts as port
from mav_handlers.wire.codec import Defect
from mav_handlers.wire.signature import Refusal

_SIGNATURE_CHECK: Final = "mavlink_helpers.h, mavlink_signature_check"
_SIGNING_SETUP: Final = "GCS_Signing.cpp, GCS_MAVLINK::handle_setup_signing"
_LOG_FILE: Final = "AP_Logger_MAVLinkLogTransfer.cpp"
_LOG_LIST: Final = f"{_LOG_FILE}, handle_log_request_list"
_LOG_DATA: Final = f"{_LOG_FILE}, handle_log_request_data"
_LOG_MESSAGE: Final = f"{_LOG_FILE}, handle_log_message"

HANDLED: Final = Verdict(
    VerdictKind.HANDLED, Rule("handled", "processed; carries no external navigation", "GCS_Common.cpp, handle_message")
)
ODOMETRY_FRAMES: Final = dropped(
    "odometry_frames",
    "frame_id must be 20 (LOCAL_FRD) and child_frame_id 12 (BODY_FRD)",
    "GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
)
OWN_MESSAGE: Final = dropped(
    "own_ids", "sent with the autopilot's own system and component id", "MAVLink_routing.cpp, check_and_forward"
)
NOT_ADDRESSED: Final = dropped(
    "other_target", "addressed to another system or component", "MAVLink_routing.cpp, check_and_forward"
)
NOT_ACCEPTED: Final = dropped(
    "not_from_gcs", "MAV_OPTIONS bit 0 admits only MAV_GCS_SYSID", "GCS_Common.cpp, GCS_MAVLINK::accept_packet"
)
NO_HANDLER: Final = dropped(
    "no_handler", "the autopilot does not act on this message", "GCS_Common.cpp, GCS_MAVLINK::handle_message"
)
UNKNOWN_MESSAGE: Final = dropped(
    "unknown_message", "a message id outside the dialect", "mavlink_helpers.h, mavlink_frame_char_buffer"
)
BAD_PREFIX: Final = dropped("bad_prefix", "bytes between frames", "mavlink_helpers.h, mavlink_frame_char_buffer")
BAD_CRC: Final = dropped(
    "bad_crc", "checksum does not match: damaged, or another dialect", "mavlink_helpers.h, mavlink_frame_char_buffer"
)
BAD_FRAME: Final = dropped(
    "bad_frame", "unknown flags, or a frame that does not decode", "mavlink_helpers.h, mavlink_frame_char_buffer"
)
PARAM_UNKNOWN: Final = dropped(
    "param_unknown", "no parameter of that name or index; the firmware is silent", "GCS_Param.cpp"
)
PARAM_NOT_FINITE: Final = dropped(
    "param_not_finite", "NaN or infinite value; the firmware is silent", "GCS_Param.cpp, handle_param_set"
)
PARAM_READ_ONLY: Final = dropped("param_read_only", "the parameter is read-only", "GCS_Param.cpp, handle_param_set")
PARAM_QUEUE_FULL: Final = dropped(
    "param_queue_full", "20 parameter reads are waiting already", "GCS_Param.cpp, handle_param_request_read"
)
ORIGIN_REFUSED: Final = dropped(
    "origin_refused",
    "out of range, all zero, or the origin is set already",
    "GCS_Common.cpp, GCS_MAVLINK::handle_set_gps_global_origin",
)
GPS_NOT_MAVLINK: Final = dropped(
    "gps_not_mavlink", "no GPS takes it: GPS1_TYPE is not 14, or booting is not over", "AP_GPS.cpp, AP_GPS::handle_msg"
)
GPS_OTHER_INSTANCE: Final = dropped(
    "gps_other_instance", "gps_id is not 0, and no other GPS takes messages", "AP_GPS_MAV.cpp, AP_GPS_MAV::handle_msg"
)
NO_FLOW_SENSOR: Final = dropped(
    "no_flow_sensor",
    "no flow sensor takes it: FLOW_TYPE was not 5 at boot, or is 0 now",
    "AP_OpticalFlow.cpp, AP_OpticalFlow::handle_msg",
)
FLOW_NOT_READ: Final = dropped(
    "flow_not_read",
    "no release has a handler of it: OPTICAL_FLOW alone carries flow",
    "GCS_Common.cpp, GCS_MAVLINK::handle_message",
)
UNREAD_FLOW: Final = frozenset({"OPTICAL_FLOW_RAD", "HIL_OPTICAL_FLOW"})
"""The messages with that verdict."""
NO_PRECISION_LANDING: Final = dropped(
    "no_precision_landing",
    "precision landing is off; the time stamp went through the link's time correction all the same",
    "GCS_Common.cpp, GCS_MAVLINK::handle_landing_target",
)
NO_RANGEFINDER: Final = dropped(
    "no_rangefinder",
    "no range finder takes it: no RNGFNDn_TYPE was 10 at boot, it is 0 now, or RNGFNDn_ORIENT is not its orientation",
    "AP_RangeFinder_MAVLink.cpp, AP_RangeFinder_MAVLink::handle_msg",
)
ADSB_OFF: Final = dropped(
    "adsb_off", "aircraft are forwarded but not tracked, as ADSB_TYPE is 0", "AP_ADSB.cpp, AP_ADSB::handle_adsb_vehicle"
)
NO_HIL_INPUT: Final = dropped(
    "no_hil_input", "no HIL input; serve with --imu hil", "none: HIL is an input of the emulator's own"
)

NO_FLIGHT: Final = dropped(
    "no_flight", "nobody flies the vehicle; serve with --imu fly", "none: the vehicle has motors with --imu fly alone"
)
NOT_GUIDED: Final = dropped(
    "not_guided",
    "the mode is not GUIDED; the firmware is silent",
    "GCS_MAVLink_Copter.cpp, handle_message_set_position_target_local_ned",
)
TARGET_REFUSED: Final = dropped(
    "target_refused",
    "a frame, mask or number that GUIDED does not take; the vehicle stays where it is",
    "GCS_MAVLink_Copter.cpp, handle_message_set_position_target_local_ned",
)
MODE_REFUSED: Final = dropped(
    "mode_refused",
    "no such mode, or it may not be entered; a text says why",
    "GCS_Common.cpp, GCS_MAVLINK::_set_mode_common",
)
MISSION_TYPE: Final = dropped(
    "mission_type",
    "neither a mission nor a fence nor rally points",
    "GCS_Common.cpp, GCS_MAVLINK::handle_mission_request_int",
)
TF_FRAMES: Final = dropped(
    "tf_frames",
    "frame_id must be odom and child_frame_id base_link",
    "AP_DDS_External_Odom.cpp, AP_DDS_External_Odom::is_odometry_frame",
)
TF_EMPTY: Final = dropped("tf_empty", "no transform in the message", "AP_DDS_Client.cpp, AP_DDS_Client::on_topic")
TF_TOO_MANY: Final = dropped(
    "tf_too_many",
    "there is room for 8 transforms, and a message with more does not decode",
    "AP_DDS/wscript, CONTAINER_PREALLOC_SIZE",
)
TF_UNREADABLE: Final = dropped("tf_unreadable", "does not decode", "AP_DDS_Client.cpp, AP_DDS_Client::on_topic")
LOG_NOT_READY: Final = dropped("log_not_ready", "the logger does not write yet; the firmware is silent", _LOG_MESSAGE)
LOG_ARMED: Final = dropped("log_armed", "logs are sent only while disarmed", _LOG_MESSAGE)
LOG_BUSY: Final = dropped("log_busy", "a log transfer is under way", _LOG_LIST)
LOG_REPEATED: Final = dropped(
    "log_repeated", "this link's log transfer is under way; the firmware is silent", _LOG_DATA
)
LOG_UNKNOWN: Final = dropped("log_unknown", "there is no log of that id; the firmware is silent", _LOG_DATA)
UNSIGNED: Final = dropped(
    "unsigned", "a key is set and the frame is not signed", "GCS_Signing.cpp, accept_unsigned_callback"
)
BAD_SIGNATURE: Final = dropped("bad_signature", "signed with another key, or changed since", _SIGNATURE_CHECK)
SIGNATURE_REPLAYED: Final = dropped(
    "signature_replayed", "the sender has used this timestamp or a later one before", _SIGNATURE_CHECK
)
SIGNATURE_OLD: Final = dropped(
    "signature_old", "a new sender's timestamp is more than a minute behind the link's", _SIGNATURE_CHECK
)
SIGNATURE_STREAMS: Final = dropped("signature_streams", "16 other senders have signed frames already", _SIGNATURE_CHECK)
SETUP_WHILE_ARMED: Final = dropped("signing_armed", "a signing key is not accepted while armed", _SIGNING_SETUP)
KEY_NOT_SAVED: Final = dropped("signing_not_saved", "the signing key could not be stored", _SIGNING_SETUP)

ALL_VERDICTS: Final = (
    *port.VERDICTS,
    HANDLED,
    ODOMETRY_FRAMES,
    OWN_MESSAGE,
    NOT_ADDRESSED,
    NOT_ACCEPTED,
    NO_HANDLER,
    UNKNOWN_MESSAGE,
    BAD_PREFIX,
    BAD_CRC,
    BAD_FRAME,
    PARAM_UNKNOWN,
    PARAM_NOT_FINITE,
    PARAM_READ_ONLY,
    PARAM_QUEUE_FULL,
    ORIGIN_REFUSED,
    GPS_NOT_MAVLINK,
    GPS_OTHER_INSTANCE,
    NO_FLOW_SENSOR,
    FLOW_NOT_READ,
    NO_PRECISION_LANDING,
    NO_RANGEFINDER,
    ADSB_OFF,
    NO_HIL_INPUT,
    NO_FLIGHT,
    NOT_GUIDED,
    TARGET_REFUSED,
    MODE_REFUSED,
    MISSION_TYPE,
    TF_FRAMES,
    TF_EMPTY,
    TF_TOO_MANY,
    TF_UNREADABLE,
    LOG_NOT_READY,
    LOG_ARMED,
    LOG_BUSY,
    LOG_REPEATED,
    LOG_UNKNOWN,
    UNSIGNED,
    BAD_SIGNATURE,
    SIGNATURE_REPLAYED,
    SIGNATURE_OLD,
    SIGNATURE_STREAMS,
    SETUP_WHILE_ARMED,
    KEY_NOT_SAVED,
)
"""Every verdict that a message can get, in the order in which they are defined."""

BAD_DATA_VERDICTS: Final[Mapping[Defect | Refusal, Verdict]] = {
    Defect.PREFIX: BAD_PREFIX,
    Defect.CRC: BAD_CRC,
    Defect.FLAGS: BAD_FRAME,
    Refusal.UNSIGNED: UNSIGNED,
    Refusal.BAD_SIGNATURE: BAD_SIGNATURE,
    Refusal.REPLAYED: SIGNATURE_REPLAYED,
    Refusal.OLD_TIMESTAMP: SIGNATURE_OLD,
    Refusal.TOO_MANY_STREAMS: SIGNATURE_STREAMS,
}
"""By the reason of BadData."""
