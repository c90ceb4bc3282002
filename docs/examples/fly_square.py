# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Take off, fly a square of 4 m, land: a stock pymavlink script for GUIDED.

Usage: fly_square.py CONNECTION, for example: fly_square.py tcp:127.0.0.1:5760
"""

import math
import sys
import time

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

link = mavutil.mavlink_connection(sys.argv[1], source_system=255, source_component=190)
link.wait_heartbeat()
link.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_POSITION, 10, 1)
while not link.recv_match(type="GPS_GLOBAL_ORIGIN", blocking=True, timeout=1):  # until the filter takes it
    link.mav.set_gps_global_origin_send(1, 473977420, 85455940, 488000)


def command(number, *params):
    """Send a command again and again until it is accepted."""
    while True:
        link.mav.command_long_send(1, 1, number, 0, *params, *[0] * (7 - len(params)))
        while (ack := link.recv_match(type="COMMAND_ACK", blocking=True, timeout=2)) and ack.command != number:
            pass
        if ack and ack.result == mavlink.MAV_RESULT_ACCEPTED:
            return
        time.sleep(1)


def wait_for(north, east, down):
    """Wait until the vehicle is at a place."""
    while True:
        at = link.recv_match(type="LOCAL_POSITION_NED", blocking=True)
        if math.dist((at.x, at.y, at.z), (north, east, down)) < 0.3:
            print(f"at {at.x:.1f} north, {at.y:.1f} east, {-at.z:.1f} up")
            return


command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 4)  # GUIDED
command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 2)
wait_for(0, 0, -2)
for north, east in ((4, 0), (4, 4), (0, 4), (0, 0)):
    position_alone = 0b110111111000
    link.mav.set_position_target_local_ned_send(0, 1, 1, 1, position_alone, north, east, -2, *[0] * 8)
    wait_for(north, east, -2)
command(mavlink.MAV_CMD_NAV_LAND)
link.motors_disarmed_wait()
print("landed")
