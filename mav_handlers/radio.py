# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Telemetry radios' reports on their transmit buffers, and the slow-down of a link that follows.

Source: GCS_MAVLink/GCS_Common.cpp (handle_radio_status, last_txbuf_is_greater).
"""

from typing import Final

STALE_MS: Final = 5000
SLOWDOWN_LIMIT_MS: Final = 2000


class RadioLink:
    """The last report of any radio on any link; before the first, the buffer counts as free."""

    def __init__(self) -> None:
        self._received_ms = 0
        self._txbuf_percent = 100

    def report(self, txbuf_percent: int, now_us: int) -> None:
        """Note how much of a radio's transmit buffer is free."""
        self._received_ms = now_us // 1000
        self._txbuf_percent = txbuf_percent

    def txbuf_is_greater(self, percent: int, now_us: int) -> bool:
        """Return whether more than ``percent`` is free, or no radio has reported for more than 5 s."""
        return now_us // 1000 - self._received_ms > STALE_MS or self._txbuf_percent > percent


def adapted_slowdown_ms(slowdown_ms: int, txbuf_percent: int) -> int:
    """Return a link's new slow-down in ms, from the present one and the radio's free buffer."""
    if txbuf_percent < 20 and slowdown_ms < SLOWDOWN_LIMIT_MS:
        return slowdown_ms + 60
    if txbuf_percent < 50 and slowdown_ms < SLOWDOWN_LIMIT_MS:
        return slowdown_ms + 20
    if txbuf_percent > 95 and slowdown_ms > 200:
        return slowdown_ms - 40
    if txbuf_percent > 90:
        return max(slowdown_ms - 20, 0)
    return slowdown_ms
