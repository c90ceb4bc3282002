# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A log that comes in pieces of LOG_DATA: what has come, and what to ask for again."""

from typing import Final

from mav_handlers.wire.messages import LOG_DATA

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
