# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print what the autopilot made of each pose in a DataFlash log.

Usage: read_log.py logs/00000001.BIN
"""

import sys

from pymavlink import mavutil

log = mavutil.mavlink_connection(sys.argv[1])
while (record := log.recv_match(type="VISP")) is not None:
    what = "withheld from the EKF" if record.Ign else "given to the EKF"
    lag_ms = record.TimeUS / 1000 - record.CTimeMS
    print(f"{record.TimeUS / 1e6:8.3f} s  n {record.PX:6.2f}  e {record.PY:6.2f}  d {record.PZ:6.2f} m", end="  ")
    print(f"quality {record.Q:3d}  lag {lag_ms:5.1f} ms  {what}")
