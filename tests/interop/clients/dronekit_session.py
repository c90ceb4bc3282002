# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A session with dronekit2, in its own environment: argument 1 is its connection, the last line a report in JSON."""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

from dronekit import VehicleMode, connect  # type: ignore[import-not-found]

LIMIT_S = 15.0
PERIOD_S = 1 / 30
POSES = 30


def until(done: Callable[[], bool]) -> bool:
    """Wait until something is so; say whether it became so in time."""
    end_s = time.monotonic() + LIMIT_S
    while not done() and time.monotonic() < end_s:
        time.sleep(PERIOD_S)
    return done()


def attributes(vehicle: Any) -> dict[str, Any]:
    """Return what a program reads first."""
    return {
        "version": str(vehicle.version),
        "mode": vehicle.mode.name,
        "armed": vehicle.armed,
        "status": vehicle.system_status.state,
        "yaw": vehicle.attitude.yaw,
        "fix": vehicle.gps_0.fix_type,
        "heading": vehicle.heading,
        "parameter": vehicle.parameters["VISO_TYPE"],
        "parameters": len(vehicle.parameters.keys()),
    }


def send_poses(vehicle: Any) -> None:
    """Send VISION_POSITION_ESTIMATE at 30 Hz for a second."""
    for _ in range(POSES):
        now_us = time.monotonic_ns() // 1000
        vehicle.send_mavlink(vehicle.message_factory.vision_position_estimate_encode(now_us, 0, 0, 0, 0, 0, 0))
        time.sleep(PERIOD_S)


def fly(vehicle: Any) -> dict[str, Any]:
    """Do what a script does, and return what it met."""
    until(lambda: vehicle.version.major is not None)  # asked for with each heartbeat, and no part of being ready
    met = attributes(vehicle)
    vehicle.parameters["VISO_DELAY_MS"] = 35
    met["delay_ms"] = vehicle.parameters["VISO_DELAY_MS"]
    vehicle.mode = VehicleMode("ALT_HOLD")
    met["changed_mode"] = until(lambda: vehicle.mode.name == "ALT_HOLD")
    vehicle.mode = VehicleMode("STABILIZE")
    met["changed_back"] = until(lambda: vehicle.mode.name == "STABILIZE")
    send_poses(vehicle)
    return met


def main() -> None:
    """Connect as the examples do, fly, and print what was met."""
    vehicle = connect(sys.argv[1], wait_ready=True, timeout=LIMIT_S)
    try:
        print(json.dumps(fly(vehicle)))
    finally:
        vehicle.close()


if __name__ == "__main__":
    main()
