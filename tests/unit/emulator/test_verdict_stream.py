# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A line a message."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from emulator.errors import InputError
from emulator.line_writer import LineWriter
from emulator.verdict_stream import VerdictFormat, VerdictStream, create_verdict_file, json_line, text_line
from mav_handlers.endpoint import MessageEvent
from tests.unit.emulator.conftest import BOOTED_US, Bench, odometry

LINK = "udpin:0.0.0.0:14550"


@pytest.fixture
def events(make_bench: Callable[..., Bench]) -> list[MessageEvent]:
    """Return what became of a pose of low quality, and of bytes that are none."""
    bench = make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50)
    taken: list[MessageEvent] = []
    bench.vehicle.endpoint.on_event = taken.append
    bench.send(odometry(bench.scheduler.now_us, quality=5))
    bench.scheduler.deliver(bench.channel, b"noise")
    return taken


def test_verdict_for_machines_has_everything(events: list[MessageEvent]) -> None:
    assert json.loads(json_line(LINK, events[0])) == {
        "time_us": BOOTED_US,
        "link": LINK,
        "type": "ODOMETRY",
        "sysid": 255,
        "compid": 190,
        "seq": 0,
        "outcome": "ignored",
        "rule": "quality_below_min",
        "reason": "quality is below VISO_QUAL_MIN",
    }


def test_bytes_that_are_no_frame_have_no_sender(events: list[MessageEvent]) -> None:
    line = json.loads(json_line(LINK, events[1]))
    assert line["type"] == "BAD_DATA"
    assert [line[name] for name in ("sysid", "compid", "seq")] == [None, None, None]


def test_verdict_for_people(events: list[MessageEvent]) -> None:
    start = f"{BOOTED_US / 1e6:9.3f} s  {LINK}  "
    reason = "ignored: quality is below VISO_QUAL_MIN (quality_below_min)"
    assert text_line(LINK, events[0]) == f"{start}ODOMETRY 255:190 #0  {reason}"
    assert text_line(LINK, events[1]).startswith(f"{start}BAD_DATA  dropped: ")


@pytest.mark.parametrize("kind", VerdictFormat)
def test_every_message_has_a_line(events: list[MessageEvent], tmp_path: Path, kind: VerdictFormat) -> None:
    path = tmp_path / "verdicts"
    descriptor = create_verdict_file(path)
    stream = VerdictStream(LineWriter(descriptor), kind, str(path))
    for event in events:
        stream.take(LINK, event)
    stream.close()
    os.close(descriptor)
    assert len(path.read_text().splitlines()) == len(events) == 2
    assert stream.failure() is None
    assert not stream.reader_left


def test_loss_is_told_with_its_reason(events: list[MessageEvent]) -> None:
    descriptor = create_verdict_file(Path("/dev/full"))
    stream = VerdictStream(LineWriter(descriptor), VerdictFormat.JSON, "verdicts.jsonl")
    stream.take(LINK, events[0])
    stream.close()
    os.close(descriptor)
    assert stream.failure() == "verdicts.jsonl: 1 verdicts lost: No space left on device"


def test_reader_that_does_not_read_is_told(events: list[MessageEvent]) -> None:
    writer = LineWriter(-1, limit=0)
    stream = VerdictStream(writer, VerdictFormat.JSON, "--verdicts")
    stream.take(LINK, events[0])
    stream.close()
    assert stream.failure() == "--verdicts: 1 verdicts lost: they were not read in time"


def test_reader_that_left_is_no_failure(events: list[MessageEvent]) -> None:
    reader, descriptor = os.pipe()
    os.close(reader)
    stream = VerdictStream(LineWriter(descriptor), VerdictFormat.TEXT, "--verdicts")
    stream.take(LINK, events[0])
    stream.close()
    os.close(descriptor)
    assert stream.reader_left
    assert stream.failure() is None


def test_file_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        create_verdict_file(tmp_path / "none" / "verdicts")
    assert str(error.value) == f"{tmp_path}/none/verdicts: No such file or directory"
