# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bytes that mean nothing: the vehicle counts every one of them, keeps its memory and goes on."""

import random
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.fault.conftest import Bench, MakeBench, Memory

CHUNK_BYTES = 1000
# Most of it for the names of types of message that do not exist; a leak of a byte a byte would be more.
ALLOWED_GROWTH_BYTES = 300_000
UNKNOWN_IDS = range(100_000, 105_000)


def pour(bench: "Bench", count: int, source: random.Random) -> None:
    """Deliver random bytes on the first link, a chunk for each pass of the main loop."""
    for _ in range(count // CHUNK_BYTES):
        bench.deliver(0, source.randbytes(CHUNK_BYTES))
        bench.run_ms(2.5)
        bench.read_all()


def stand_noise(bench: "Bench", memory: "Memory", count: int) -> int:
    """Pour noise in, check everything, and return by how much memory grew after the first third."""
    source = random.Random(1)
    pour(bench, count // 3, source)
    memory.begin()
    pour(bench, count - count // 3, source)
    growth = memory.growth()
    bench.check_everything()
    return growth


def test_random_bytes_are_counted_and_do_no_harm(make_bench: "MakeBench", memory: "Memory") -> None:
    bench = make_bench()
    assert stand_noise(bench, memory, 20_000) < ALLOWED_GROWTH_BYTES
    assert bench.channels[0].bytes_received > 18_000


@pytest.mark.slow
def test_two_million_random_bytes_are_counted_and_do_no_harm(make_bench: "MakeBench", memory: "Memory") -> None:
    assert stand_noise(make_bench(), memory, 2_000_000) < ALLOWED_GROWTH_BYTES


def unknown_frame(message_id: int) -> bytes:
    """Return a frame of a type that no dialect has; nobody can say whether its checksum is right."""
    return bytes((0xFD, 0, 0, 0, 0, 255, 190)) + message_id.to_bytes(3, "little") + bytes(2)


def test_types_of_message_that_nobody_knows_do_not_fill_the_memory(make_bench: "MakeBench") -> None:
    bench = make_bench()
    for start in range(UNKNOWN_IDS.start, UNKNOWN_IDS.stop, 100):
        bench.deliver(0, b"".join(unknown_frame(number) for number in range(start, start + 100)))
        bench.run_ms(2.5)
    assert bench.channels[0].frames_received == len(UNKNOWN_IDS)
    assert len(bench.channels[0].counters) < 1000
