# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight with dronekit2 as scripts for the firmware's simulator do it: argument 1 is its connection.

The last line is a report in JSON. The autopilot is to run five times as fast as the clock.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

from dronekit import LocationGlobalRelative, VehicleMode, connect  # type: ignore[import-not-found]

LIMIT_S = 40.0
CLIMB_M = 6.0
METRES_PER_DEGREE = 111_320.0


def wait_for(what: str, done: Callable[[], bool]) -> None:
    """Wait until something is so."""
    end_s = time.monotonic() + LIMIT_S
    while not done():
        if time.monotonic() > end_s:
            raise TimeoutError(f"{what}: not within {LIMIT_S} s")
        time.sleep(0.05)


def fly(vehicle: Any) -> dict[str, Any]:
    """Take off, go 20 m to the north, return and land."""
    wait_for("armable", lambda: vehicle.is_armable)
    vehicle.mode = VehicleMode("GUIDED")
    wait_for("GUIDED", lambda: vehicle.mode.name == "GUIDED")
    vehicle.armed = True
    wait_for("armed", lambda: vehicle.armed)
    home = vehicle.location.global_relative_frame
    vehicle.simple_takeoff(CLIMB_M)
    wait_for("climb", lambda: vehicle.location.global_relative_frame.alt > 0.95 * CLIMB_M)
    vehicle.simple_goto(LocationGlobalRelative(home.lat + 20.0 / METRES_PER_DEGREE, home.lon, CLIMB_M))

    def north_m() -> float:
        return float(METRES_PER_DEGREE * (vehicle.location.global_relative_frame.lat - home.lat))

    wait_for("go to", lambda: north_m() > 19.0)
    vehicle.mode = VehicleMode("RTL")
    wait_for("landing", lambda: not vehicle.armed)
    return {"north_m": north_m(), "alt_m": vehicle.location.global_relative_frame.alt, "fix": vehicle.gps_0.fix_type}


def main() -> None:
    """Connect as the examples do, fly, and print what was met."""
    vehicle = connect(sys.argv[1], wait_ready=True, timeout=LIMIT_S)
    try:
        print(json.dumps(fly(vehicle)))
    finally:
        vehicle.close()


if __name__ == "__main__":
    main()
