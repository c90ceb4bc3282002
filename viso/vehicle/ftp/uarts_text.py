# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``@SYS/uarts.txt``: how much went over each link since the report was last made.

Source: AP_HAL_SITL/Util.cpp and UARTDriver.cpp (uart_info).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

_BITS_PER_BYTE: Final = 10


@dataclass(frozen=True, slots=True)
class UartCounts:
    """A link: bytes sent and received since boot, whether somebody is there, and its name."""

    tx_bytes: int
    rx_bytes: int
    connected: bool
    path: str


class UartsText:
    """Makes the report of the links that ``read_counts`` returns, always in the same order."""

    def __init__(self, read_counts: Callable[[], Sequence[UartCounts]], now_us: Callable[[], int]) -> None:
        self._read_counts = read_counts
        self._now_us = now_us
        self._last_ms = 0
        self._last: list[UartCounts] = []

    def __call__(self) -> str:
        """Return the text; amounts are since the last call, rates in bits per second at 10 bits a byte."""
        now_ms = self._now_us() // 1000
        elapsed_ms = max(now_ms - self._last_ms, 1)
        counts = list(self._read_counts())
        lines = [self._line(index, one, elapsed_ms) for index, one in enumerate(counts)]
        self._last_ms, self._last = now_ms, counts
        return "UARTV1\n" + "".join(lines)

    def _line(self, index: int, now: UartCounts, elapsed_ms: int) -> str:
        before = self._last[index] if index < len(self._last) else UartCounts(0, 0, False, "")
        tx, rx = now.tx_bytes - before.tx_bytes, now.rx_bytes - before.rx_bytes
        tx_rate, rx_rate = (amount * 1000 * _BITS_PER_BYTE // elapsed_ms for amount in (tx, rx))
        state = "connected    " if now.connected else "not connected"
        return f"SERIAL{index} TX={tx:8} RX={rx:8} TXBD={tx_rate:6} RXBD={rx_rate:6} {state} ({now.path})\n"
