# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which messages the vehicle can send: one row a message, and the groups that are streamed together.

Source: GCS_MAVLink/ap_message.h for the order, GCS_MAVLINK::mavlink_id_to_ap_message_id for what there is (the
simulator's build), GCS_MAVLink/GCS_MAVLink_Parameters.cpp for the groups.
"""

from collections.abc import Mapping
from typing import Final

from mav_handlers.senders.attitude import ahrs, ahrs2, attitude, attitude_quaternion, ekf_status_report
from mav_handlers.senders.available_modes import available_modes, available_modes_monitor
from mav_handlers.senders.builder import Builder, nothing_to_report
from mav_handlers.senders.gps import gps_raw_int
from mav_handlers.senders.inertial import (
    highres_imu,
    raw_imu,
    scaled_imu,
    scaled_imu2,
    scaled_imu3,
    scaled_pressure,
    scaled_pressure2,
    vibration,
)
from mav_handlers.senders.parked import (
    battery_status,
    hwstatus,
    meminfo,
    mission_current,
    nav_controller_output,
    power_status,
    rc_channels,
    rc_channels_raw,
    servo_output_raw,
)
from mav_handlers.senders.position import (
    global_position_int,
    gps_global_origin,
    home_position,
    local_position_ned,
    vfr_hud,
)
from mav_handlers.senders.status import autopilot_version, extended_sys_state, heartbeat, system_time
from mav_handlers.senders.sys_status import sys_status

# FIRMWARE PARITY: the firmware has something to say in some of the rows that have nothing to report here.
SENDERS: Final[Mapping[str, Builder]] = {
    "HEARTBEAT": heartbeat,
    "AHRS": ahrs,
    "AHRS2": ahrs2,
    "ATTITUDE": attitude,
    "ATTITUDE_QUATERNION": attitude_quaternion,
    "GLOBAL_POSITION_INT": global_position_int,
    "VFR_HUD": vfr_hud,
    "SYS_STATUS": sys_status,
    "POWER_STATUS": power_status,
    "MEMINFO": meminfo,
    "NAV_CONTROLLER_OUTPUT": nav_controller_output,
    "MISSION_CURRENT": mission_current,
    "SERVO_OUTPUT_RAW": servo_output_raw,
    "RC_CHANNELS": rc_channels,
    "RC_CHANNELS_RAW": rc_channels_raw,
    "RAW_IMU": raw_imu,
    "SCALED_IMU": scaled_imu,
    "SCALED_IMU2": scaled_imu2,
    "SCALED_IMU3": scaled_imu3,
    "SCALED_PRESSURE": scaled_pressure,
    "SCALED_PRESSURE2": scaled_pressure2,
    "SCALED_PRESSURE3": nothing_to_report,
    "GPS_RAW_INT": gps_raw_int,
    "GPS_RTK": nothing_to_report,
    "GPS2_RAW": nothing_to_report,
    "GPS2_RTK": nothing_to_report,
    "SYSTEM_TIME": system_time,
    "PARAM_VALUE": nothing_to_report,
    "FENCE_STATUS": nothing_to_report,
    "SIMSTATE": nothing_to_report,
    "SIM_STATE": nothing_to_report,
    "HWSTATUS": hwstatus,
    "WIND": nothing_to_report,
    "RANGEFINDER": nothing_to_report,
    "DISTANCE_SENSOR": nothing_to_report,
    "TERRAIN_REQUEST": nothing_to_report,
    "TERRAIN_REPORT": nothing_to_report,
    "CAMERA_FEEDBACK": nothing_to_report,
    "CAMERA_INFORMATION": nothing_to_report,
    "CAMERA_SETTINGS": nothing_to_report,
    "CAMERA_FOV_STATUS": nothing_to_report,
    "CAMERA_CAPTURE_STATUS": nothing_to_report,
    "CAMERA_THERMAL_RANGE": nothing_to_report,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": nothing_to_report,
    "GIMBAL_MANAGER_INFORMATION": nothing_to_report,
    "GIMBAL_MANAGER_STATUS": nothing_to_report,
    "VIDEO_STREAM_INFORMATION": nothing_to_report,
    "OPTICAL_FLOW": nothing_to_report,
    "MAG_CAL_PROGRESS": nothing_to_report,
    "MAG_CAL_REPORT": nothing_to_report,
    "EKF_STATUS_REPORT": ekf_status_report,
    "LOCAL_POSITION_NED": local_position_ned,
    "PID_TUNING": nothing_to_report,
    "VIBRATION": vibration,
    "RPM": nothing_to_report,
    "MISSION_ITEM_REACHED": nothing_to_report,
    "POSITION_TARGET_GLOBAL_INT": nothing_to_report,
    "POSITION_TARGET_LOCAL_NED": nothing_to_report,
    "ADSB_VEHICLE": nothing_to_report,
    "BATTERY_STATUS": battery_status,
    "ESC_TELEMETRY_1_TO_4": nothing_to_report,
    "GPS_GLOBAL_ORIGIN": gps_global_origin,
    "HOME_POSITION": home_position,
    "EXTENDED_SYS_STATE": extended_sys_state,
    "AUTOPILOT_VERSION": autopilot_version,
    "EFI_STATUS": nothing_to_report,
    "GENERATOR_STATUS": nothing_to_report,
    "WINCH_STATUS": nothing_to_report,
    "HIGH_LATENCY2": nothing_to_report,
    "AIS_VESSEL": nothing_to_report,
    "UAVIONIX_ADSB_OUT_STATUS": nothing_to_report,
    "ATTITUDE_TARGET": nothing_to_report,
    "AUTOPILOT_STATE_FOR_GIMBAL_DEVICE": nothing_to_report,
    "RELAY_STATUS": nothing_to_report,
    "HIGHRES_IMU": highres_imu,
    "AIRSPEED": nothing_to_report,
    "AVAILABLE_MODES": available_modes,
    "AVAILABLE_MODES_MONITOR": available_modes_monitor,
    "FLIGHT_INFORMATION": nothing_to_report,
}

PLACEHOLDERS: Final = frozenset(
    {
        "BATTERY_STATUS",
        "HIGHRES_IMU",
        "HWSTATUS",
        "MEMINFO",
        "MISSION_CURRENT",
        "NAV_CONTROLLER_OUTPUT",
        "POWER_STATUS",
        "RAW_IMU",
        "RC_CHANNELS",
        "RC_CHANNELS_RAW",
        "SCALED_IMU",
        "SCALED_IMU2",
        "SCALED_IMU3",
        "SCALED_PRESSURE",
        "SCALED_PRESSURE2",
        "SERVO_OUTPUT_RAW",
        "VIBRATION",
    }
)
"""Messages whose content is that of a vehicle parked in the reference simulator, whatever happens here."""

# Messages of each stream group, by the id that REQUEST_DATA_STREAM uses and the parameter that holds its rate.
STREAM_GROUPS: Final[Mapping[int, tuple[str, tuple[str, ...]]]] = {
    1: (
        "_RAW_SENS",
        (
            "RAW_IMU",
            "SCALED_IMU2",
            "SCALED_IMU3",
            "SCALED_PRESSURE",
            "SCALED_PRESSURE2",
            "SCALED_PRESSURE3",
            "AIRSPEED",
        ),
    ),
    2: (
        "_EXT_STAT",
        (
            "SYS_STATUS",
            "POWER_STATUS",
            "MEMINFO",
            "MISSION_CURRENT",
            "GPS_RAW_INT",
            "GPS_RTK",
            "GPS2_RAW",
            "GPS2_RTK",
            "NAV_CONTROLLER_OUTPUT",
            "FENCE_STATUS",
            "POSITION_TARGET_GLOBAL_INT",
        ),
    ),
    3: ("_RC_CHAN", ("SERVO_OUTPUT_RAW", "RC_CHANNELS", "RC_CHANNELS_RAW")),
    4: ("_RAW_CTRL", ()),
    6: ("_POSITION", ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED")),
    10: (
        "_EXTRA1",
        (
            "ATTITUDE",
            "SIMSTATE",
            "AHRS2",
            "RPM",
            "PID_TUNING",
            "ESC_TELEMETRY_1_TO_4",
            "GENERATOR_STATUS",
            "WINCH_STATUS",
            "EFI_STATUS",
        ),
    ),
    11: ("_EXTRA2", ("VFR_HUD",)),
    12: (
        "_EXTRA3",
        (
            "AHRS",
            "WIND",
            "RANGEFINDER",
            "DISTANCE_SENSOR",
            "SYSTEM_TIME",
            "TERRAIN_REPORT",
            "TERRAIN_REQUEST",
            "BATTERY_STATUS",
            "GIMBAL_DEVICE_ATTITUDE_STATUS",
            "OPTICAL_FLOW",
            "MAG_CAL_REPORT",
            "MAG_CAL_PROGRESS",
            "EKF_STATUS_REPORT",
            "VIBRATION",
        ),
    ),
}
