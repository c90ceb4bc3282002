# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Feeding a stream: which messages were waiting together, when they come, and what is told of each."""

import itertools
import struct
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.verdict import VerdictKind
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY, VISION_SPEED_ESTIMATE, Message
from tests.unit.viso.conftest import odometry
from tests.unit.viso.passes import times_of_passes
from viso.replay import feed
from viso.replay.feed import Replay, ReplayedMessage, batches, makes_record
from viso.streams.stream_kinds import Stream, StreamMessage
from viso.vehicle.config import by_ekf3
from viso.vehicle.outcomes import OUTCOME_WAIT_US, FilterWatch
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource
from viso.vehicle.vehicle import Vehicle, VehicleConfig


def frame(message: Message) -> bytes:
    return Codec(1, 197).encode(message)


def speed(usec: int = 0) -> Message:
    return VISION_SPEED_ESTIMATE(usec, 1.0, 2.0, 3.0, (0.0,) * 9, 0)


def pose(frame_id: int = 20) -> Message:
    nothing = (0.0,) * 21
    return ODOMETRY(0, frame_id, 12, 0, 0, 0, (1, 0, 0, 0), 0, 0, 0, 0, 0, 0, nothing, nothing, 0, 3, 50)


SAMPLE = frame(speed())
SILENT = frame(HEARTBEAT(18, 8, 0, 0, 4, 3))


def stream(*messages: tuple[int | None, bytes], shared: bool = True, **params: float) -> Stream:
    made = tuple(StreamMessage(arrival_us, data) for arrival_us, data in messages)
    return Stream("test", made, {"VISO_TYPE": 1, **params}, shared_arrival=shared)


def sizes(recorded: Stream) -> list[int]:
    return [len(batch) for batch in batches(recorded)]


def run(recorded: Stream, baud: int | None = None) -> list[ReplayedMessage]:
    return list(Replay(Vehicle(VehicleConfig(defaults=recorded.params)), recorded, baud).run())


def field(message: ReplayedMessage, index: int) -> Any:
    return message.records[0][1][index]


# Which messages make a record


@pytest.mark.parametrize(("data", "expected"), [
    (SAMPLE, True),
    (SILENT, False),
    (frame(pose()), True),
    (frame(pose(frame_id=1)), False),
    (b"noise", False),
    (b"", False),
    (SAMPLE[:-1] + bytes([SAMPLE[-1] ^ 1]), False),
])  # fmt: skip
def test_external_navigation_makes_records(data: bytes, expected: bool) -> None:
    assert makes_record(data) is expected


# Which messages were waiting together


def test_messages_of_one_time_were_waiting_together() -> None:
    assert sizes(stream((1, SAMPLE), (1, SAMPLE), (2, SAMPLE), (3, SAMPLE), (3, SAMPLE))) == [2, 1, 2]


def test_message_without_a_record_in_between_was_waiting_too() -> None:
    assert sizes(stream((1, SAMPLE), (1, SILENT), (1, SAMPLE))) == [3]


def test_messages_without_a_record_at_the_end_are_fed_alone() -> None:
    assert sizes(stream((1, SAMPLE), (1, SILENT), (1, SILENT), (2, SAMPLE))) == [1, 1, 1, 1]


def test_messages_before_any_time_is_known_are_fed_alone() -> None:
    assert sizes(stream((None, SILENT), (None, SILENT), (5, SAMPLE))) == [1, 1, 1]


def test_messages_of_a_telemetry_log_are_fed_alone() -> None:
    assert sizes(stream((1, SAMPLE), (1, SAMPLE), shared=False)) == [1, 1]


def test_empty_stream_has_no_batches() -> None:
    assert sizes(stream()) == []


@pytest.mark.slow
@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3), st.sampled_from([SAMPLE, SILENT]))), st.booleans())
def test_batches_hold_every_message_once_in_order(rows: list[tuple[int, bytes]], shared: bool) -> None:
    recorded = stream(*sorted(rows, key=lambda row: row[0]), shared=shared)
    assert tuple(itertools.chain.from_iterable(batches(recorded))) == recorded.messages


# Feeding


def test_messages_come_at_their_times() -> None:
    messages = run(stream((3_000_000, SAMPLE), (3_033_333, SAMPLE)))
    assert [message.arrival_us for message in messages] == [3_000_000, 3_033_333]
    assert [field(message, 0) for message in messages] == [3_000_000, 3_033_333]


