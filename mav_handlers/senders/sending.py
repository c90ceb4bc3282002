# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The output of a link in one pass, in the firmware's order: timers, requested messages, the burst of a bucket.

Source: GCS_MAVLink/GCS_Common.cpp (update_send, do_try_send_message).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from mav_handlers.channel import Channel
from mav_handlers.params.pump import pump_params
from mav_handlers.params.reads import ParamReads
from mav_handlers.radio import RadioLink
from mav_handlers.schedule import NEXT_PARAM
from mav_handlers.senders import MOVING_ON, SENDERS
from mav_handlers.wire.messages import MESSAGES

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

SENT_WHILE_BOOTING: Final = frozenset({"HEARTBEAT", NEXT_PARAM, "HIGH_LATENCY2", "AUTOPILOT_VERSION"})

_RANK: Final = {name: number for number, name in enumerate(SENDERS)}


@dataclass(frozen=True, slots=True)
class Sending:
    """The sender of periodic and requested messages for all links; ``run`` is one pass of one link."""

    vehicle: Vehicle
    reads: ParamReads
    radio: RadioLink

    def run(self, channel: Channel, now_us: int) -> None:
        """Send due messages as far as they fit; one that does not fit comes first in the next pass.

        FIRMWARE PARITY: the firmware also ends a pass when it is out of time.
        """
        now_ms = now_us // 1000
        while True:
            if (name := channel.deferred.due(now_ms)) is not None:
                if not self._try(channel, name, now_us):
                    return
                channel.deferred.note_sent(name, now_ms)
            elif channel.requested:
                name = min(channel.requested, key=_RANK.__getitem__)
                if not self._try(channel, name, now_us):
                    return
                channel.requested.discard(name)
            elif channel.has_reader and (due := channel.buckets.due(now_ms)):
                name = min(due, key=_RANK.__getitem__)
                if not self._try(channel, name, now_us):
                    return
                channel.buckets.note_sent(name, now_ms)
            else:
                return

    def _try(self, channel: Channel, name: str, now_us: int) -> bool:
        """Send a message if it has content; return False if it has to wait."""
        # FIRMWARE PARITY: the firmware limits messages so in the blocking delays of initialisation.
        if not self.vehicle.copter.has_booted and name not in SENT_WHILE_BOOTING:
            return True
        if self._is_delayed(now_us):
            return False
        # A message without a dataclass never has anything to report.
        if name in MESSAGES and not channel.has_space_for(MESSAGES[name], now_us):
            return False
        if name == NEXT_PARAM:
            pump_params(self.vehicle.params, channel, self.reads, self.radio, now_us)
        else:
            self._send(channel, name, now_us)
        return True

    def _send(self, channel: Channel, name: str, now_us: int) -> None:
        # Without a reader the message need not be built, unless building it changes state.
        message = SENDERS[name](self.vehicle, channel, now_us) if channel.has_reader or name in MOVING_ON else None
        if message is not None:
            channel.send(message)
        if name == "HEARTBEAT":
            channel.heartbeat_sent_us = now_us

    def _is_delayed(self, now_us: int) -> bool:
        # The delay counts "seconds" of 1024 ms.
        release = self.vehicle.release
        delay = self.vehicle.params.get_int(release.params.telem_delay) + release.telem_delay_more
        return (now_us // 1000) >> 10 < delay
