# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a companion does to fly the autopilot of a test: take off, go somewhere, land."""

import math
from collections.abc import Callable
from typing import Any, Final, Protocol

from ap_core.location import Location
from mav_handlers.wire.messages import (
    COMMAND_ACK,
    COMMAND_LONG,
    SET_GPS_GLOBAL_ORIGIN,
    SET_POSITION_TARGET_LOCAL_NED,
    Message,
)
from viso.testing.observations import StatusText
from viso.vehicle.sensors.motion import Truth
from viso.vehicle.vehicle import Vehicle

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is

GUIDED: Final = 4
STEP_S: Final = 0.05
NEAR_M: Final = 0.2
PLACE: Final = Location(-353632621, 1491652374, 58400)
"""Where the firmware's simulator starts."""

_ARM, _TAKEOFF, _LAND, _SET_MODE = 400, 22, 21, 176
_PLACE_ALONE: Final = 0b0000_1101_1111_1000
_YAW_TOO: Final = ~(1 << 10)


class Flown(Protocol):
    """The autopilot of a test, as far as it takes to fly it."""

    vehicle: Vehicle

    @property
    def now_us(self) -> int:
        """The vehicle's time in us since boot."""

    @property
    def status_texts(self) -> list[StatusText]:
        """What it said."""

    def advance(self, *, ms: float | None = None, s: float | None = None) -> None:
        """Let it run for a while."""

    def send(self, message: object, *, system_id: int = 1, component_id: int = 197) -> Any:
        """Hand it a message."""

    def received_of(self, kind: type[COMMAND_ACK]) -> list[COMMAND_ACK]:
        """Return the messages of one type that it sent."""


def truth_of(autopilot: Flown) -> Truth:
    """Return where the vehicle really is. Raises ValueError if it is none that flies."""
    airframe = autopilot.vehicle.source.airframe
    if airframe is None:
        raise ValueError("this autopilot does not fly: ask for imu='fly'")
    return airframe.truth()


def take_off(autopilot: Flown, height_m: float, within_s: float) -> None:
    """Give the vehicle an origin if it has none, arm it in GUIDED once its checks pass, take off, and wait."""
    truth_of(autopilot)
    start_m, copter = _height_m(autopilot), autopilot.vehicle.copter
    if autopilot.vehicle.ahrs.origin() is None:
        _tell(autopilot, SET_GPS_GLOBAL_ORIGIN(1, PLACE.lat, PLACE.lng, 10 * PLACE.alt_cm))
    _command(autopilot, _SET_MODE, 1.0, GUIDED)
    _wait(autopilot, lambda: copter.arming.pre_arm_checks(display=False), within_s, "readiness to arm")
    _command(autopilot, _ARM, 1.0)
    _command(autopilot, _TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m)
    _wait(autopilot, lambda: _height_m(autopilot) > start_m + height_m - NEAR_M, within_s, f"a height of {height_m} m")


def go_to(
    autopilot: Flown, north_m: float, east_m: float, height_m: float, yaw_deg: float | None, within_s: float
) -> None:
    """Fly to a place, and wait."""
    truth_of(autopilot)
    mask = _PLACE_ALONE if yaw_deg is None else _PLACE_ALONE & _YAW_TOO
    zeros = (0.0,) * 6
    yaw_rad = math.radians(yaw_deg or 0.0)
    _tell(autopilot, SET_POSITION_TARGET_LOCAL_NED(0, 1, 1, 1, mask, north_m, east_m, -height_m, *zeros, yaw_rad, 0.0))

    def is_there() -> bool:
        pos = autopilot.vehicle.ahrs.get_relative_position_NED_origin_float()
        return pos is not None and math.dist(pos.to_tuple(), (north_m, east_m, -height_m)) < NEAR_M

    _wait(autopilot, is_there, within_s, f"{north_m} m north, {east_m} m east at {height_m} m")


def land(autopilot: Flown, within_s: float) -> None:
    """Land, and wait until the vehicle has disarmed itself."""
    truth_of(autopilot)
    _command(autopilot, _LAND)
    _wait(autopilot, lambda: not autopilot.vehicle.copter.is_armed(), within_s, "the ground")


def _height_m(autopilot: Flown) -> float:
    pos = autopilot.vehicle.ahrs.get_relative_position_NED_origin_float()
    return 0.0 if pos is None else -float(pos.z)


def _tell(autopilot: Flown, message: Message) -> None:
    autopilot.send(message, system_id=255, component_id=190)


def _command(autopilot: Flown, number: int, *params: float) -> None:
    _tell(autopilot, COMMAND_LONG(1, 1, number, 0, *params, *(0.0,) * (7 - len(params))))
    answers = [ack.result for ack in autopilot.received_of(COMMAND_ACK) if ack.command == number]
    if answers[-1:] != [0]:
        autopilot.advance(ms=50)
        raise AssertionError(f"command {number} was refused (result {answers[-1:]}){_said(autopilot)}")


def _wait(autopilot: Flown, is_done: Callable[[], bool], within_s: float, what: str) -> None:
    end_us = autopilot.now_us + round(1e6 * within_s)
    while not is_done():
        if autopilot.now_us >= end_us:
            where = ", ".join(f"{part:.2f}" for part in truth_of(autopilot).pos_ned)
            mode = autopilot.vehicle.copter.modes.current.name
            raise AssertionError(
                f"{what} was not reached in {within_s} s: the vehicle is in {mode}, really at {where} m (NED)"
                f"{_said(autopilot)}"
            )
        autopilot.advance(s=STEP_S)


def _said(autopilot: Flown) -> str:
    texts = [said.text for said in autopilot.status_texts[-5:]]
    return f"; the autopilot said last: {'; '.join(texts)}" if texts else "; the autopilot said nothing"
