# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The injector: what holds for any stream and any timeline."""

from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.signature import LinkSigning, SigningStreams
from tests.unit.viso.faults.rig import (
    BEAT,
    delta,
    distance,
    encoded,
    every_kind,
    mocap,
    odometry,
    position,
    speed,
)
from viso.faults import FAULTS, Injector, TimedFrame, Timeline, inject, parse_timeline, run_through
from viso.faults.packet import read_packet
from viso.faults.timeline import Entry, make_entry

NUMBERS = st.floats(width=32)
POSES = st.one_of(
    st.builds(odometry, x=NUMBERS, yawspeed=NUMBERS, q=st.tuples(*[NUMBERS] * 4), quality=st.integers(-128, 127)),
    st.builds(position, x=NUMBERS, yaw=NUMBERS, pitch=NUMBERS, usec=st.integers(0, 2**64 - 1)),
    st.builds(speed, z=NUMBERS),
    st.builds(delta, position_delta=st.tuples(*[NUMBERS] * 3)),
    st.builds(mocap, q=st.tuples(*[NUMBERS] * 4)),
    st.just(BEAT),
)
SIGNING = LinkSigning(bytes(32), 0, 0, SigningStreams(), lambda _id: True)


def signed(message: Any) -> bytes:
    codec = Codec(1, 197)
    codec.configure_signing(SIGNING)
    return codec.encode(message)


def framed(sender: tuple[Any, int, int, int]) -> bytes:
    message, system_id, component_id, version = sender
    no_version_1 = version == 1 and type(message).__name__ in ("ODOMETRY", "VISION_POSITION_DELTA")
    return Codec(system_id, component_id, 2 if no_version_1 else version).encode(message)


FRAMES = st.one_of(
    st.tuples(POSES, st.integers(1, 2), st.integers(197, 198), st.sampled_from((1, 2))).map(framed),
    POSES.map(signed),
    st.binary(max_size=40),
)
STREAMS = st.lists(st.tuples(st.integers(-5_000, 200_000), FRAMES), max_size=25)


def at_times(gaps: list[TimedFrame]) -> list[TimedFrame]:
    stream, time_us = [], 1_000_000
    for gap_us, frame in gaps:
        time_us += gap_us
        stream.append((time_us, frame))
    return stream


def entries(kinds: st.SearchStrategy[str]) -> st.SearchStrategy[Entry]:
    spans: list[dict[str, float]] = [{}, {"start_s": 0.3, "end_s": 1.0}, {"at_s": 0.2}]
    common = st.fixed_dictionaries(
        {
            "probability": st.sampled_from((1.0, 0.5)),
            "messages": st.sampled_from(("all", "ODOMETRY", ["HEARTBEAT", "VISION_POSITION_ESTIMATE"], None)),
        }
    )
    made = st.tuples(kinds, st.sampled_from(spans), common)
    return made.map(lambda parts: make_entry(parts[0], {**parts[1], **parts[2]}))


TIMELINES = st.builds(Timeline, st.lists(entries(st.sampled_from(sorted(FAULTS))), max_size=4).map(tuple))
IN_ORDER = entries(st.sampled_from(sorted(FAULTS.keys() - {"reorder", "duplicate", "sender_id", "second_sender"})))


@pytest.mark.slow
@given(gaps=STREAMS)
def test_empty_timeline_changes_neither_bytes_nor_times(gaps: list[TimedFrame]) -> None:
    stream = at_times(gaps)
    assert list(inject(stream, Timeline())) == stream


@pytest.mark.slow
@given(gaps=STREAMS, timeline=TIMELINES, seed=st.integers(0, 3))
def test_same_stream_timeline_and_seed_give_the_same(gaps: list[TimedFrame], timeline: Timeline, seed: int) -> None:
    stream = at_times(gaps)
    assert list(inject(stream, timeline, seed)) == list(inject(stream, timeline, seed))


@pytest.mark.slow
@given(gaps=STREAMS, timeline=TIMELINES)
def test_every_frame_is_accounted_for_and_none_comes_from_nothing(gaps: list[TimedFrame], timeline: Timeline) -> None:
    stream = at_times(gaps)
    injector = Injector(timeline)
    given_out = list(run_through(stream, injector))
    tally = injector.tally()
    assert sum(tally.received.values()) == len(stream)
    assert len(stream) + tally.added - tally.lost == tally.passed_on == len(given_out)
    assert tally.waiting == 0
    for entry in tally.entries:
        assert entry.met == entry.done + sum(entry.passed_over.values())
    before = Counter(frame for _, frame in stream)
    strangers = sum((Counter(frame for _, frame in given_out) - before).values())
    assert strangers <= tally.added + tally.changed
    if "corrupt" not in {entry.kind for entry in timeline.entries}:  # which may hit the message's id
        assert {read_packet(frame).name for _, frame in given_out} <= tally.received.keys()


