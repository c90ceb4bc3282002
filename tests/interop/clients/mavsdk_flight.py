# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight with MAVSDK, in its own environment: argument 1 is its connection, the last line a report in JSON."""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk  # type: ignore[import-not-found]
from mavsdk.plugins.action import Action, ActionError  # type: ignore[import-not-found]
from mavsdk.plugins.offboard import Offboard, PositionNedYaw  # type: ignore[import-not-found]
from mavsdk.plugins.telemetry import Telemetry  # type: ignore[import-not-found]

LIMIT_S = 25.0
HEIGHT_M = 2.0


def again(call: Callable[[], Any]) -> None:
    """Ask until it is done, as a vehicle that boots refuses at first."""
    end_s = time.monotonic() + LIMIT_S
    while True:
        try:
            call()
        except ActionError:
            if time.monotonic() > end_s:
                raise
            time.sleep(1.0)
        else:
            return


def main() -> None:
    """Take off, go 4 m north by offboard control, land, and print how far it went."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    system = mavsdk_system(mavsdk)
    telemetry, action, offboard = Telemetry(system), Action(system), Offboard(system)
    places: list[Any] = []
    armed: list[bool] = []
    handles = [
        telemetry.subscribe_position_velocity_ned(lambda value, *_rest: places.append(value.position)),
        telemetry.subscribe_armed(lambda value, *_rest: armed.append(value)),
    ]
    telemetry.set_rate_position_velocity_ned(10.0)

    def until(done: Callable[[], bool]) -> None:
        end_s = time.monotonic() + LIMIT_S
        while not done():
            assert time.monotonic() < end_s, (places[-1:], armed[-1:])
            time.sleep(0.05)

    try:
        again(lambda: action.set_gps_global_origin(47.397742, 8.5455940, 488.0))
        action.set_takeoff_altitude(HEIGHT_M)
        again(action.arm)
        again(action.takeoff)
        until(lambda: bool(places) and places[-1].down_m < 0.2 - HEIGHT_M)
        offboard.set_position_ned(PositionNedYaw(4.0, 0.0, -HEIGHT_M, 0.0))
        offboard.start()
        until(lambda: places[-1].north_m > 3.8)
        offboard.stop()
        action.land()
        until(lambda: bool(armed) and not armed[-1])
        met = {
            "landed": True,
            "farthest_m": max(place.north_m for place in places),
            "highest_m": max(-place.down_m for place in places),
        }
        print("\n" + json.dumps(met))
    finally:
        del handles
        mavsdk.destroy()


def mavsdk_system(mavsdk: Any) -> Any:
    """Return the autopilot at the other end of the connection."""
    mavsdk.add_any_connection(sys.argv[1])
    return mavsdk.first_autopilot(LIMIT_S)


if __name__ == "__main__":
    main()
