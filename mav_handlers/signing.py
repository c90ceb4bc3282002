# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's signing key: set-up, storage, and timestamps that never go back.

Timestamps count units of 10 us since 2015-01-01. Source: GCS_MAVLink/GCS_Signing.cpp.
"""

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Protocol

from ap_core.cint import u32, u64
from ap_core.verdict import Verdict
from mav_handlers.channel import Channel
from mav_handlers.verdicts import HANDLED, KEY_NOT_SAVED, SETUP_WHILE_ARMED
from mav_handlers.wire.codec import message_id
from mav_handlers.wire.messages import SETUP_SIGNING
from mav_handlers.wire.signature import MINUTE_IN_TIMESTAMPS, SECRET_KEY_BYTES, LinkSigning, SigningStreams

SIGNING_KEY_MAGIC: Final = 0x3852FCD1
OPTION_SIGNING_DISABLED: Final = 1 << 0
SAVE_INTERVAL_MS: Final = 30_000
_TIMESTAMPS_PER_SECOND: Final = 100_000
_EPOCH_2015_S: Final = 1_420_070_400
_STORED: Final = struct.Struct(f"<I4xQ{SECRET_KEY_BYTES}s")
_UNSIGNED_ALLOWED: Final = frozenset({message_id("RADIO"), message_id("RADIO_STATUS")})


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A key of 32 bytes, and a timestamp not earlier than any that was sent more than 30 s ago."""

    timestamp: int
    secret_key: bytes

    @property
    def switches_off(self) -> bool:
        """Return whether this key means no signing: all its bytes and its timestamp are zero."""
        return self.timestamp == 0 and not any(self.secret_key)

    def to_bytes(self) -> bytes:
        """Return the 48 bytes that the firmware stores."""
        return _STORED.pack(SIGNING_KEY_MAGIC, self.timestamp, self.secret_key)

    @classmethod
    def from_bytes(cls, data: bytes) -> "SigningKey | None":
        """Return the key from stored bytes, or None if they hold none."""
        if len(data) < _STORED.size:
            return None
        magic, timestamp, secret_key = _STORED.unpack_from(data)
        return cls(timestamp, secret_key) if magic == SIGNING_KEY_MAGIC else None


class KeyStore(Protocol):
    """Storage that keeps the key over a reboot."""

    def load(self) -> bytes:
        """Return what was saved, or nothing."""

    def save(self, data: bytes) -> bool:
        """Store these bytes; return whether that succeeded."""


class MemoryKeyStore:
    """Keeps the key in memory."""

    def __init__(self, data: bytes = b"") -> None:
        self._data = data

    def load(self) -> bytes:
        """Return what was saved, or nothing."""
        return self._data

    def save(self, data: bytes) -> bool:
        """Store these bytes."""
        self._data = data
        return True


class SigningState:
    """Signing on all links of a vehicle; ``options_of`` returns the MAVn_OPTIONS of a link by its number."""

    def __init__(self, store: KeyStore, options_of: Callable[[int], int]) -> None:
        self._store = store
        self._options_of = options_of
        self._streams = SigningStreams()
        self._last_save_ms = 0

    def open_link(self, channel: Channel) -> None:
        """Use the stored key on a new link; one that is set to MAVLink 1 starts without (GCS_MAVLINK::init)."""
        if channel.codec.version == 2:
            self.load_signing_key(channel)

    def load_signing_key(self, channel: Channel) -> None:
        """Use the stored key on a link, one minute ahead of its stored timestamp (GCS_MAVLINK::load_signing_key).

        Nothing changes on a link whose options disable signing, or while no key is stored.
        """
        key = self._load()
        if key is None or self._options_of(channel.port) & OPTION_SIGNING_DISABLED:
            return
        if key.switches_off:
            channel.codec.configure_signing(None)
            return
        timestamp, accepts = key.timestamp + MINUTE_IN_TIMESTAMPS, partial(_accepts_unsigned, channel.port)
        signing = LinkSigning(key.secret_key, channel.index, timestamp, self._streams, accepts)
        channel.codec.configure_signing(signing)

    def setup(
        self, message: SETUP_SIGNING, channels: Iterable[Channel], *, armed: bool, tell: Callable[[str], None]
    ) -> Verdict:
        """Store a key, unless armed, and use it at once on all links (GCS_MAVLINK::handle_setup_signing).

        ``tell`` sends a text of severity WARNING on the link of the message.
        """
        if armed:
            tell("ERROR: Won't setup signing when armed")
            return SETUP_WHILE_ARMED
        if not self._save(SigningKey(message.initial_timestamp, bytes(message.secret_key))):
            tell("ERROR: Failed to save signing key")
            return KEY_NOT_SAVED
        for channel in channels:
            self.load_signing_key(channel)
        return HANDLED

    def save_timestamp(self, channels: Iterable[Channel], now_ms: int, *, force: bool = False) -> None:
        """Store the latest timestamp every 30 s, or now (GCS_MAVLINK::save_signing_timestamp)."""
        if not force and u32(now_ms - self._last_save_ms) < SAVE_INTERVAL_MS:
            return
        self._last_save_ms = u32(now_ms)
        key = self._load()
        latest = max((signing.timestamp for signing in _active(channels)), default=0)
        if key is not None and latest > key.timestamp:
            self._save(replace(key, timestamp=latest))

    def save_wait_ms(self, now_ms: int) -> int:
        """Return the time until the timestamp is next stored, 0 while that is due."""
        return max(SAVE_INTERVAL_MS - u32(now_ms - self._last_save_ms), 0)

    def update_timestamp(self, channels: Iterable[Channel], utc_us: int, now_ms: int) -> None:
        """Update the timestamp from a new time of day, us since 1970 (GCS_MAVLINK::update_signing_timestamp).

        Times before 2015 are counted from 1970.
        """
        channels = tuple(channels)
        seconds = utc_us // 1_000_000
        since_2015_s = seconds - _EPOCH_2015_S if seconds > _EPOCH_2015_S else seconds
        timestamp = u64(since_2015_s * _TIMESTAMPS_PER_SECOND)
        for signing in _active(channels):
            signing.timestamp = max(signing.timestamp, timestamp)
        self.save_timestamp(channels, now_ms, force=True)

    def _load(self) -> SigningKey | None:
        return SigningKey.from_bytes(self._store.load())

    def _save(self, key: SigningKey) -> bool:
        return self._store.save(key.to_bytes())


def _active(channels: Iterable[Channel]) -> list[LinkSigning]:
    return [channel.codec.signing for channel in channels if channel.codec.signing is not None]


def _accepts_unsigned(link: int, msg_id: int) -> bool:
    # The first link is the USB port of a flight board, which is trusted.
    return link == 0 or msg_id in _UNSIGNED_ALLOWED
