# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Signed frames: checks of signature and timestamp, and the unsigned frames that are accepted.

A signed frame ends in 13 bytes: link id, a 48-bit timestamp in units of 10 us since 2015, and six bytes of SHA-256
over the key and all before. Source: mavlink_helpers.h, mavlink_signature_check.
"""

import hmac
from collections.abc import Callable
from enum import Enum
from hashlib import sha256
from typing import Final

from ap_core.cint import u64

SIGNATURE_BLOCK_BYTES: Final = 13
SECRET_KEY_BYTES: Final = 32
MAX_SIGNING_STREAMS: Final = 16
MINUTE_IN_TIMESTAMPS: Final = 6_000_000
_DIGEST_BYTES: Final = 6


class Refusal(Enum):
    """Why a frame was refused."""

    UNSIGNED = "unsigned"
    BAD_SIGNATURE = "signature does not match"
    REPLAYED = "signature timestamp used before"
    OLD_TIMESTAMP = "signature timestamp too old"
    TOO_MANY_STREAMS = "too many signing streams"


class SigningStreams:
    """The last timestamp of each sender on each of its links, in one table for all links of the vehicle."""

    def __init__(self) -> None:
        self._timestamps: dict[tuple[int, int, int], int] = {}

    def refuse(self, stream: tuple[int, int, int], timestamp: int, own_timestamp: int) -> Refusal | None:
        """Accept and store the timestamp of a genuine frame, or return why it is refused.

        Args:
            stream: the sender's system and component id, and its link id.
            timestamp: of the frame, in units of 10 us since 2015.
            own_timestamp: the receiving link's; a new sender may be one minute behind it.
        """
        last = self._timestamps.get(stream)
        if last is not None and timestamp <= last:
            return Refusal.REPLAYED
        if last is None and len(self._timestamps) >= MAX_SIGNING_STREAMS:
            return Refusal.TOO_MANY_STREAMS
        if last is None and timestamp + MINUTE_IN_TIMESTAMPS < own_timestamp:
            return Refusal.OLD_TIMESTAMP
        self._timestamps[stream] = timestamp
        return None


class LinkSigning:
    """Signing on one link. pymavlink signs outgoing frames by its attributes, so these have pymavlink's names.

    Args:
        secret_key: 32 bytes.
        link_id: goes into every signature.
        timestamp: of the next frame sent, in units of 10 us since 2015; every frame increments it.
        streams: the received timestamps.
        accepts_unsigned: returns whether a message with an id is accepted without a valid signature.

    Raises:
        ValueError: a key of another length.
    """

    def __init__(
        self,
        secret_key: bytes,
        link_id: int,
        timestamp: int,
        streams: SigningStreams,
        accepts_unsigned: Callable[[int], bool],
    ) -> None:
        if len(secret_key) != SECRET_KEY_BYTES:
            raise ValueError(f"a signing key has {SECRET_KEY_BYTES} bytes, not {len(secret_key)}")
        self.secret_key = secret_key
        self.link_id = link_id
        self.timestamp = timestamp
        self.sign_outgoing = True
        self._streams = streams
        self._accepts_unsigned = accepts_unsigned

    @property
    def timestamp(self) -> int:
        """Timestamp of the next frame sent, 64 bits; a signature holds the lower 48."""
        return self._timestamp

    @timestamp.setter
    def timestamp(self, value: int) -> None:
        self._timestamp = u64(value)

    def refusal(self, frame: bytes, message_id: int, sender: tuple[int, int], *, is_signed: bool) -> Refusal | None:
        """Return why a frame is refused, or None if it is accepted.

        A genuine, new frame moves this link's timestamp up to its own.

        Args:
            frame: the whole frame, with its signature if it has one.
            message_id: of its message; some need no valid signature.
            sender: its system and component id.
            is_signed: whether the frame's flags announce a signature.
        """
        failure = self._failure_of(frame, sender) if is_signed else Refusal.UNSIGNED
        return None if failure is None or self._accepts_unsigned(message_id) else failure

    def _failure_of(self, frame: bytes, sender: tuple[int, int]) -> Refusal | None:
        digest = sha256(self.secret_key + frame[:-_DIGEST_BYTES]).digest()[:_DIGEST_BYTES]
        if not hmac.compare_digest(digest, frame[-_DIGEST_BYTES:]):
            return Refusal.BAD_SIGNATURE
        block = frame[-SIGNATURE_BLOCK_BYTES:]
        timestamp = int.from_bytes(block[1:-_DIGEST_BYTES], "little")
        refusal = self._streams.refuse((*sender, block[0]), timestamp, self.timestamp)
        if refusal is None:
            self.timestamp = max(self.timestamp, timestamp)
        return refusal
