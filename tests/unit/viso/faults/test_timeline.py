# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Timelines: what they may hold, and one line for what they may not."""

import math
from pathlib import Path

import pytest

from mav_handlers.handlers import VISION_NAMES
from viso.faults import FAULTS, Timeline, TimelineError, load_timeline, parse_timeline
from viso.faults.motion import PositionGlitch


def one(text: str) -> str:
    return f"faults: [{{{text}}}]"


def test_entry_with_nothing_but_a_kind_holds_for_all_external_navigation_at_all_times() -> None:
    (entry,) = parse_timeline(one("kind: fail")).entries
    assert (entry.start_s, entry.end_s, entry.once, entry.probability) == (0.0, math.inf, False, 1.0)
    assert entry.messages == VISION_NAMES
    assert entry.covers(0, "ODOMETRY")
    assert not entry.covers(0, "HEARTBEAT")


def test_start_is_included_and_end_is_not() -> None:
    (entry,) = parse_timeline(one("kind: fail, start_s: 0.3, end_s: 0.7")).entries
    times_us = (299_999, 300_000, 699_999, 700_000)
    assert [entry.covers(time_us, "ODOMETRY") for time_us in times_us] == [False, True, True, False]


def test_blackout_is_for_everything_unless_told_otherwise() -> None:
    first, second = parse_timeline("faults: [{kind: blackout}, {kind: blackout, messages: HEARTBEAT}]").entries
    assert first.covers(0, "BAD_DATA")
    assert second.messages == frozenset({"HEARTBEAT"})


@pytest.mark.parametrize(("kind", "once"), [("glit", True), ("clock_step", False)])
def test_at_s_is_one_message_except_for_what_goes_on(kind: str, once: bool) -> None:
    (entry,) = parse_timeline(one(f"kind: {kind}, at_s: 3")).entries
    assert (entry.start_s, entry.end_s, entry.once) == (3.0, math.inf, once)


def test_a_number_that_yaml_takes_for_text_is_a_number() -> None:
    (entry,) = parse_timeline(one("kind: glit, x_m: 1e3, y_m: 2")).entries
    assert entry.fault == PositionGlitch(x_m=1000.0, y_m=2.0)


@pytest.mark.parametrize("kind", FAULTS)
def test_every_kind_works_with_its_defaults(kind: str) -> None:
    (entry,) = parse_timeline(one(f"kind: {kind}")).entries
    assert entry.kind == kind


def test_seed_is_read() -> None:
    assert parse_timeline("seed: 9\nfaults: []") == Timeline((), 9)


