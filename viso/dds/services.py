# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Services of ROS 2 by which a client arms, changes the mode and asks for the checks before arming.

Source: AP_DDS/AP_DDS_Service_Table.h, AP_DDS/AP_DDS_Client.cpp, on_request.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from viso.dds import messages as ros
from viso.vehicle.copter.arming import ArmMethod
from viso.vehicle.copter.modes import ModeReason
from viso.vehicle.vehicle import Vehicle

_MAV_SEVERITY_INFO: Final = 6


def _tell(vehicle: Vehicle, text: str) -> None:
    vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"DDS: Request for {text}")


def _result(worked: bool) -> str:
    return "SUCCESS" if worked else "FAIL"


def _arm(vehicle: Vehicle, request: ros.ArmMotorsRequest) -> ros.ArmMotorsResponse:
    _tell(vehicle, f"{'arm' if request.arm else 'disarm'}ing received")
    copter = vehicle.copter
    worked = copter.arm(True, ArmMethod.DDS) if request.arm else copter.disarm(False, ArmMethod.DDS)
    _tell(vehicle, f"Arming/Disarming : {_result(worked)}")
    return ros.ArmMotorsResponse(request.id, worked)


def _switch_mode(vehicle: Vehicle, request: ros.ModeSwitchRequest) -> ros.ModeSwitchResponse:
    worked = vehicle.copter.set_mode(request.mode, ModeReason.DDS_COMMAND)
    _tell(vehicle, f"Mode Switch : {_result(worked)}")
    return ros.ModeSwitchResponse(request.id, worked, vehicle.copter.custom_mode())


def _check(vehicle: Vehicle, request: ros.TriggerRequest) -> ros.TriggerResponse:
    passed = vehicle.copter.arming.pre_arm_checks(display=False)
    return ros.TriggerResponse(request.id, passed, "Vehicle is Armable" if passed else "Vehicle is Not Armable")


class Service(NamedTuple):
    """A service: its name, what is asked and answered, and what answers."""

    name: str
    request: type[Any]
    reply: type[Any]
    answer: Callable[[Vehicle, Any], Any]


SERVICES: Final = (
    Service("/ap/arm_motors", ros.ArmMotorsRequest, ros.ArmMotorsResponse, _arm),
    Service("/ap/mode_switch", ros.ModeSwitchRequest, ros.ModeSwitchResponse, _switch_mode),
    Service("/ap/prearm_check", ros.TriggerRequest, ros.TriggerResponse, _check),
)
"""In the firmware's order."""
