# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Serial link: ``/dev/ttyX,BAUD`` or ``serial:/dev/ttyX,BAUD``.

pyserial opens and configures the port; reading and writing then go through the descriptor like any other
stream, because pyserial's own write spins on a full output buffer when it must not block.
"""

import errno
import termios
import time
from typing import Any

import serial

from mav_handlers.links.base import Backoff, LinkError, Monotonic, bad_string, cannot_open
from mav_handlers.links.stream import StreamLink

DEFAULT_BAUD = 115200
"""The rate when none is given, as pymavlink's."""


class SerialLink(StreamLink):
    """A link over a serial port, which is opened again after it was unplugged.

    A port that is missing at the start, or that another program holds, is an error.
    """

    def __init__(self, name: str, device: str, baud: int, *, monotonic: Monotonic = time.monotonic) -> None:
        super().__init__(name, baud)
        self._device = self._peer = device
        self._rate = baud
        self._backoff = Backoff(monotonic)
        try:
            self._port = self._open_port()
        except (OSError, ValueError, termios.error) as error:
            raise _explained(name, error) from None
        self._connected()

    def _open_stream(self) -> int:
        if self._port is None:
            self._reopen()
        return -1 if self._port is None else int(self._port.fileno())

    def _close_stream(self) -> None:
        self._port.close()
        self._port = None
        self._backoff.lost()

    def _reopen(self) -> None:
        if not self._backoff.due():
            return
        try:
            self._port = self._open_port()
        except (OSError, ValueError, termios.error):
            self._counters.open_failures += 1
            self._backoff.failed()
        else:
            self._backoff.succeeded()

    def _open_port(self) -> Any:
        port = serial.Serial(self._device, self._rate, timeout=0, exclusive=True)
        settings = termios.tcgetattr(port.fileno())
        # With a minimum of one byte, no data and an unplugged port can be distinguished as on a socket.
        settings[6][termios.VMIN] = 1
        termios.tcsetattr(port.fileno(), termios.TCSANOW, settings)
        return port


def open_serial(name: str, address: str) -> SerialLink:
    """Open ``DEVICE[,BAUD]``. Raises LinkError for a bad rate, or a port that does not open."""
    device, comma, rate = address.rpartition(",")
    if not comma:
        device, rate = address, str(DEFAULT_BAUD)
    if not device:
        raise bad_string(name, "no device named")
    if not (rate.isascii() and rate.isdigit() and 0 < int(rate) < 2**31):
        raise bad_string(name, f"{rate!r} is not a baud rate")
    return SerialLink(name, device, int(rate))


def _explained(name: str, error: Exception) -> LinkError:
    if isinstance(error, OSError) and error.errno == errno.EAGAIN:
        return LinkError(f"cannot open {name}: another program has opened this port")
    return cannot_open(name, error)
