# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Signing on links, with pymavlink itself as the peer that signs and checks."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from ap_core.verdict import Verdict
from mav_handlers.channel import Channel
from mav_handlers.signing import (
    OPTION_SIGNING_DISABLED,
    SIGNING_KEY_MAGIC,
    MemoryKeyStore,
    SigningKey,
    SigningState,
)
from mav_handlers.verdicts import (
    BAD_DATA_VERDICTS,
    BAD_SIGNATURE,
    HANDLED,
    KEY_NOT_SAVED,
    SETUP_WHILE_ARMED,
    SIGNATURE_OLD,
    SIGNATURE_REPLAYED,
    SIGNATURE_STREAMS,
    UNSIGNED,
)
from mav_handlers.wire.codec import BadData, Codec, Received
from mav_handlers.wire.messages import SETUP_SIGNING, SYSTEM_TIME
from mav_handlers.wire.signature import MAX_SIGNING_STREAMS, MINUTE_IN_TIMESTAMPS, LinkSigning, Refusal, SigningStreams

KEY = bytes(range(32))
OTHER_KEY = bytes(32 - n for n in range(32))
START = 35_000_000_000_000
"""A timestamp of 2026."""
MINUTE = MINUTE_IN_TIMESTAMPS
TIME = SYSTEM_TIME(1 << 56, 1 << 24)
WIRE_MAX = (1 << 48) - 1


class Peer:
    """A ground station that speaks through pymavlink alone."""

    def __init__(self, key: bytes | None = KEY, timestamp: int = START, component: int = 190) -> None:
        self.mav: Any = dialect.MAVLink(None, srcSystem=255, srcComponent=component)
        self.mav.robust_parsing = True
        self.mav.signing.secret_key = key
        self.mav.signing.sign_outgoing = key is not None
        self.mav.signing.timestamp = timestamp
        self.mav.signing.link_id = 5

    def frame(self, *, version: int = 2) -> bytes:
        """Return the next SYSTEM_TIME, signed if there is a key."""
        message = dialect.MAVLink_system_time_message(TIME.time_unix_usec, TIME.time_boot_ms)
        data = bytes(message.pack(self.mav, force_mavlink1=version == 1))
        self.mav.seq = (self.mav.seq + 1) % 256
        return data

    def radio_status(self) -> bytes:
        """Return a radio's report."""
        return bytes(dialect.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7).pack(self.mav))

    def reads(self, data: bytes) -> list[str]:
        """Return the types of what it makes of received bytes."""
        return [message.get_type() for message in self.mav.parse_buffer(data)]


class Links:
    """A vehicle's links and its signing."""

    def __init__(
        self, count: int = 2, *, store: MemoryKeyStore | None = None, options: int = 0, version: int = 2
    ) -> None:
        self.store = store or MemoryKeyStore()
        self.options = [options] * count
        self.state = SigningState(self.store, lambda number: self.options[number])
        self.channels = [Channel(number, f"link{number}", Codec(1, 1, version)) for number in range(count)]
        for channel in self.channels:
            self.state.open_link(channel)
        self.texts: list[str] = []

    def setup(self, key: bytes = KEY, timestamp: int = START, *, armed: bool = False) -> Verdict:
        """Handle a SETUP_SIGNING."""
        message = SETUP_SIGNING(1, 1, tuple(key), timestamp)
        return self.state.setup(message, self.channels, armed=armed, tell=self.texts.append)

    def receive(self, data: bytes, link: int = 1) -> Verdict | Received:
        """Return the only frame in the bytes, or the verdict that refuses it."""
        codec = self.channels[link].codec
        codec.feed(data)
        result = codec.next_received()
        assert codec.next_received() is None
        if isinstance(result, BadData):
            assert isinstance(result.reason, Refusal)
            return BAD_DATA_VERDICTS[result.reason]
        assert result is not None
        return result

    def accepts(self, data: bytes, link: int = 1) -> bool:
        """Return whether the only frame in the bytes is accepted."""
        return isinstance(self.receive(data, link), Received)

    def timestamp(self, link: int = 1) -> int:
        """Return the next timestamp of a link that signs."""
        signing = self.channels[link].codec.signing
        assert signing is not None
        return signing.timestamp

    def stored(self) -> SigningKey:
        """Return what is stored."""
        key = SigningKey.from_bytes(self.store.load())
        assert key is not None
        return key


