# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Switches of the radio: that of the flight mode, and those which run the functions that RCn_OPTION gives them.

Source: RC_Channel/RC_Channel.cpp (read_mode_switch, read_6pos_switch, read_aux, read_3pos_switch, debounce_completed).
"""

from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Generic, TypeVar

from ap_core.clock import NEVER
from ap_core.param import FromParams
from mav_handlers.handlers.commands.aux_functions import (
    AUX_FUNCTIONS,
    VISODOM_ALIGN,
    AuxSource,
    SwitchPosition,
    run_aux_function,
)
from viso.parameters.copter import NUMBER_OF_CHANNELS
from viso.vehicle.copter.modes import ModeReason

if TYPE_CHECKING:
    from viso.vehicle.copter.receiver import Receiver
    from viso.vehicle.vehicle import Vehicle

SWITCH_PERIOD_US: Final = 100_000
DEBOUNCE_US: Final = 200_000
LEAST_PWM_US, MOST_PWM_US = 800, 2200
"""A pulse beyond is none."""
LOW_BELOW_US, HIGH_ABOVE_US = 1200, 1800
MODE_LIMITS_US: Final = (1231, 1361, 1491, 1621, 1750)
"""Where the positions 2 to 6 of the mode switch begin."""
_ANNOUNCED: Final = {VISODOM_ALIGN: "VisOdomAlign"}
_MAV_SEVERITY_INFO: Final = 6


P = TypeVar("P")


@dataclass(slots=True)
class _Switch(Generic[P]):
    """A switch: its position, and the one that it has had since a time and that is not counted yet."""

    position: P | None = None
    new_position: P | None = None
    since_us: int = 0

    def has_moved(self, position: P, now_us: int) -> bool:
        """Return whether it has newly been in another position for long enough."""
        if position == self.position:
            self.new_position = position
        elif position != self.new_position:
            self.new_position, self.since_us = position, now_us
        elif now_us - self.since_us >= DEBOUNCE_US:
            self.position = position
            return True
        return False


class Switches:
    """The switches of all channels that have a function."""

    def __init__(self, vehicle: "Vehicle", receiver: "Receiver") -> None:
        self._vehicle = vehicle
        self._receiver = receiver
        self._mode_switch: _Switch[int] = _Switch()
        self._switches: list[_Switch[SwitchPosition]] = [_Switch() for _ in range(NUMBER_OF_CHANNELS)]
        self._functions = FromParams(vehicle.params, self._find_functions)
        self._mode_channel = FromParams(vehicle.params, lambda: vehicle.params.get_int("FLTMODE_CH"))

    def _find_functions(self) -> dict[int, int]:
        options = {n: self._vehicle.params.get_int(f"RC{n}_OPTION") for n in range(1, NUMBER_OF_CHANNELS + 1)}
        return {channel: option for channel, option in options.items() if option in AUX_FUNCTIONS}

    def idle_until_us(self) -> int:
        """Return before when there is nothing to do: for ever while no radio is heard and no channel has a function."""
        return 0 if self._functions() or self._receiver.is_heard else NEVER

    def update(self) -> None:
        """Enter the mode of the mode switch and run the functions of switches that have moved; ten times per second."""
        now_us = self._vehicle.clock.micros64()
        self._read_mode_switch(now_us)
        for channel, function in self._functions().items():
            position = _position_of(self._receiver.pwm_us(channel))
            if position is None or not self._switches[channel - 1].has_moved(position, now_us):
                continue
            if function in _ANNOUNCED:
                text = f"RC{channel}: {_ANNOUNCED[function]} {position.name}"
                self._vehicle.texts.send_text(_MAV_SEVERITY_INFO, text)
            run_aux_function(self._vehicle, function, position, AuxSource.RC, channel - 1)

    def _read_mode_switch(self, now_us: int) -> None:
        channel = self._mode_channel()
        pwm_us = self._receiver.pwm_us(channel) if 0 < channel < NUMBER_OF_CHANNELS else None
        if pwm_us is None or not LEAST_PWM_US < pwm_us < MOST_PWM_US:
            return
        position = bisect_right(MODE_LIMITS_US, pwm_us)
        if self._mode_switch.has_moved(position, now_us):
            number = self._vehicle.params.get_int(f"FLTMODE{position + 1}")
            self._vehicle.copter.modes.set_mode(number, ModeReason.RC_COMMAND)


def _position_of(pwm_us: int | None) -> SwitchPosition | None:
    if pwm_us is None or not LEAST_PWM_US < pwm_us < MOST_PWM_US:
        return None
    if pwm_us < LOW_BELOW_US:
        return SwitchPosition.LOW
    return SwitchPosition.HIGH if pwm_us > HIGH_ABOVE_US else SwitchPosition.MIDDLE
