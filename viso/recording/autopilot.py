# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the recorder knows of the autopilot: its clock, by its answers to TIMESYNC, and the pieces of its log."""

from typing import Final

from mav_handlers.wire.messages import LOG_DATA

RATE_SPAN_US: Final = 2_000_000
"""Between answers from which the rate is taken."""
_SLACK_US: Final = 500
_REAL_TIME: Final = 0.15
"""A clock whose rate is within this of 1 runs in real time."""


class AutopilotClock:
    """When the autopilot booted, by the recorder's clock, None until an answer has come, and how fast its time runs.

    ``boots`` counts how often its clock has started again.
    """

    def __init__(self) -> None:
        self.boot_us: int | None = None
        self.boots = 0
        self._round_trip_us = 0
        self._shown_us = 0
        self._first: tuple[int, int] | None = None
        self._latest = 0, 0

    def take(self, asked_us: int, now_us: int, shown_us: int) -> None:
        """Take in an answer: when it was asked for, when it came, and what the autopilot's clock showed."""
        if self.boot_us is not None and shown_us < self._shown_us:
            self.boots += 1
            self.boot_us = self._first = None
        self._shown_us = shown_us
        middle_us, round_trip_us = (asked_us + now_us) // 2, now_us - asked_us
        if self._first is None:
            self._first = middle_us, shown_us
        self._latest = middle_us, shown_us
        # The quickest answer tells best; the bound grows, so that a clock that runs otherwise is followed.
        if self.boot_us is None or round_trip_us <= self._round_trip_us + _SLACK_US:
            self.boot_us = middle_us - shown_us
            self._round_trip_us = round_trip_us
        else:
            self._round_trip_us += _SLACK_US

    def time_us(self, now_us: int) -> int | None:
        """Return what the autopilot's clock shows; None while that is not known."""
        return None if self.boot_us is None else max(0, now_us - self.boot_us)

    def take_rate(self) -> float | None:
        """Return how many seconds of the autopilot pass in one of the recorder, once that is known.

        All that was known is then forgotten, as the recorder's clock is to follow.
        """
        if self._first is None or self._latest[0] - self._first[0] < RATE_SPAN_US:
            return None
        rate = (self._latest[1] - self._first[1]) / (self._latest[0] - self._first[0])
        self.boot_us = self._first = None
        return 1.0 if abs(rate - 1) < _REAL_TIME else rate


PIECE_BYTES: Final = 90
_ALL_THE_REST: Final = 0xFFFFFFFF


class LogPieces:
    """The pieces of one log; a piece that is not full is its end, and it ``is_whole`` if nothing is missing."""

    def __init__(self, log_id: int) -> None:
        self._log_id = log_id
        self._pieces: dict[int, bytes] = {}
        self._front = 0
        self.is_whole = False

    def take(self, message: LOG_DATA) -> bool:
        """Take in a piece; say whether it is a new one of this log."""
        if message.id != self._log_id or message.ofs % PIECE_BYTES or message.ofs in self._pieces:
            return False
        self._pieces[message.ofs] = bytes(message.data[: message.count])
        while (piece := self._pieces.get(self._front)) is not None and not self.is_whole:
            self.is_whole = len(piece) < PIECE_BYTES
            self._front += len(piece)
        return True

    def gap(self) -> tuple[int, int]:
        """Return offset and length of the first bytes that are missing."""
        later = min((one for one in self._pieces if one > self._front), default=None)
        return self._front, _ALL_THE_REST if later is None else later - self._front

    def data(self) -> bytes:
        """Return the log as far as it has come without a gap."""
        return b"".join(self._pieces[offset] for offset in range(0, self._front, PIECE_BYTES))
