# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A session with MAVSDK 3, in its own environment: argument 1 is its connection, the last line a report in JSON."""

import asyncio
import json
import socket
import sys
import time
from collections.abc import Awaitable
from typing import Any

from mavsdk_grpc import System  # type: ignore[import-not-found]
from mavsdk_grpc.action import ActionError  # type: ignore[import-not-found]
from mavsdk_grpc.mocap import (  # type: ignore[import-not-found]
    AngularVelocityBody,
    Covariance,
    Odometry,
    PositionBody,
    Quaternion,
    SpeedBody,
)
from mavsdk_grpc.param import ParamError  # type: ignore[import-not-found]
from mavsdk_grpc.telemetry import TelemetryError  # type: ignore[import-not-found]

LIMIT_S = 30.0
RATE_HZ = 30
RATES = ("attitude_euler", "position_velocity_ned", "in_air", "landed_state")
UNKNOWN = Covariance([float("nan")])


def free_port() -> int:
    """Return a port of loopback that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


async def refused(call: Awaitable[Any]) -> str:
    """Wait for a call, and return why it was refused, or an empty text."""
    try:
        await call
    except (ActionError, ParamError, TelemetryError) as error:
        return str(error._result.result.name)
    return ""


def odometry() -> Any:
    """Return a sample: level, at rest, at the origin, stamped now."""
    body = (PositionBody(0.0, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0), SpeedBody(0.0, 0.0, 0.0))
    turning = AngularVelocityBody(0.0, 0.0, 0.0)
    told = (turning, UNKNOWN, UNKNOWN, 0, Odometry.MavEstimatorType.VIO, 90)
    return Odometry(time.monotonic_ns() // 1000, Odometry.MavFrame.LOCAL_FRD, *body, *told)


async def arm_with_vision(drone: Any) -> str:
    """Send ODOMETRY at 30 Hz, ask for arming every second, and return the last refusal, or an empty text."""
    why = "never asked"
    for sample in range(int(LIMIT_S * RATE_HZ)):
        await drone.mocap.set_odometry(odometry())
        if sample % RATE_HZ == RATE_HZ - 1 and not (why := await refused(drone.action.arm())):
            break
        await asyncio.sleep(1 / RATE_HZ)
    return why


async def fly(drone: Any) -> dict[str, Any]:
    """Do what a companion's program does, and return what it met."""
    param = drone.param
    met: dict[str, Any] = {
        "set": await refused(param.set_param_int("VISO_DELAY_MS", 35)),
        "read": await param.get_param_int("VISO_DELAY_MS"),
        "set_float": await refused(param.set_param_float("VISO_POS_M_NSE", 0.5)),
        "set_to_its_default": await refused(param.set_param_int("EK3_ENABLE", await param.get_param_int("EK3_ENABLE"))),
        "rates": {name: await refused(getattr(drone.telemetry, f"set_rate_{name}")(10.0)) for name in RATES},
    }
    every = await param.get_all_params()
    met["list"] = len(every.int_params) + len(every.float_params)
    version = await drone.info.get_version()
    met["version"] = [version.flight_sw_major, version.flight_sw_minor]
    met["refusal"] = await refused(drone.action.arm())
    met["refusal_with_vision"] = await arm_with_vision(drone)
    met["disarm_refusal"] = await refused(drone.action.disarm())
    return met


async def main() -> None:
    """Connect, fly, and print what was met."""
    drone = System(port=free_port(), sysid=1, compid=191)  # of its server, which another program's may have taken
    await drone.connect(system_address=sys.argv[1])
    async for state in drone.core.connection_state():
        if state.is_connected:
            break
    print("\n" + json.dumps(await fly(drone)))  # the server may just have begun a line of its own


if __name__ == "__main__":
    asyncio.run(main())
