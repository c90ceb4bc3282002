# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts for the ground station: chunks, ids, the queue, and who gets them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.clock import VirtualClock
from mav_handlers.channel import Channel
from mav_handlers.statustext import EXPIRY_US, StatusTextQueue, chunk_text
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT

INFO = 6


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock(1_000_000)


@pytest.fixture
def queue(clock: VirtualClock) -> StatusTextQueue:
    return StatusTextQueue(clock.micros64)


@pytest.fixture
def channels() -> list[Channel]:
    return [Channel(index, f"link{index}", Codec(1, 1)) for index in range(3)]


def texts(queue: StatusTextQueue) -> list[str]:
    return [chunk.message.text for chunk in queue.pending()]


def ids(queue: StatusTextQueue) -> list[int]:
    return [chunk.message.id for chunk in queue.pending() if chunk.message.chunk_seq == 0]


def receivers(queue: StatusTextQueue) -> list[set[int] | None]:
    return [chunk.channels for chunk in queue.pending()]


def fill(channel: Channel) -> None:
    while channel.send(HEARTBEAT(6, 8, 0, 0, 4, 3)):
        pass


@pytest.mark.parametrize(
    ("length", "chunk_lengths"),
    [
        (0, [0]),
        (1, [1]),
        (49, [49]),
        (50, [50]),
        (51, [50, 1]),
        (99, [50, 49]),
        (100, [50, 50, 0]),
        (101, [50, 50, 1]),
        (150, [50, 50, 50, 0]),
        (256, [50, 50, 50, 50, 50, 6]),
        (300, [50, 50, 50, 50, 50, 6]),
    ],
)
def test_text_is_cut_into_chunks_of_50_and_one_shorter(length: int, chunk_lengths: list[int]) -> None:
    assert [len(chunk.text) for chunk in chunk_text(INFO, "x" * length, 9)] == chunk_lengths


def test_text_of_one_chunk_has_neither_id_nor_number() -> None:
    [chunk] = chunk_text(INFO, "x" * 50, 9)
    assert (chunk.id, chunk.chunk_seq) == (0, 0)


def test_chunks_share_an_id_and_are_numbered() -> None:
    chunks = chunk_text(INFO, "x" * 120, 9)
    assert [(chunk.id, chunk.chunk_seq) for chunk in chunks] == [(9, 0), (9, 1), (9, 2)]


@given(text=st.text(st.characters(codec="ascii"), max_size=300), severity=st.integers(0, 7))
def test_chunks_put_together_give_the_first_256_characters(text: str, severity: int) -> None:
    chunks = chunk_text(severity, text, 1)
    assert "".join(chunk.text for chunk in chunks) == text[:256]
    assert {chunk.severity for chunk in chunks} == {severity}


@given(text=st.text(st.characters(codec="ascii"), min_size=51, max_size=300))
def test_only_the_last_chunk_is_shorter_than_50(text: str) -> None:
    lengths = [len(chunk.text) for chunk in chunk_text(INFO, text, 1)]
    assert set(lengths[:-1]) == {50}
    assert lengths[-1] < 50


def test_long_texts_get_ids_from_1_on(queue: StatusTextQueue) -> None:
    for length in (51, 60, 70):
        queue.send_text(INFO, "x" * length)
    assert ids(queue) == [1, 2, 3]


def test_short_texts_use_up_no_id(queue: StatusTextQueue) -> None:
    for length in (51, 10, 51):
        queue.send_text(INFO, "x" * length)
    assert ids(queue) == [1, 0, 2]


@pytest.mark.slow
def test_id_after_65535_is_1(queue: StatusTextQueue) -> None:
    for _ in range(65536):
        queue.send_text(INFO, "x" * 51)
    assert ids(queue)[-2:] == [65535, 1]


def test_text_for_nobody_uses_up_no_id(queue: StatusTextQueue) -> None:
    queue.listening_channels = set
    queue.send_text(INFO, "x" * 51)
    queue.listening_channels = lambda: {0}
    queue.send_text(INFO, "x" * 51)
    assert ids(queue) == [1]


def test_queue_holds_30_chunks(queue: StatusTextQueue) -> None:
    for number in range(10):
        queue.send_text(INFO, f"text {number}".ljust(120))
    assert len(queue.pending()) == 30
    assert queue.overwritten == 0


def test_oldest_chunk_gives_way_when_30_wait(queue: StatusTextQueue) -> None:
    queue.send_text(INFO, "a" * 50 + "b" * 50 + "c")
    for number in range(29):
        queue.send_text(INFO, f"text {number}")
    assert texts(queue) == ["c", *(f"text {number}" for number in range(29))]
    assert queue.overwritten == 2