@pytest.fixture
def links() -> Links:
    """Return two links with a key."""
    links = Links()
    assert links.setup() is HANDLED
    return links


# Sending


def test_peer_with_the_key_accepts_what_is_sent(links: Links) -> None:
    frames = [links.channels[1].codec.encode(TIME) for _ in range(3)]
    assert Peer().reads(b"".join(frames)) == ["SYSTEM_TIME"] * 3


def test_peer_with_another_key_refuses_what_is_sent(links: Links) -> None:
    assert Peer(OTHER_KEY).reads(links.channels[1].codec.encode(TIME)) == ["BAD_DATA"]


@pytest.mark.parametrize("link", [0, 1])
def test_link_id_is_the_number_of_the_link(links: Links, link: int) -> None:
    assert links.channels[link].codec.encode(TIME)[-13] == link


def test_timestamps_begin_a_minute_after_the_key_and_count_frames(links: Links) -> None:
    frames = [links.channels[1].codec.encode(TIME) for _ in range(2)]
    sent = [int.from_bytes(frame[-12:-6], "little") for frame in frames]
    assert sent == [START + MINUTE, START + MINUTE + 1]


def test_mavlink_1_frames_are_not_signed(links: Links) -> None:
    codec = links.channels[1].codec
    codec.version = 1
    assert len(codec.encode(TIME)) == 8 + 12


def test_without_a_key_nothing_is_signed_or_refused() -> None:
    links = Links()
    assert len(links.channels[1].codec.encode(TIME)) == 12 + 12
    assert links.accepts(Peer(None).frame())
    assert links.accepts(Peer().frame())


def test_signature_adds_13_bytes_of_overhead(links: Links) -> None:
    assert [codec.overhead_bytes for codec in (Codec(1, 1), links.channels[1].codec)] == [12, 25]


# Receiving


def test_signed_frame_is_decoded_and_kept_whole(links: Links) -> None:
    frame = Peer().frame()
    received = links.receive(frame)
    assert isinstance(received, Received)
    assert (received.message, received.header.frame) == (TIME, frame)


def test_wrong_key_is_refused(links: Links) -> None:
    assert links.receive(Peer(OTHER_KEY).frame()) is BAD_SIGNATURE


def test_replayed_frame_is_refused(links: Links) -> None:
    frame = Peer().frame()
    assert links.accepts(frame)
    assert links.receive(frame) is SIGNATURE_REPLAYED


def test_frame_replayed_on_another_link_is_refused() -> None:
    links = Links(3)
    links.setup()
    frame = Peer().frame()
    assert links.accepts(frame, 1)
    assert links.receive(frame, 2) is SIGNATURE_REPLAYED


def test_earlier_timestamp_is_refused(links: Links) -> None:
    peer = Peer()
    early, late = peer.frame(), peer.frame()
    assert links.accepts(late)
    assert links.receive(early) is SIGNATURE_REPLAYED


def test_new_sender_may_be_exactly_one_minute_behind(links: Links) -> None:
    assert links.receive(Peer(timestamp=START - 1).frame()) is SIGNATURE_OLD
    assert links.accepts(Peer(timestamp=START).frame())


def test_known_sender_may_fall_behind_other_senders(links: Links) -> None:
    slow, fast = Peer(component=1), Peer(component=2, timestamp=START + 10 * MINUTE)
    assert links.accepts(slow.frame())
    assert links.accepts(fast.frame())
    assert links.accepts(slow.frame())


def test_later_timestamp_of_a_sender_moves_the_link_s_own(links: Links) -> None:
    assert links.accepts(Peer(timestamp=START + 5 * MINUTE).frame())
    assert links.timestamp() == START + 5 * MINUTE


def test_seventeenth_sender_is_refused(links: Links) -> None:
    for component in range(MAX_SIGNING_STREAMS):
        assert links.accepts(Peer(component=component).frame())
    assert links.receive(Peer(component=100).frame()) is SIGNATURE_STREAMS


def test_forged_frame_does_not_lock_out_its_supposed_sender(links: Links) -> None:
    peer = Peer()
    assert links.accepts(peer.frame())
    assert links.receive(Peer(OTHER_KEY, timestamp=WIRE_MAX).frame()) is BAD_SIGNATURE
    assert links.accepts(peer.frame())
    assert links.timestamp() < START + 2 * MINUTE


