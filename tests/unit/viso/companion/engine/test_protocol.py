# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages as bytes, and what becomes of bytes that are none."""

import contextlib
import dataclasses
from typing import Any

import numpy as np
import pytest

from viso.companion.engine.protocol import (
    FROM_ENGINE,
    FROM_VISO,
    HEADER,
    MAGIC,
    Decoder,
    Estimate,
    Hello,
    Imu,
    Log,
    Message,
    ProtocolError,
    fields_of,
    frame_of,
    nothing,
)

KINDS = [*FROM_VISO.values(), *FROM_ENGINE.values()]
LONGEST = max(len(frame_of(kind(**nothing(kind)))) for kind in FROM_ENGINE.values()) + 1000
RANDOM_BYTES = 1_000_000


def made(kind: type[Message]) -> Message:
    """Return a message of a kind with another value in each field."""
    values: dict[str, Any] = {}
    for number, (name, value) in enumerate(nothing(kind).items(), 1):
        if isinstance(value, np.ndarray):
            values[name] = np.arange(number, number + len(value), dtype=np.float64)
        elif isinstance(value, bytes):
            values[name] = bytes([number]) * (len(value) or 5)
        else:
            values[name] = type(value)(number)
    return kind(**values)


def values_of(message: Message) -> dict[str, object]:
    return {
        field.name: value.tolist() if isinstance(value := getattr(message, field.name), np.ndarray) else value
        for field in dataclasses.fields(message)
    }


def survived(data: bytes) -> list[Message]:
    """Return the messages in bytes of an engine, up to those that are none."""
    decoder, messages = Decoder(FROM_ENGINE), list[Message]()
    with contextlib.suppress(ProtocolError):
        for at in range(0, len(data), 997):
            messages.extend(decoder.feed(data[at : at + 997]))
            assert len(decoder._buffer) <= LONGEST
    return messages


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("step", [1, 10_000])
def test_what_is_written_is_read(kind: type[Message], step: int) -> None:
    message = made(kind)
    data = frame_of(message) * 2
    decoder = Decoder(FROM_VISO | FROM_ENGINE)
    read = [one for at in range(0, len(data), step) for one in decoder.feed(data[at : at + step])]
    assert [(type(one), values_of(one)) for one in read] == [(kind, values_of(message))] * 2


@pytest.mark.parametrize("kind", KINDS)
def test_fields_lie_on_multiples_of_their_size(kind: type[Message]) -> None:
    sizes = {"d": 8, "q": 8, "Q": 8, "I": 4, "s": 1}
    offset = 0
    for field in fields_of(kind):
        if field.code == "bytes":
            continue
        size = sizes[field.code[-1]]
        assert offset % size == 0, field.name
        offset += size * int(field.code[:-1] or 1)
        assert field.text


def test_bytes_of_a_sample() -> None:
    frame = frame_of(Imu(samples=b"\x07" + bytes(55)))
    assert frame == b"VISE" + b"\x05\0\0\0" + b"\x38\0\0\0" + b"\x07" + bytes(55)


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"hello\n", r"no message: b'hello\\n'"),
        (b"VISA", "no message: b'VISA'"),
        (HEADER.pack(MAGIC, 99, 0), "message of unknown kind 99"),
        (HEADER.pack(MAGIC, 101, 2**32 - 1), "Hello of 4294967295 bytes"),
        (HEADER.pack(MAGIC, 101, 3) + b"abc", "Hello of 3 bytes"),
        (HEADER.pack(MAGIC, 105, 3) + b"abc", "Log of 3 bytes"),
    ],
)
def test_what_is_no_message_is_told_in_a_line(data: bytes, text: str) -> None:
    with pytest.raises(ProtocolError, match=f"^{text}$"):
        list(Decoder(FROM_ENGINE).feed(data))


def test_messages_before_garbage_are_read() -> None:
    log = Log(level=20, text=b"here")
    decoder = Decoder(FROM_ENGINE).feed(frame_of(log) + b"garbage")
    assert values_of(next(decoder)) == values_of(log)
    with pytest.raises(ProtocolError):
        next(decoder)


def test_a_million_random_bytes_do_no_harm() -> None:
    rng = np.random.default_rng(1)
    begins = [b"", MAGIC, *(HEADER.pack(MAGIC, number, 1568) for number in FROM_ENGINE)]
    for number in range(RANDOM_BYTES // 2000):
        survived(begins[number % len(begins)] + rng.bytes(2000))


def test_valid_frames_with_some_bytes_changed_do_no_harm() -> None:
    rng = np.random.default_rng(2)
    frames = [frame_of(made(kind)) for kind in FROM_ENGINE.values()]
    for _ in range(500):
        data = bytearray(b"".join(frames[index] for index in rng.integers(0, len(frames), 3)))
        for at in rng.integers(0, len(data), rng.integers(1, 5)):
            data[at] = rng.integers(256)
        assert len(survived(bytes(data))) <= 3
        survived(bytes(data[: rng.integers(len(data))]) + bytes(data))


def test_the_longest_that_an_engine_says_is_short() -> None:
    assert len(frame_of(Estimate(**nothing(Estimate)))) < LONGEST < 10_000
    assert len(frame_of(Hello(**nothing(Hello)))) == HEADER.size + 88