@pytest.mark.parametrize(("text", "complaint"), [
    ("", "t.yaml: a timeline has a list 'faults'"),
    ("[]", "t.yaml: a timeline has a list 'faults'"),
    ("faults: 3", "t.yaml: faults: not a list"),
    ("faults: []\nsneed: 1", "t.yaml: sneed: unknown field; there are faults, seed"),
    ("faults: []\nseed: -1", "t.yaml: seed: -1 is no whole number from 0 to 9223372036854775807"),
    ("faults: []\nseed: true", "t.yaml: seed: True is no whole number from 0 to 9223372036854775807"),
    ("faults:\n  - {kind: loss\n", "t.yaml: not YAML: line 3: expected ',' or '}', but got '<stream end>'"),
    ("faults: [\x00]", "t.yaml: not YAML: unacceptable character #x0000: special characters are not allowed"),
    ("faults: [3]", "t.yaml: entry 1: kind: missing; there are fail, "),
    ("faults: [{kind: fail}, {kind: lose}]", "t.yaml: entry 2: kind: 'lose' is unknown; there are fail, "),
    (one("kind: [a]"), "t.yaml: entry 1: kind: ['a'] is unknown; there are fail, "),
    (one("kind: fail, probabilty: 1"),
     "t.yaml: entry 1 (fail): probabilty: unknown field; there are kind, start_s, end_s, at_s, messages, probability"),
    (one("kind: delay, 7: 1"), "t.yaml: entry 1 (delay): 7: unknown field; there are "),
    (one("kind: delay, _left: 1"), "t.yaml: entry 1 (delay): _left: unknown field; there are "),
    (one("kind: fail, probability: 1.5"), "t.yaml: entry 1 (fail): probability: 1.5 is not within 0 to 1"),
    (one("kind: fail, probability: .nan"), "t.yaml: entry 1 (fail): probability: nan is not within 0 to 1"),
    (one("kind: fail, start_s: soon"), "t.yaml: entry 1 (fail): start_s: 'soon' is no number"),
    (one("kind: fail, start_s: -1"), "t.yaml: entry 1 (fail): start_s: -1 is not within 0 to 1e+09"),
    (one("kind: fail, start_s: 4, end_s: 4"), "t.yaml: entry 1 (fail): end_s: 4 is not after start_s, 4"),
    (one("kind: fail, at_s: 4, end_s: 5"), "t.yaml: entry 1 (fail): end_s: not together with at_s"),
    (one("kind: fail, messages: ODOMETRI"), "t.yaml: entry 1 (fail): messages: 'ODOMETRI' is no message"),
    (one("kind: fail, messages: [[]]"), "t.yaml: entry 1 (fail): messages: [] is no message"),
    (one("kind: fail, messages: []"),
     "t.yaml: entry 1 (fail): messages: [] is neither a name, nor a list of them, nor all"),
    (one("kind: delay, delay_ms: -1"), "t.yaml: entry 1 (delay): delay_ms: -1 is not within 0 to 60000"),
    (one("kind: delay, delay_ms: true"), "t.yaml: entry 1 (delay): delay_ms: True is no number"),
    (one("kind: delay, delay_ms: .nan"), "t.yaml: entry 1 (delay): delay_ms: not a number"),
    (one("kind: scale, factor: .inf"), "t.yaml: entry 1 (scale): factor: inf is not within -1e+06 to 1e+06"),
    (one("kind: corrupt, bits: 1.5"), "t.yaml: entry 1 (corrupt): bits: 1.5 is no whole number"),
    (one("kind: stamp_unit, unit: h"), "t.yaml: entry 1 (stamp_unit): unit: 'h' is none of s, ms, ns"),
    (one("kind: quality, values: 3"), "t.yaml: entry 1 (quality): values: 3 is no list, or an empty one"),
    (one("kind: quality, values: [3, 256]"), "t.yaml: entry 1 (quality): values: 256 is not within -128 to 255"),
    (one("kind: nan, fields: [quality]"), "t.yaml: entry 1 (nan): fields: no message has a number 'quality'; there "),
    (one("kind: axes, world_axes: 3"), "t.yaml: entry 1 (axes): world_axes: 3 is no text"),
    (one("kind: axes, world_axes: ENN"),
     "t.yaml: entry 1 (axes): world_axes: 'ENN' are not three perpendicular axes, such as ENU or FRD"),
    (one("kind: axes, world_axes: NEU"),
     "t.yaml: entry 1 (axes): of: NEU and FRD differ in handedness, so no attitude fits"),
    ("faults: [2020-13-77]", "t.yaml: not YAML: "),
])  # fmt: skip
def test_what_cannot_be_used_is_one_line_with_file_entry_and_field(text: str, complaint: str) -> None:
    with pytest.raises(TimelineError) as refused:
        parse_timeline(text, "t.yaml")
    said = str(refused.value)
    assert said.startswith(complaint)
    assert len(said.splitlines()) == 1


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(TimelineError, match=r"^timeline: nested too deeply$"):
        parse_timeline("[" * 600)


def test_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "f.yaml"
    path.write_text("\ufefffaults: [{kind: fail}]", encoding="utf-8")
    assert [entry.kind for entry in load_timeline(path).entries] == ["fail"]


def test_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / "f.yaml"
    with pytest.raises(TimelineError, match=r"f\.yaml: No such file or directory"):
        load_timeline(path)
    path.write_bytes(b"\xff\xff")
    with pytest.raises(TimelineError, match=r"f\.yaml: not UTF-8 text"):
        load_timeline(path)
    path.write_text("faults: 1")
    with pytest.raises(TimelineError, match=r"f\.yaml: faults: not a list"):
        load_timeline(path)