@pytest.mark.parametrize(("age_us", "kept"), [(EXPIRY_US, True), (EXPIRY_US + 1, False)])
def test_text_expires_after_5_s(
    clock: VirtualClock, queue: StatusTextQueue, channels: list[Channel], age_us: int, kept: bool
) -> None:
    fill(channels[0])
    queue.send_text(INFO, "old")
    clock.set_us(clock.micros64() + age_us)
    queue.service(channels)
    assert (texts(queue) == ["old"]) is kept
    assert queue.expired == (not kept)


def test_younger_text_outlives_an_expired_one(
    clock: VirtualClock, queue: StatusTextQueue, channels: list[Channel]
) -> None:
    fill(channels[0])
    queue.send_text(INFO, "old")
    clock.set_us(clock.micros64() + EXPIRY_US)
    queue.send_text(INFO, "young")
    clock.set_us(clock.micros64() + 1)
    queue.service(channels)
    assert texts(queue) == ["young"]


def test_age_is_looked_at_once_a_second(clock: VirtualClock, queue: StatusTextQueue, channels: list[Channel]) -> None:
    fill(channels[0])
    queue.send_text(INFO, "old")
    clock.set_us(clock.micros64() + EXPIRY_US - 10_000)
    queue.service(channels)
    clock.set_us(clock.micros64() + 999_999)
    queue.service(channels)
    assert texts(queue) == ["old"]
    clock.set_us(clock.micros64() + 1)
    queue.service(channels)
    assert texts(queue) == []


def test_listeners_hear_the_whole_text_as_it_is_queued(queue: StatusTextQueue) -> None:
    heard: list[tuple[int, str]] = []
    queue.on_text.append(lambda severity, text: heard.append((severity, text)))
    queue.send_text(4, "x" * 70)
    assert heard == [(4, "x" * 70)]


def test_listeners_hear_a_text_that_no_link_gets(queue: StatusTextQueue) -> None:
    heard: list[str] = []
    queue.on_text.append(lambda _severity, text: heard.append(text))
    queue.listening_channels = set
    queue.send_text(INFO, "alone")
    assert heard == ["alone"]
    assert texts(queue) == []


def test_receivers_are_chosen_as_the_text_is_queued(queue: StatusTextQueue) -> None:
    queue.listening_channels = lambda: {0, 2}
    queue.send_text(INFO, "early")
    queue.listening_channels = lambda: {1}
    assert receivers(queue) == [{0, 2}]


def test_text_for_one_link_is_for_that_link(queue: StatusTextQueue) -> None:
    queue.listening_channels = lambda: {0, 2}
    queue.send_text_to(2, INFO, "you")
    assert receivers(queue) == [{2}]


def test_text_for_one_link_that_does_not_listen_is_for_nobody(queue: StatusTextQueue) -> None:
    queue.listening_channels = lambda: {0, 2}
    queue.send_text_to(1, INFO, "you")
    assert receivers(queue) == []


def test_without_an_endpoint_a_text_is_for_every_link(queue: StatusTextQueue) -> None:
    queue.send_text(INFO, "early")
    queue.send_text_to(1, INFO, "you")
    assert receivers(queue) == [None, {1}]


def test_text_leaves_the_queue_when_every_link_has_it(queue: StatusTextQueue, channels: list[Channel]) -> None:
    fill(channels[1])
    queue.send_text(INFO, "a")
    queue.service(channels)
    assert receivers(queue) == [{1}]
    channels[1].take_output()
    queue.service(channels)
    assert texts(queue) == []


def test_each_link_gets_each_chunk_once(queue: StatusTextQueue, channels: list[Channel]) -> None:
    fill(channels[1])
    queue.send_text(INFO, "x" * 60)
    queue.service(channels)
    queue.service(channels)
    assert [channel.codec.frames_sent for channel in (channels[0], channels[2])] == [2, 2]


def test_chunks_that_do_not_fit_come_later(queue: StatusTextQueue, channels: list[Channel]) -> None:
    channel = channels[0]
    queue.send_text_to(0, INFO, "a" * 50 + "b" * 50 + "c" * 9)
    while channel.txspace() >= 2 * (54 + 12):
        channel.send(HEARTBEAT(6, 8, 0, 0, 4, 3))
    sent = channel.codec.frames_sent
    queue.service(channels)
    assert channel.codec.frames_sent == sent + 1
    assert [text[0] for text in texts(queue)] == ["b", "c"]
