# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pilot's radio over UDP, as the firmware's simulator takes it (AP_RCProtocol/AP_RCProtocol_UDP.cpp)."""

import socket
import struct
from typing import Final

from mav_handlers.links.base import cannot_open
from viso.vehicle.copter.receiver import RADIO_AT_REST_US

_FORMATS: Final = {2 * count: struct.Struct(f"<{count}H") for count in (8, 16)}
_MOST_BYTES: Final = 2048
_READS_PER_CALL: Final = 256


class UdpRadio:
    """A radio that sends 8 or 16 pulse lengths, uint16 in us, in a datagram; 0 leaves a channel as it is.

    Raises LinkError if the port cannot be had.

    Attributes:
        malformed: how many datagrams of another length came, which are dropped.
    """

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise cannot_open(f"the radio's UDP port {host}:{port}", error) from None
        self._channels_us = list(RADIO_AT_REST_US)
        self.port: int = self._socket.getsockname()[1]
        self.malformed = 0

    def fileno(self) -> int:
        """Return the descriptor to wait on."""
        return self._socket.fileno()

    def channels_us(self) -> tuple[int, ...]:
        """Return the pulse length of each of 16 channels in us, as last received; 0 where there is none."""
        for _ in range(_READS_PER_CALL):
            try:
                data = self._socket.recv(_MOST_BYTES)
            except OSError:  # nothing more has come
                break
            form = _FORMATS.get(len(data))
            if form is None:
                self.malformed += 1
                continue
            for index, pulse_us in enumerate(form.unpack(data)):
                if pulse_us:
                    self._channels_us[index] = pulse_us
        return tuple(self._channels_us)

    def close(self) -> None:
        """Close the port."""
        self._socket.close()
