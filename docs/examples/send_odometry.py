# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Send a camera's pose to the autopilot: a stock pymavlink script.

Usage: send_odometry.py CONNECTION [SECONDS], for example: send_odometry.py tcp:127.0.0.1:5760
"""

import sys
import time

from pymavlink import mavutil

link = mavutil.mavlink_connection(sys.argv[1], source_system=1, source_component=197)
link.wait_heartbeat()
covariance = [0.0] * 21
end = time.monotonic() + float(sys.argv[2] if len(sys.argv) > 2 else 10)
while time.monotonic() < end:
    stamp_us = time.monotonic_ns() // 1000  # any epoch will do
    pose = (0.0, 0.0, -1.0, [1.0, 0.0, 0.0, 0.0])
    still = (0.0,) * 6
    # frame_id 20 is LOCAL_FRD, child_frame_id 12 is BODY_FRD: the only pair that the firmware takes
    link.mav.odometry_send(stamp_us, 20, 12, *pose, *still, covariance, covariance, 0, 3, 100)
    time.sleep(1 / 30)
