# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two replays of one stream, compared: what is told to differ, and that nothing else is."""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from ekf_stub.inputs.measurements import FlowMeasurement
from ekf_stub.reports import AidingMode
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import OPTICAL_FLOW
from tests.unit.viso.conftest import odometry
from viso.compare.outputs import ROWS, replay_tables, setting_lines
from viso.compare.two_replays import (
    SHOWN,
    CountChange,
    FlowChange,
    MessageChange,
    ReplayComparison,
    TextChange,
    compare_replays,
)
from viso.replay.run import ReplayOutcome, ReplaySetup, SaidText, run_replay
from viso.streams.stream_kinds import Stream, StreamMessage
from viso.vehicle.config import bench, by_ekf3
from viso.vehicle.outcomes import AidingSpan
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource

START_US = 6_000_000
PERIOD_US = 33_333
BY_EXT_NAV = {f"EK3_SRC1_{what}": 6 for what in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")}
SETTINGS = {"VISO_TYPE": 1, "GPS1_TYPE": 0, **BY_EXT_NAV}
STANDING = ReplaySetup(bench())
WATCHED = ReplaySetup(by_ekf3(FollowSource, ImuOptions()), with_filter=True)
NOTHING = ReplayOutcome({}, (), {}, {}, ())


def stream(*qualities: int, start_us: int = 3_000_000) -> Stream:
    """Return a stream of poses with these qualities, 30 per second."""
    times_us = range(start_us, start_us + PERIOD_US * len(qualities), PERIOD_US)
    camera = Codec(1, 197)
    messages = (
        StreamMessage(time_us, camera.encode(odometry(time_us, x=1.0, quality=quality)))
        for time_us, quality in zip(times_us, qualities, strict=True)
    )
    return Stream("test", tuple(messages))


def run(recorded: Stream, settings: Mapping[str, float] = SETTINGS, setup: ReplaySetup = STANDING) -> ReplayOutcome:
    return run_replay(recorded, settings, setup, keep_messages=True)


def printed(comparison: ReplayComparison, *, with_filter: bool = False) -> str:
    console = Console(file=StringIO(), width=200)
    console.print(*replay_tables(comparison, with_filter=with_filter))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_same_settings_differ_in_nothing() -> None:
    recorded = stream(90, 10)
    comparison = compare_replays(run(recorded), run(recorded))
    assert comparison == ReplayComparison([], [], [], None, 0, [], [], [], [], [])
    assert printed(comparison) == "no verdict differs; --ekf shows what the filter makes of it\n"
    assert printed(comparison, with_filter=True) == "no verdict differs\n"


def test_verdicts_that_differ_are_counted_and_named() -> None:
    recorded = stream(90, 10, 90, 15)
    comparison = compare_replays(run(recorded), run(recorded, {**SETTINGS, "VISO_QUAL_MIN": 20}))
    assert comparison.verdicts == [
        CountChange("ODOMETRY", "accepted", "consumed", 4, 2),
        CountChange("ODOMETRY", "ignored", "quality_below_min", 0, 2),
    ]
    arrivals_us = [3_000_000 + PERIOD_US, 3_000_000 + 3 * PERIOD_US]
    assert comparison.messages == [
        MessageChange(number, arrival_us, "ODOMETRY", "verdict", "consumed", "quality_below_min")
        for number, arrival_us in zip((2, 4), arrivals_us, strict=True)
    ]
    assert (comparison.changed_messages, comparison.records, comparison.first_record) == (2, 2, 2)


def test_records_may_differ_where_no_verdict_does() -> None:
    recorded = stream(90, 90, 90)
    comparison = compare_replays(run(recorded), run(recorded, {**SETTINGS, "VISO_SCALE": 2}))
    assert (comparison.messages, comparison.records, comparison.first_record) == ([], 3, 1)
    assert "log records of 3 messages differ, first of message 1" in printed(comparison)


@pytest.mark.slow
def test_outcomes_in_the_filter_that_differ_are_told_by_sample() -> None:
    recorded = stream(*(90,) * 30, start_us=START_US)
    before, after = (run(recorded, {**SETTINGS, "EK3_SRC1_POSXY": source}, WATCHED) for source in (6, 0))
    comparison = compare_replays(before, after)
    assert comparison.verdicts == []
    assert {change.what for change in comparison.messages} >= {"pose"}
    assert ("model_fused", "model_unused") in {(change.before, change.after) for change in comparison.messages}
    assert {change.name for change in comparison.samples} >= {"pose"}
    assert AidingMode.ABSOLUTE in {span.mode for span in comparison.aiding_before}
    assert "a model's" in printed(comparison, with_filter=True)


@pytest.mark.parametrize(("before", "after", "expected"), [
    ([(5, "a")], [(5, "a")], []),
    ([(5, "a")], [], [TextChange(6, "a", 5, None)]),
    ([], [(5, "a")], [TextChange(6, "a", None, 5)]),
    ([(5, "a")], [(7, "a")], [TextChange(6, "a", 5, 7)]),
    ([(5, "a"), (9, "a")], [(5, "a")], [TextChange(6, "a", 9, None)]),
    ([(8, "b")], [(5, "a")], [TextChange(6, "a", None, 5), TextChange(6, "b", 8, None)]),
])  # fmt: skip
def test_texts_are_paired_in_their_order(
    before: list[tuple[int, str]], after: list[tuple[int, str]], expected: list[TextChange]
) -> None:
    first, second = (
        replace(NOTHING, texts=tuple(SaidText(time_us, 6, text) for time_us, text in texts))
        for texts in (before, after)
    )
    assert compare_replays(first, second).texts == expected


def test_spans_of_navigation_that_are_the_same_are_left_out() -> None:
    common, first, second = (AidingSpan(0, 5, AidingMode.NONE), *(
        AidingSpan(5, end_us, AidingMode.ABSOLUTE) for end_us in (9, 8)
    ))  # fmt: skip
    comparison = compare_replays(replace(NOTHING, aiding=(common, first)), replace(NOTHING, aiding=(common, second)))
    assert (comparison.aiding_before, comparison.aiding_after) == ([first], [second])


def test_many_texts_and_spans_are_told_in_part() -> None:
    said = [*range(ROWS + 3), *(99,) * 6]
    texts = tuple(SaidText(time_us, 6, f"text {number}") for time_us, number in enumerate(said))
    spans = tuple(AidingSpan(start_us, start_us + 1, AidingMode.NONE) for start_us in range(ROWS + 5))
    comparison = compare_replays(NOTHING, replace(NOTHING, texts=texts, aiding=spans))
    assert (len(comparison.texts), len(comparison.aiding_after)) == (ROWS + 9, ROWS + 5)
    told = printed(comparison)
    assert told.count("(6) text") == ROWS
    assert 'and 9 more: 6 "text 99", 1 "text 20", 1 "text 21", 1 "text 22"' in " ".join(told.split())
    assert "and 5 more: 5 by none after" in told


def test_only_the_first_messages_are_told_one_by_one() -> None:
    recorded = stream(*(10,) * (SHOWN + 5))
    comparison = compare_replays(run(recorded), run(recorded, {**SETTINGS, "VISO_QUAL_MIN": 20}))
    rows = comparison.as_dict()
    assert rows["changed_messages"] == SHOWN + 5
    assert isinstance(rows["first_messages"], list)
    assert [row["number"] for row in rows["first_messages"]] == list(range(1, SHOWN + 1))
    assert rows["first_messages"][0]["after_reason"] == "quality is below VISO_QUAL_MIN"
    assert printed(comparison).count("│ verdict │") == SHOWN


def test_settings_are_told_with_what_they_were() -> None:
    before = replace(NOTHING, params={"VISO_DELAY_MS": 10.0})
    assert list(setting_lines({"VISO_DELAY_MS": 80, "VISO_NEW": 1}, before)) == [
        "VISO_DELAY_MS: 10 -> 80",
        "VISO_NEW: 1",
    ]


@pytest.mark.parametrize(
    ("viso_type", "changes", "told"),
    [
        (1, {"VISO_ORIENT": 4}, ["VISO_ORIENT: 0 -> 4, without effect: VISO_TYPE 1 passes poses on as they come"]),
        (2, {"VISO_ORIENT": 4}, ["VISO_ORIENT: 0 -> 4"]),
        (1, {"VISO_ORIENT": 4, "VISO_TYPE": 3}, ["VISO_ORIENT: 0 -> 4", "VISO_TYPE: 1 -> 3"]),
    ],
)
def test_orientation_that_nothing_heeds_is_told_as_that(
    viso_type: int, changes: dict[str, float], told: list[str]
) -> None:
    before = replace(NOTHING, params={"VISO_ORIENT": 0.0, "VISO_TYPE": float(viso_type)})
    assert list(setting_lines(changes, before)) == told


def test_messages_are_kept_on_request_only() -> None:
    assert run_replay(stream(90), SETTINGS, STANDING).messages == ()


def measured(*rates: tuple[float, float]) -> tuple[FlowMeasurement, ...]:
    return tuple(FlowMeasurement(100, rate, (0.0, 0.0)) for rate in rates)


def test_flow_that_differs_is_told_with_its_size() -> None:
    same = run(stream(50))
    before = replace(same, flow=measured((0.3, 0.4), (math.nan, 0.0), (0.0, 0.0)))
    assert compare_replays(before, before).flow is None
    after = replace(same, flow=measured((3.0, 4.0), (math.nan, 0.0)))
    comparison = compare_replays(before, after)
    assert comparison.flow == FlowChange(2, 3, math.sqrt(0.125), 5.0)
    assert "flow: 2 of 3 measurements differ: 0.354 rad/s before, 5 after (root mean square)" in printed(comparison)
    assert json.loads(json.dumps(comparison.as_dict()))["flow"]["total"] == 3


def test_flow_is_kept_with_the_messages_only() -> None:
    packets = [Codec(1, 197).encode(OPTICAL_FLOW(0, 0, 100, 0, 0.0, 0.0, 90, 1.0)) for _ in range(3)]
    frames = tuple(StreamMessage(3_000_000 + 40_000 * number, packet) for number, packet in enumerate(packets))
    flow = Stream("flow", frames)
    kept = run(flow, {"FLOW_TYPE": 5})
    assert [one.quality for one in kept.flow] == [90, 90]  # the vehicle ends with the last message
    assert [one.flow[0] for one in kept.flow] == pytest.approx([0.0, 4.0], abs=0.3)
    assert run_replay(flow, {"FLOW_TYPE": 5}, STANDING).flow == ()