def test_messages_without_a_time_come_with_the_first_that_has_one() -> None:
    messages = run(stream((None, SAMPLE), (3_000_000, SAMPLE)))
    assert messages[0].arrival_us is None
    assert field(messages[0], 0) == 3_000_000


def test_stream_without_any_time_is_fed_at_boot() -> None:
    assert field(run(stream((None, SAMPLE)))[0], 0) == 0


def test_capture_was_read_a_little_before_it_was_handled() -> None:
    (message,) = run(stream((3_000_000, frame(speed(usec=3_000_000)))))
    assert field(message, 2) == 2998


def test_transport_time_of_a_uart_is_taken_off() -> None:
    # 57 bytes of payload and 12 around it, 86 us each.
    recorded = stream((3_000_000, frame(speed(usec=3_000_000))), shared=False)
    assert [field(run(recorded, baud)[0], 2) for baud in (None, 115200)] == [3000, 2994]


def test_records_belong_to_their_message() -> None:
    messages = run(stream((3_000_000, SAMPLE + frame(pose()) + SILENT + SAMPLE)))
    kinds = [(message.type, [name for name, _ in message.records]) for message in messages]
    assert kinds == [
        ("VISION_SPEED_ESTIMATE", ["VISV"]),
        ("ODOMETRY", ["VISP", "VISV"]),
        ("HEARTBEAT", []),
        ("VISION_SPEED_ESTIMATE", ["VISV"]),
    ]


def test_replay_records_of_the_estimator_are_not_told() -> None:
    (message,) = run(stream((4_000_000, SAMPLE), LOG_REPLAY=1))
    assert [name for name, _ in message.records] == ["VISV"]


def test_damaged_bytes_are_told() -> None:
    (message,) = run(stream((3_000_000, b"noise")))
    assert (message.type, message.verdict.kind) == ("BAD_DATA", VerdictKind.DROPPED)


def test_progress_is_told_by_messages() -> None:
    recorded = stream((1, SAMPLE), (1, SAMPLE), (2, SAMPLE))
    told: list[int] = []
    list(Replay(Vehicle(VehicleConfig()), recorded, None).run(told.append))
    assert told == [2, 3]


def test_line_for_machines_has_floats_in_hex() -> None:
    (message,) = run(stream((3_000_000, SAMPLE)))
    line = message.as_dict()
    assert line["type"] == "VISION_SPEED_ESTIMATE"
    assert line["out"] == [
        ["VISV", 3_000_000, 0, field(message, 2), "3f800000", "40000000", "40400000", hex_of(0.1), 0, 0, 0]
    ]
    assert line["verdict"] == message.verdict.as_dict()


def hex_of(value: float) -> str:
    return struct.pack(">f", value).hex()


def test_same_stream_gives_the_same_lines() -> None:
    recorded = stream(*((3_000_000 + 33_333 * number, SAMPLE) for number in range(20)))
    assert [message.as_dict() for message in run(recorded)] == [message.as_dict() for message in run(recorded)]


def lines(messages: Sequence[ReplayedMessage]) -> list[str]:
    return [message.verdict.kind.value for message in messages]


def test_disabled_vehicle_drops_everything() -> None:
    recorded = replace(stream((3_000_000, SAMPLE)), params={"VISO_TYPE": 0})
    assert lines(run(recorded)) == ["dropped"]


# With the filter watched