@pytest.mark.parametrize("version", [1, 2])
def test_unsigned_frame_is_refused(links: Links, version: int) -> None:
    assert links.receive(Peer(None).frame(version=version)) is UNSIGNED


@pytest.mark.parametrize("version", [1, 2])
def test_first_link_accepts_unsigned_frames(links: Links, version: int) -> None:
    assert links.accepts(Peer(None).frame(version=version), 0)


@pytest.mark.parametrize(("port", "accepts"), [(0, True), (1, False)])
def test_further_client_is_held_to_what_its_link_is(links: Links, port: int, accepts: bool) -> None:
    links.channels.append(Channel(2, "further", Codec(1, 1), port=port))
    links.state.open_link(links.channels[2])
    assert links.accepts(Peer(None).frame(), 2) is accepts
    assert links.channels[2].codec.encode(TIME)[-13] == 2


def test_first_link_accepts_bad_signatures(links: Links) -> None:
    assert links.accepts(Peer(OTHER_KEY).frame(), 0)


def test_every_link_accepts_radio_reports_unsigned(links: Links) -> None:
    assert links.accepts(Peer(None).radio_status())


def test_unsigned_frame_after_a_bad_signature_is_told_apart(links: Links) -> None:
    assert links.receive(Peer(OTHER_KEY).radio_status()) is not BAD_SIGNATURE
    assert links.receive(Peer(None).frame()) is UNSIGNED
    assert links.receive(Peer(OTHER_KEY).frame()) is BAD_SIGNATURE
    assert links.receive(Peer(None).frame()) is UNSIGNED


@given(st.data())
def test_signed_frame_with_any_bit_flipped_is_not_accepted(data: st.DataObject) -> None:
    links = Links()
    links.setup()
    frame = bytearray(Peer().frame())
    # Not the start byte, length and flags, without which there is no frame to check; nor an id outside the dialect.
    position = data.draw(st.sampled_from([n for n in range(len(frame)) if n not in (0, 1, 2, 7, 8, 9)]))
    frame[position] ^= 1 << data.draw(st.integers(0, 7))
    codec = links.channels[1].codec
    codec.feed(bytes(frame))
    assert isinstance(codec.next_received(), BadData)


# SETUP_SIGNING


def test_key_is_refused_while_armed() -> None:
    links = Links()
    assert links.setup(armed=True) is SETUP_WHILE_ARMED
    assert links.texts == ["ERROR: Won't setup signing when armed"]
    assert links.store.load() == b""


def test_key_that_cannot_be_stored_is_not_used() -> None:
    class FullStore(MemoryKeyStore):
        def save(self, data: bytes) -> bool:
            return False

    links = Links(store=FullStore())
    assert links.setup() is KEY_NOT_SAVED
    assert links.texts == ["ERROR: Failed to save signing key"]
    assert links.channels[1].codec.signing is None


def test_key_is_used_on_all_links_at_once(links: Links) -> None:
    assert all(channel.codec.signing is not None for channel in links.channels)


def test_second_key_replaces_the_first(links: Links) -> None:
    links.setup(OTHER_KEY)
    assert links.receive(Peer(KEY).frame()) is BAD_SIGNATURE
    assert links.accepts(Peer(OTHER_KEY).frame())


def test_zero_key_with_timestamp_0_ends_signing(links: Links) -> None:
    assert links.setup(bytes(32), 0) is HANDLED
    assert links.accepts(Peer(None).frame())
    assert len(links.channels[1].codec.encode(TIME)) == 24


def test_zero_key_with_a_timestamp_is_a_key(links: Links) -> None:
    links.setup(bytes(32), START)
    assert links.accepts(Peer(bytes(32)).frame())
    assert links.receive(Peer(None).frame()) is UNSIGNED


@pytest.mark.parametrize("timestamp", [(1 << 64) - 1, (1 << 64) - 1 - MINUTE, 1 << 48])
def test_absurd_timestamp_does_not_stop_the_link(timestamp: int) -> None:
    links = Links()
    links.setup(timestamp=timestamp)
    assert [len(links.channels[1].codec.encode(TIME)) for _ in range(3)] == [37, 37, 37]


