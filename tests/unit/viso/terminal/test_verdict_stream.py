# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A line a message, and a line a sample in the filter."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from ap_core.verdict import Rule
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ingest_rules import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from tests.unit.viso.conftest import BOOTED_US, Bench, odometry
from viso.terminal.verdict_stream import (
    LineWriter,
    VerdictFormat,
    VerdictStream,
    filter_json_line,
    filter_text_line,
    json_line,
    text_line,
)

LINK = "udpin:0.0.0.0:14550"


@pytest.fixture
def events(make_bench: Callable[..., Bench]) -> list[MessageEvent]:
    """Return the outcome of a pose of low quality, and of bytes that are none."""
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
        "model": False,
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
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT)
    stream = VerdictStream(LineWriter(descriptor), kind, str(path))
    for event in events:
        stream.take(LINK, event)
    stream.close()
    os.close(descriptor)
    assert len(path.read_text().splitlines()) == len(events) == 2
    assert stream.failure() is None
    assert not stream.reader_left


def test_loss_is_told_with_its_reason(events: list[MessageEvent]) -> None:
    descriptor = os.open("/dev/full", os.O_WRONLY)
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


# Samples in the filter

REJECTED = FilterOutcome("pose", rules.GATE_POSITION, 12_290, 3.21)


def told(tmp_path: Path, kind: VerdictFormat, *outcomes: tuple[str, Rule]) -> list[str]:
    """Return the lines that outcomes of a kind and by a rule lead to."""
    path = tmp_path / "verdicts"
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT)
    stream = VerdictStream(LineWriter(descriptor), kind, str(path))
    for what, rule in outcomes:
        stream.take_outcome(1_000_000, FilterOutcome(what, rule, 900, None))
    stream.close()
    os.close(descriptor)
    return path.read_text().splitlines()


def test_sample_for_people() -> None:
    expected = (
        "   12.345 s  filter  pose at 12.290 s  "
        "rejected: horizontal position gate, ratio 3.2 (model_gate_position; a model's)"
    )
    assert filter_text_line(12_345_000, REJECTED) == expected


def test_refusal_at_the_door_is_no_models() -> None:
    line = filter_text_line(1_000_000, FilterOutcome("yaw", rules.TOO_SOON, 900, None))
    assert line.endswith(
        "  filter  yaw at 0.900 s  refused: less than 20 ms, odometry 50 ms, after the last (too_soon)"
    )


def test_sample_for_machines() -> None:
    assert json.loads(filter_json_line(12_345_000, REJECTED)) == {
        "time_us": 12_345_000,
        "link": None,
        "type": "FILTER",
        "kind": "pose",
        "observed_ms": 12_290,
        "outcome": "rejected",
        "rule": "model_gate_position",
        "reason": "rejected: horizontal position gate",
        "ratio": 3.21,
        "model": True,
    }


def test_machines_are_told_of_every_sample_once_it_is_settled(tmp_path: Path) -> None:
    outcomes = [("pose", rules.TAKEN), *[("pose", rules.FUSED)] * 3, ("yaw", rules.UNUSED), ("yaw", rules.UNUSED)]
    lines = told(tmp_path, VerdictFormat.JSON, *outcomes)
    assert [json.loads(line)["rule"] for line in lines] == ["model_fused"] * 3 + ["model_unused"] * 2


@pytest.mark.parametrize(("first", "count"), [
    (rules.FUSED, 1),
    (rules.UNUSED, 1),
    (rules.NO_BUFFER, 1),
    (rules.GATE_POSITION, 3),
    (rules.RESET_TO, 3),
    (rules.TOO_OLD, 3),
])  # fmt: skip
def test_people_are_not_told_that_it_goes_on_as_before(tmp_path: Path, first: Rule, count: int) -> None:
    assert len(told(tmp_path, VerdictFormat.TEXT, *[("pose", first)] * 3)) == count


def test_people_are_told_of_every_change(tmp_path: Path) -> None:
    changes = [rules.FUSED, rules.TAKEN, rules.FUSED, rules.TOO_SOON, rules.FUSED, rules.GATE_POSITION, rules.FUSED]
    lines = told(tmp_path, VerdictFormat.TEXT, *(("pose", rule) for rule in changes))
    assert [line.partition(" s  ")[2].split("  ")[2].split(":")[0] for line in lines] == [
        "fused",
        "refused",
        "fused",
        "rejected",
        "fused",
    ]


def test_kinds_change_on_their_own(tmp_path: Path) -> None:
    outcomes = [("pose", rules.FUSED), ("yaw", rules.UNUSED), ("pose", rules.FUSED), ("yaw", rules.UNUSED)]
    assert len(told(tmp_path, VerdictFormat.TEXT, *outcomes)) == 2
