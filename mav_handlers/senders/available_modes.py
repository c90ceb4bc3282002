# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of flight modes, one mode a message (GCS_Common.cpp, send_available_modes, send_available_mode_monitor)."""

from typing import Final

from ap_core.cint import int_of_float, u8
from mav_handlers.channel import Channel, ModesRequest
from mav_handlers.ports import VehiclePort
from mav_handlers.wire.messages import AVAILABLE_MODES, AVAILABLE_MODES_MONITOR

MONITOR_INTERVAL_MS: Final = 5000
# It changes when a script adds a mode.
_SEQUENCE: Final = 0


def request_modes(channel: Channel, index: float) -> None:
    """Ask for the mode with an index (from 1), or with 0 for all of them, one at every turn of the message."""
    channel.modes_request = ModesRequest(u8(int_of_float(index)), next_index=1)


def available_modes(vehicle: VehiclePort, channel: Channel, _now_us: int) -> AVAILABLE_MODES | None:
    """The mode that was asked for, or the next one of all; nothing when nobody asked or there is no such mode."""
    request = channel.modes_request
    if request is None:
        return None
    modes = vehicle.copter.available_modes()
    index = request.index or request.next_index
    if request.index == 0 and index < len(modes):
        request.next_index += 1
    else:
        channel.modes_request = None
    if index > len(modes):
        return None
    mode = modes[index - 1]
    return AVAILABLE_MODES(len(modes), index, mode.standard_mode, mode.custom_mode, mode.properties, mode.name)


def available_modes_monitor(_vehicle: VehiclePort, _channel: Channel, _now_us: int) -> AVAILABLE_MODES_MONITOR:
    """A number that changes with the list."""
    return AVAILABLE_MODES_MONITOR(_SEQUENCE)
