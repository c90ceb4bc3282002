# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Switches of the radio, which run the functions that RCn_OPTION gives them.

Source: RC_Channel/RC_Channel.cpp (read_aux, debounce_completed, read_3pos_switch).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

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

if TYPE_CHECKING:
    from viso.vehicle.copter.receiver import Receiver
    from viso.vehicle.vehicle import Vehicle

SWITCH_PERIOD_US: Final = 100_000
DEBOUNCE_US: Final = 200_000
LEAST_PWM_US, MOST_PWM_US = 800, 2200
"""A pulse beyond is none."""
LOW_BELOW_US, HIGH_ABOVE_US = 1200, 1800
_ANNOUNCED: Final = {VISODOM_ALIGN: "VisOdomAlign"}
_MAV_SEVERITY_INFO: Final = 6


@dataclass(slots=True)
class _Switch:
    """A switch: its position, and the one that it has had since a time and that is not counted yet."""

    position: SwitchPosition | None = None
    new_position: SwitchPosition | None = None
    since_us: int = 0

    def has_moved(self, position: SwitchPosition, now_us: int) -> bool:
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
        self._switches = [_Switch() for _ in range(NUMBER_OF_CHANNELS)]
        self._functions = FromParams(vehicle.params, self._find_functions)

    def _find_functions(self) -> dict[int, int]:
        options = {n: self._vehicle.params.get_int(f"RC{n}_OPTION") for n in range(1, NUMBER_OF_CHANNELS + 1)}
        return {channel: option for channel, option in options.items() if option in AUX_FUNCTIONS}

    def idle_until_us(self) -> int:
        """Return before when there is nothing to do: for ever while no channel has a function."""
        return 0 if self._functions() else NEVER

    def update(self) -> None:
        """Run the functions of switches that have moved; ten times per second."""
        now_us = self._vehicle.clock.micros64()
        for channel, function in self._functions().items():
            position = _position_of(self._receiver.pwm_us(channel))
            if position is None or not self._switches[channel - 1].has_moved(position, now_us):
                continue
            if function in _ANNOUNCED:
                text = f"RC{channel}: {_ANNOUNCED[function]} {position.name}"
                self._vehicle.texts.send_text(_MAV_SEVERITY_INFO, text)
            run_aux_function(self._vehicle, function, position, AuxSource.RC, channel - 1)


def _position_of(pwm_us: int | None) -> SwitchPosition | None:
    if pwm_us is None or not LEAST_PWM_US < pwm_us < MOST_PWM_US:
        return None
    if pwm_us < LOW_BELOW_US:
        return SwitchPosition.LOW
    return SwitchPosition.HIGH if pwm_us > HIGH_ABOVE_US else SwitchPosition.MIDDLE