BY_EXT_NAV = {
    **{f"EK3_SRC1_{what}": 6 for what in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")},
    "GPS1_TYPE": 0,
}
START_US = 6_000_000
PERIOD_US = 33_333


def flown(count: int, jump_at: int | None = None) -> Stream:
    """Return a stream of poses, which leaps by 9 m at one of them."""
    arrivals_us = range(START_US, START_US + count * PERIOD_US, PERIOD_US)
    leaps = (jump_at is not None and number >= jump_at for number in range(count))
    frames = (frame(odometry(t, x=9.0 * leap)) for t, leap in zip(arrivals_us, leaps, strict=True))
    return stream(*zip(arrivals_us, frames, strict=True), shared=False, **BY_EXT_NAV)


def watched(recorded: Stream) -> tuple[Vehicle, Replay]:
    vehicle = Vehicle(VehicleConfig(by_ekf3(FollowSource, ImuOptions()), defaults=recorded.params))
    return vehicle, Replay(vehicle, recorded, None, FilterWatch(vehicle))


def run_watched(recorded: Stream) -> list[dict[str, Any]]:
    return [message.as_dict() for message in watched(recorded)[1].run()]


@pytest.mark.slow
def test_line_has_the_outcomes_of_its_samples() -> None:
    line = run_watched(flown(30))[-1]
    assert [(outcome["kind"], outcome["outcome"], outcome["model"]) for outcome in line["filter"]] == [
        ("pose", "fused", True),
        ("height", "fused", True),
        ("yaw", "fused", True),
        ("velocity", "fused", True),
    ]
    delays_us = {outcome["time_us"] - line["arrival_us"] for outcome in line["filter"]}
    assert 0 < min(delays_us) <= max(delays_us) < 250_000


@pytest.mark.slow
def test_line_of_a_message_without_samples_has_none() -> None:
    (line,) = run_watched(stream((START_US, SILENT)))
    assert line["filter"] == []


@pytest.mark.slow
def test_line_tells_which_gate_rejected_a_sample() -> None:
    lines = run_watched(flown(90, jump_at=80))
    by_pose = [{outcome["kind"]: outcome for outcome in line["filter"]} for line in lines]
    assert {outcomes["pose"]["rule"] for outcomes in by_pose[70:80]} == {"model_fused"}
    assert {outcomes["pose"]["rule"] for outcomes in by_pose[80:]} == {"model_gate_position"}
    assert min(outcomes["pose"]["ratio"] for outcomes in by_pose[80:]) > 1
    assert {outcomes["velocity"]["rule"] for outcomes in by_pose[80:]} == {"model_fused"}


@pytest.mark.slow
def test_lines_keep_the_order_of_the_stream() -> None:
    recorded = flown(40)
    expected = [message.arrival_us for message in recorded.messages]
    assert [line["arrival_us"] for line in run_watched(recorded)] == expected


@pytest.mark.slow
def test_line_is_held_back_until_its_outcomes_are_known() -> None:
    vehicle, replay = watched(flown(30))
    for message, _ in zip(replay.run(), range(25), strict=False):
        latest_us = max(test.time_us for sample in message.samples or () for test in sample.outcomes)
        assert latest_us <= vehicle.clock.micros64() <= latest_us + 2 * PERIOD_US


@pytest.mark.slow
def test_line_does_not_wait_for_ever() -> None:
    # While yaw has no source nothing calls it out of its buffer, which holds more than half a second.
    recorded = flown(40)
    recorded = replace(recorded, params={**recorded.params, "EK3_SRC1_YAW": 0, "VISO_DELAY_MS": 250})
    vehicle, replay = watched(recorded)
    for message, _ in zip(replay.run(), range(20), strict=False):
        assert message.arrival_us is not None
        waited_us = vehicle.clock.micros64() - message.arrival_us
        assert OUTCOME_WAIT_US <= waited_us <= OUTCOME_WAIT_US + PERIOD_US
        kinds = {test.outcome.kind for sample in message.samples or () for test in sample.outcomes}
        assert kinds == {"pose", "velocity", "height"}


@pytest.mark.slow
def test_vehicle_runs_on_until_the_last_outcome() -> None:
    vehicle, replay = watched(flown(30))
    assert len(list(replay.run())) == 30
    assert vehicle.clock.micros64() == START_US + 29 * PERIOD_US + OUTCOME_WAIT_US


def test_unwatched_replay_ends_with_the_last_message_and_has_no_outcomes() -> None:
    recorded = flown(3)
    vehicle = Vehicle(VehicleConfig(defaults=recorded.params))
    messages = list(Replay(vehicle, recorded, None).run())
    assert vehicle.clock.micros64() == START_US + 2 * PERIOD_US
    assert {"filter" in message.as_dict() for message in messages} == {False}


@pytest.mark.slow
def test_watching_changes_nothing_else() -> None:
    recorded = flown(30)
    vehicle = Vehicle(VehicleConfig(by_ekf3(FollowSource, ImuOptions()), defaults=recorded.params))
    unwatched = [message.as_dict() for message in Replay(vehicle, recorded, None).run()]
    lines_without_outcomes = [{k: v for k, v in line.items() if k != "filter"} for line in run_watched(recorded)]
    assert lines_without_outcomes == unwatched


def test_messages_are_judged_on_after_the_filter_has_ended() -> None:
    """The filter takes most of the time: over a long stream it need not run all the way."""
    times_us = range(3_000_000, 5_000_000, 100_000)
    recorded = stream(*((at_us, frame(odometry(at_us))) for at_us in times_us), shared=False, EK3_SRC1_POSXY=6)

    def replayed(until_us: int | None) -> tuple[list[ReplayedMessage], int]:
        vehicle = Vehicle(VehicleConfig(by_ekf3(FollowSource, ImuOptions()), defaults=recorded.params))
        watch = FilterWatch(vehicle)
        return list(Replay(vehicle, recorded, None, watch, until_us).run()), watch.aiding()[-1].end_us

    (whole, _), (part, end_us) = replayed(None), replayed(4_000_000)
    assert end_us == 4_000_000
    assert [(one.verdict, one.records) for one in part] == [(one.verdict, one.records) for one in whole]
    assert [bool(one.samples) for one in part] == [at_us <= end_us for at_us in times_us]


# Silence


@pytest.fixture
def short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a silence be long that does not take long to run."""
    for name, time_us in (("LONGEST_SILENCE_US", 900_000), ("SILENCE_BEGIN_US", 400_000), ("SILENCE_END_US", 50_000)):
        monkeypatch.setattr(feed, name, time_us)


HOUR_US = 3_600_000_000
WITH_A_HOLE = [(100_000, SAMPLE), (100_000 + HOUR_US, SAMPLE), (150_000 + HOUR_US, SAMPLE)]


def test_silence_of_an_hour_is_passed_over(short_waits: None, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = stream(*WITH_A_HOLE, shared=False)
    vehicle = Vehicle(VehicleConfig(defaults=recorded.params))
    loops = times_of_passes(vehicle, monkeypatch)
    replay = Replay(vehicle, recorded, None)
    messages = list(replay.run())
    assert [field(message, 0) for message in messages] == [arrival_us for arrival_us, _ in WITH_A_HOLE]
    assert len(loops) < 300
    assert [loops[number + 1] - time_us for number, time_us in enumerate(loops[:-1])].count(2500) == len(loops) - 2
    (note,) = replay.notes()
    assert note == "test: gap of 3600 s from 0.100 s on: passed over except its first 0.4 s and last 0.05 s"


def test_health_runs_out_in_a_silence_that_is_passed_over(short_waits: None, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = stream(*WITH_A_HOLE, shared=False)
    vehicle = Vehicle(VehicleConfig(defaults=recorded.params))
    healthy: list[tuple[int, bool]] = []
    advance = vehicle.advance

    def watched(times_us: range) -> int:
        count = advance(times_us[:1])
        if not healthy or healthy[-1][1] != vehicle.visual_odom.healthy():
            healthy.append((vehicle.clock.micros64(), vehicle.visual_odom.healthy()))
        return count

    monkeypatch.setattr(vehicle, "advance", watched)
    list(Replay(vehicle, recorded, None).run())
    assert healthy == [(0, True), (400_000, False), (102_500 + HOUR_US, True)]


def test_time_before_a_recording_begins_is_no_gap(short_waits: None) -> None:
    replay = Replay(Vehicle(VehicleConfig()), stream((HOUR_US, SAMPLE), shared=False), None)
    list(replay.run())
    assert replay.notes() == ()


def test_several_silences_are_one_line(short_waits: None) -> None:
    recorded = stream((2_000_000, SAMPLE), (5_000_000, SAMPLE), (9_000_000, SAMPLE), shared=False)
    replay = Replay(Vehicle(VehicleConfig()), recorded, None)
    list(replay.run())
    (note,) = replay.notes()
    assert note.startswith("test: gap of 4 s from 5.000 s on (2 gaps, 7 s in all; this is the longest): passed over ")


def test_silence_is_run_while_the_vehicle_moves(short_waits: None, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = stream((2_000_000, SAMPLE), shared=False)
    vehicle = Vehicle(VehicleConfig())
    monkeypatch.setattr(vehicle.source, "is_at_rest", lambda _until_us: False)
    loops = times_of_passes(vehicle, monkeypatch)
    replay = Replay(vehicle, recorded, None)
    list(replay.run())
    assert (len(loops), replay.notes()) == (801, ())
