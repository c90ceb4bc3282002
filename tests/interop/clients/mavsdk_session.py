# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A session with MAVSDK, in its own environment: argument 1 is its connection, the last line a report in JSON."""

import json
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk  # type: ignore[import-not-found]
from mavsdk.plugins.action import Action, ActionError  # type: ignore[import-not-found]
from mavsdk.plugins.info import Info  # type: ignore[import-not-found]
from mavsdk.plugins.mocap import (  # type: ignore[import-not-found]
    AngleBody,
    AngularVelocityBody,
    AttitudePositionMocap,
    Covariance,
    Mocap,
    Odometry,
    PositionBody,
    Quaternion,
    SpeedBody,
    SpeedNed,
    VisionPositionEstimate,
    VisionSpeedEstimate,
)
from mavsdk.plugins.param import Param  # type: ignore[import-not-found]
from mavsdk.plugins.telemetry import Telemetry, TelemetryError  # type: ignore[import-not-found]

LIMIT_S = 15.0
RATE_HZ = 30
STREAMS = ("attitude_euler", "armed", "flight_mode", "health", "landed_state", "in_air", "position_velocity_ned")
RATES = ("attitude_euler", "position_velocity_ned", "in_air", "landed_state")
UNKNOWN = Covariance([float("nan")])


class Heard:
    """What telemetry has brought: the last value of each stream, and all texts."""

    def __init__(self, telemetry: Any) -> None:
        self.values: dict[str, Any] = {}
        self.texts: list[str] = []
        self._news = threading.Condition()
        # The library calls back as long as somebody holds these.
        self._handles = [getattr(telemetry, f"subscribe_{name}")(self._keep(name)) for name in STREAMS]
        self._handles.append(telemetry.subscribe_status_text(self._keep_text))

    def _keep(self, name: str) -> Callable[..., None]:
        def keep(value: Any, *_rest: Any) -> None:
            with self._news:
                self.values[name] = value
                self._news.notify_all()

        return keep

    def _keep_text(self, text: Any, *_rest: Any) -> None:
        with self._news:
            self.texts.append(text.text)
            self._news.notify_all()

    def until(self, done: Callable[[], bool]) -> bool:
        """Wait until something is true of what was heard; say whether it became so in time."""
        with self._news:
            return self._news.wait_for(done, LIMIT_S)


def refused(call: Callable[..., Any], *arguments: Any) -> str:
    """Call, and return why it was refused, or an empty text."""
    try:
        call(*arguments)
    except (ActionError, TelemetryError) as error:
        return str(error.result.name)
    return ""


def odometry(frame: Any) -> Any:
    """Return a sample: level, at rest, at the origin, stamped now."""
    body = (PositionBody(0.0, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0), SpeedBody(), AngularVelocityBody())
    return Odometry(
        time.monotonic_ns() // 1000, frame, *body, UNKNOWN, UNKNOWN, 0, Odometry.MavEstimatorType.VIO, 90
    )  # fmt: skip


def send_one_of_each(mocap: Any) -> None:
    """Send the plugin's four messages, ODOMETRY in the frame that it has by default."""
    now_us, where = time.monotonic_ns() // 1000, PositionBody(0.0, 0.0, 0.0)
    mocap.set_vision_position_estimate(VisionPositionEstimate(now_us, where, AngleBody(0.0, 0.0, 0.0), UNKNOWN, 0))
    mocap.set_vision_speed_estimate(VisionSpeedEstimate(now_us, SpeedNed(0.0, 0.0, 0.0), UNKNOWN, 0))
    mocap.set_attitude_position_mocap(AttitudePositionMocap(now_us, Quaternion(1.0, 0.0, 0.0, 0.0), where, UNKNOWN))
    mocap.set_odometry(odometry(Odometry().frame_id))


def arm_with_vision(mocap: Any, action: Any) -> str:
    """Send ODOMETRY at 30 Hz, ask for arming every second, and return the last refusal, or an empty text."""
    why = "never asked"
    for sample in range(int(LIMIT_S * RATE_HZ)):
        mocap.set_odometry(odometry(Odometry.MavFrame.LOCAL_FRD))
        if sample % RATE_HZ == RATE_HZ - 1 and not (why := refused(action.arm)):
            break
        time.sleep(1 / RATE_HZ)
    return why


def set_and_get(param: Any) -> dict[str, float]:
    """Set a parameter of each type, and return what is read back."""
    param.set_param_int("VISO_DELAY_MS", 35)
    param.set_param_float("VISO_POS_M_NSE", 0.5)
    names = {"VISO_TYPE": param.get_param_int, "VISO_DELAY_MS": param.get_param_int}
    names["VISO_POS_M_NSE"] = param.get_param_float
    return {name: get(name) for name, get in names.items()}


def fly(system: Any) -> dict[str, Any]:
    """Do what a companion's program does, and return what it met."""
    telemetry, action, mocap = Telemetry(system), Action(system), Mocap(system)
    heard, met = Heard(telemetry), dict[str, Any]()
    heard.until(lambda: {"armed", "health"} <= heard.values.keys())
    met["rates"] = {name: refused(getattr(telemetry, f"set_rate_{name}"), 10.0) for name in RATES}
    met["attitude"] = heard.until(lambda: "attitude_euler" in heard.values)
    met["parameters"] = set_and_get(Param(system))
    every = Param(system).get_all_params()
    met["list"] = len(every.int_params) + len(every.float_params) + len(every.custom_params)
    version = Info(system).get_version()
    met["version"] = [version.flight_sw_major, version.flight_sw_minor]
    met["first_refusal"] = refused(action.arm)
    met["told_why"] = heard.until(lambda: any(text.startswith("Arm: ") for text in heard.texts))
    send_one_of_each(mocap)
    met["refusal_with_vision"] = arm_with_vision(mocap, action)
    met["armed"] = heard.until(lambda: heard.values["armed"])
    met["disarm_refusal"] = refused(action.disarm)
    met["streams"] = sorted(heard.values)
    met["texts"] = heard.texts
    return met


def main() -> None:
    """Connect, fly, and print what was met."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    try:
        mavsdk.add_any_connection(sys.argv[1])
        system = mavsdk.first_autopilot(LIMIT_S)
        print("\n" + json.dumps(fly(system)))  # the library may just have begun a line of its own
    finally:
        mavsdk.destroy()


if __name__ == "__main__":
    main()