# Storage and reboots


def test_stored_key_has_the_firmware_s_layout(links: Links) -> None:
    stored = links.store.load()
    assert stored == SIGNING_KEY_MAGIC.to_bytes(8, "little") + START.to_bytes(8, "little") + KEY


@pytest.mark.parametrize("stored", [b"", bytes(48), SIGNING_KEY_MAGIC.to_bytes(4, "little") + bytes(43)])
def test_bytes_without_magic_or_too_few_are_no_key(stored: bytes) -> None:
    assert SigningKey.from_bytes(stored) is None


def test_key_outlives_a_reboot(links: Links) -> None:
    rebooted = Links(store=links.store)
    assert rebooted.accepts(Peer().frame())
    assert rebooted.timestamp() == START + MINUTE


def test_link_set_to_mavlink_1_starts_without_the_key(links: Links) -> None:
    rebooted = Links(store=links.store, version=1)
    assert rebooted.channels[1].codec.signing is None


def test_link_set_to_mavlink_1_takes_a_new_key_all_the_same() -> None:
    links = Links(version=1)
    links.setup()
    assert links.receive(Peer(None).frame(version=1)) is UNSIGNED


def test_option_bit_0_keeps_signing_off_on_a_link() -> None:
    links = Links(options=OPTION_SIGNING_DISABLED)
    links.setup()
    assert links.accepts(Peer(None).frame())


def test_option_bit_0_set_later_leaves_signing_as_it_is(links: Links) -> None:
    links.options = [OPTION_SIGNING_DISABLED] * 2
    links.setup(bytes(32), 0)
    assert links.receive(Peer(None).frame()) is UNSIGNED


def test_timestamp_is_stored_every_30_s(links: Links) -> None:
    links.state.save_timestamp(links.channels, 29_999)
    assert links.stored().timestamp == START
    links.state.save_timestamp(links.channels, 30_000)
    assert links.stored() == SigningKey(START + MINUTE, KEY)
    links.channels[1].codec.encode(TIME)
    links.state.save_timestamp(links.channels, 59_999)
    assert links.stored().timestamp == START + MINUTE
    links.state.save_timestamp(links.channels, 60_000)
    assert links.stored().timestamp == START + MINUTE + 1


def test_latest_timestamp_of_all_links_is_stored(links: Links) -> None:
    for _ in range(4):
        links.channels[0].codec.encode(TIME)
    links.state.save_timestamp(links.channels, 30_000)
    assert links.stored().timestamp == START + MINUTE + 4


def test_timestamp_is_stored_across_the_wrap_of_the_clock(links: Links) -> None:
    links.state.save_timestamp(links.channels, (1 << 32) - 10_000)
    links.channels[1].codec.encode(TIME)
    links.state.save_timestamp(links.channels, 20_000)
    assert links.stored().timestamp == START + MINUTE + 1


def test_without_a_key_nothing_is_stored() -> None:
    links = Links()
    links.state.save_timestamp(links.channels, 30_000)
    assert links.store.load() == b""


def test_nothing_is_stored_while_signing_is_off(links: Links) -> None:
    links.setup(bytes(32), 0)
    links.state.save_timestamp(links.channels, 30_000)
    assert links.stored() == SigningKey(0, bytes(32))


def test_time_of_day_moves_timestamps_on_and_is_stored_at_once(links: Links) -> None:
    utc_s = 1_420_070_400 + 400_000_000
    links.state.update_timestamp(links.channels, utc_s * 1_000_000 + 999_999, 1000)
    assert [links.timestamp(link) for link in (0, 1)] == [400_000_000 * 100_000] * 2
    assert links.stored().timestamp == 400_000_000 * 100_000


def test_time_of_day_does_not_move_timestamps_back(links: Links) -> None:
    links.state.update_timestamp(links.channels, 1_420_070_400_000_000, 1000)
    links.state.update_timestamp(links.channels, 1_420_070_401_000_000, 1000)
    assert links.timestamp(0) == 1_420_070_400 * 100_000


# Construction and verdicts


def test_key_of_another_length_is_misuse() -> None:
    with pytest.raises(ValueError, match="32 bytes, not 31"):
        LinkSigning(bytes(31), 0, 0, SigningStreams(), lambda _: False)
