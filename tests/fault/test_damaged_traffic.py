# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded traffic with flipped bits, cut, repeated, reordered and mixed with noise: nothing but whole frames count."""

import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from ap_core.verdict import VerdictKind
from mav_handlers.endpoint import MessageEvent
from tests.places import RECORDED
from viso.streams.stream_kinds import StreamMessage, read_capture

if TYPE_CHECKING:
    from tests.fault.conftest import Bench, MakeBench

pytestmark = pytest.mark.slow

CAPTURES = sorted((RECORDED / "captures").glob("*.jsonl.gz"))
FRAMES = 300
# The beginning of one of them stands for the rest unless there is time.
SHORTENED, FEW_FRAMES = RECORDED / "captures" / "mav.jsonl.gz", 80

Damage = Callable[[list[bytes], random.Random], list[bytes]]


def flip_bits(frames: list[bytes], source: random.Random) -> list[bytes]:
    """Flip a bit in about every fifth frame."""
    for index in source.sample(range(len(frames)), len(frames) // 5):
        damaged = bytearray(frames[index])
        damaged[source.randrange(len(damaged))] ^= 1 << source.randrange(8)
        frames[index] = bytes(damaged)
    return frames


def cut_off(frames: list[bytes], source: random.Random) -> list[bytes]:
    """Lose the end of about every fifth frame."""
    for index in source.sample(range(len(frames)), len(frames) // 5):
        frames[index] = frames[index][: source.randrange(len(frames[index]))]
    return frames


def lose_bytes(frames: list[bytes], source: random.Random) -> list[bytes]:
    """Lose stretches anywhere, as an overrun buffer does."""
    stream = bytearray(b"".join(frames))
    for _ in range(len(frames) // 10):
        start = source.randrange(len(stream))
        del stream[start : start + source.randrange(1, 80)]
    return [bytes(stream[start : start + 97]) for start in range(0, len(stream), 97)]


def repeat(frames: list[bytes], source: random.Random) -> list[bytes]:
    """Deliver every frame up to three times."""
    return [frame for frame in frames for _ in range(source.randrange(1, 4))]


def reorder(frames: list[bytes], source: random.Random) -> list[bytes]:
    """Let frames overtake each other."""
    return [frame for _, frame in sorted((index + source.randrange(8), frame) for index, frame in enumerate(frames))]


def mix_with_noise(frames: list[bytes], source: random.Random) -> list[bytes]:
    """Put noise between frames."""
    return [part for frame in frames for part in (frame, source.randbytes(source.randrange(60)))]


DAMAGES: Sequence[Damage] = (flip_bits, cut_off, lose_bytes, repeat, reorder, mix_with_noise)


class Listener:
    """Tells what of a damaged stream was taken for a sample."""

    def __init__(self, bench: "Bench", originals: Sequence[bytes]) -> None:
        self._originals = set(originals)
        self.samples = 0
        self.forged = 0
        bench.on_event = self._take

    def _take(self, event: MessageEvent) -> None:
        if event.verdict.kind in (VerdictKind.ACCEPTED, VerdictKind.IGNORED):
            assert event.header is not None
            self.samples += 1
            self.forged += event.header.frame not in self._originals


def play(bench: "Bench", messages: Sequence[StreamMessage], parts: Sequence[bytes]) -> None:
    """Deliver parts, spread over the time that the messages took."""
    times = [message.arrival_us for message in messages if message.arrival_us is not None]
    begin_us, step_us = bench.now_us, (times[-1] - times[0]) / len(parts)
    for number, part in enumerate(parts):
        bench.deliver(0, part)
        bench.scheduler.run_until(max(bench.now_us, begin_us + round(number * step_us)))
        bench.read_all()


def stand_damage(bench: "Bench", capture: Path, damage: Damage, frames: int = FRAMES) -> None:
    """Play a damaged capture and check that nothing but its frames counted, and then everything else."""
    messages = read_capture(capture).messages[:frames]
    originals = [message.frame for message in messages]
    listener = Listener(bench, originals)
    play(bench, messages, damage(list(originals), random.Random(capture.name)))
    assert listener.forged == 0
    assert listener.samples > len(originals) // 4
    records = bench.check_everything()
    assert records["VISP"] + records["VISV"] + records["VISO"] >= listener.samples


def name_of(damage: Damage) -> str:
    return damage.__name__


@pytest.mark.parametrize("damage", DAMAGES, ids=name_of)
def test_damaged_traffic_yields_nothing_but_what_was_sent(make_bench: "MakeBench", damage: Damage) -> None:
    stand_damage(make_bench(), SHORTENED, damage, FEW_FRAMES)


@pytest.mark.parametrize("capture", CAPTURES)
@pytest.mark.parametrize("turn", [0, 3])
def test_every_recorded_stream_stands_two_kinds_of_damage(make_bench: "MakeBench", turn: int, capture: Path) -> None:
    damage = DAMAGES[(CAPTURES.index(capture) + turn) % len(DAMAGES)]
    stand_damage(make_bench(), capture, damage)
