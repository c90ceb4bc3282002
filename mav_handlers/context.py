# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a handler gets with its message."""

from typing import NamedTuple

from mav_handlers.channel import Channel
from mav_handlers.ports import EndpointPort, VehiclePort
from mav_handlers.wire.codec import Header
from mav_handlers.wire.messages import Message


class Context(NamedTuple):
    """One received message's surroundings.

    ``now_us`` is the time of handling, ``read_us`` the time when the link was last read, both in us since boot.
    """

    endpoint: EndpointPort
    vehicle: VehiclePort
    channel: Channel
    header: Header
    now_us: int
    read_us: int

    def correct_time_ms(self, message_type: type[Message], remote_us: int) -> int:
        """Return the time of a sample in ms since boot, from the sender's stamp in us."""
        return self.channel.correct_time_ms(message_type, remote_us, self.read_us, self.now_us)