@pytest.mark.slow
@given(gaps=STREAMS, rows=st.lists(IN_ORDER, max_size=4))
def test_messages_of_one_kind_from_one_sender_stay_in_order(gaps: list[TimedFrame], rows: list[Entry]) -> None:
    # The sequence number tells a frame, whatever becomes of its content.
    stream = at_times([(abs(gap_us), frame) for gap_us, frame in gaps])
    numbers: Counter[Any] = Counter()
    told = []
    for time_us, frame in stream:
        packet = read_packet(frame)
        if packet.version == 2 and not packet.is_signed:
            codec = Codec(packet.system_id, packet.component_id)
            for _ in range(numbers[packet.key]):
                codec.encode(BEAT)
            codec.feed(frame)
            message: Any = codec.next_received()
            if message.message is not None:
                told.append((time_us, codec.encode(message.message)))
                numbers[packet.key] += 1
    last: dict[Any, int] = {}
    latest_us = 0
    for time_us, frame in inject(told, Timeline(tuple(rows))):
        assert time_us >= latest_us
        latest_us = time_us
        packet = read_packet(frame)
        if "corrupt" not in {row.kind for row in rows}:
            assert packet.sequence > last.get(packet.key, -1)
            last[packet.key] = packet.sequence


def test_what_one_entry_draws_makes_no_difference_to_another() -> None:
    stream = [(time_us, encoded(odometry())[0]) for time_us in range(0, 2_000_000, 20_000)]

    def lost(first: str) -> set[int]:
        timeline = parse_timeline(f"faults: [{{{first}}}, {{kind: loss, probability: 0.5}}]", "t")
        return {time_us for time_us, _ in stream} - {time_us for time_us, _ in inject(stream, timeline)}

    assert lost("kind: quality, probability: 0.3") == lost("kind: fail, messages: HEARTBEAT") != set()


def test_seed_given_replaces_that_of_the_timeline() -> None:
    stream = [(time_us, encoded(odometry())[0]) for time_us in range(0, 2_000_000, 20_000)]
    first, second = (parse_timeline(f"seed: {seed}\nfaults: [{{kind: loss, probability: 0.5}}]") for seed in (1, 2))
    assert list(inject(stream, first)) != list(inject(stream, second))
    assert list(inject(stream, first, 2)) == list(inject(stream, second))


def test_a_timeline_serves_many_streams() -> None:
    timeline = parse_timeline("faults: [{kind: frozen}, {kind: quality, values: [1, 2]}]")
    stream = [(0, encoded(odometry(x=1.0))[0]), (1, encoded(odometry(x=2.0))[0])]
    assert list(inject(stream, timeline)) == list(inject(stream, timeline))


def test_faults_meet_a_frame_in_the_order_of_the_timeline() -> None:
    doubled = parse_timeline("faults: [{kind: duplicate}, {kind: quality, values: [1, 2]}]")
    frame = encoded(odometry())[0]
    assert len(set(inject([(0, frame)], doubled))) == 2
    lost_first = parse_timeline("faults: [{kind: fail}, {kind: duplicate}]")
    assert not list(inject([(0, frame)], lost_first))


def test_timeline_begins_with_the_first_frame_or_where_it_is_told() -> None:
    timeline = parse_timeline("faults: [{kind: fail, start_s: 1, end_s: 2}]")
    stream = [(time_us, encoded(odometry())[0]) for time_us in range(7_000_000, 10_000_000, 500_000)]
    assert [time_us for time_us, _ in inject(stream, timeline)] == [7_000_000, 7_500_000, 9_000_000, 9_500_000]
    injector = Injector(timeline, start_us=6_000_000)
    assert next(time_us for time_us, _ in run_through(stream, injector)) == 8_000_000


def test_frames_wait_until_they_are_due() -> None:
    injector = Injector(parse_timeline("faults: [{kind: delay, delay_ms: 40}]"))
    (frame,) = encoded(odometry())
    assert injector.next_due_us() is None
    injector.push(0, frame)
    assert (injector.next_due_us(), injector.pop_due(39_999), injector.tally().waiting) == (40_000, [], 1)
    assert injector.pop_due(40_000) == [(40_000, frame)]
    assert (injector.next_due_us(), injector.tally().waiting) == (None, 0)


def test_frame_from_the_past_keeps_its_time() -> None:
    timeline = parse_timeline("faults: [{kind: delay, delay_ms: 1}]")
    stream = [(10_000, encoded(odometry())[0]), (4_000, encoded(speed())[0])]
    assert [time_us for time_us, _ in inject(stream, timeline)] == [11_000, 5_000]


def test_what_is_not_meant_passes_byte_for_byte() -> None:
    stream = [(number, frame) for number, frame in enumerate(encoded(*every_kind(), BEAT))]
    timeline = parse_timeline("faults: [{kind: reset, messages: VISION_SPEED_ESTIMATE}]")
    changed = [new for old, new in zip(stream, inject(stream, timeline), strict=True) if old != new]
    assert [read_packet(frame).name for _, frame in changed] == ["VISION_SPEED_ESTIMATE"]


@pytest.mark.parametrize("kind", sorted(FAULTS))
def test_signed_frames_keep_their_content(kind: str) -> None:
    frame = signed(distance() if FAULTS[kind].for_messages else odometry())
    injector = Injector(parse_timeline(f"faults: [{{kind: {kind}}}]"))
    given_out = [out for _, out in run_through([(0, frame)], injector)]
    tally = injector.tally()
    if kind == "corrupt":
        assert tally.changed == 1
    else:
        assert set(given_out) <= {frame}
        assert tally.entries[0].done or tally.entries[0].passed_over == {"signed": 1}


def test_tally_counts_by_name() -> None:
    injector = Injector(Timeline())
    list(run_through([(0, frame) for frame in (*encoded(BEAT, odometry(), odometry()), b"noise")], injector))
    assert injector.tally().received == {"HEARTBEAT": 1, "ODOMETRY": 2, "BAD_DATA": 1}
